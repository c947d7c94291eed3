// What is put right in rp2040js: a test for each. `node --test .` where the emulator is installed.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { CLOCK_HZ, Machine } from './machine.mjs';
import { Cache } from './xip.mjs';
import { Motors, Noise, Spindle } from './pins.mjs';

const RAM_END = 0x20042000;
const CODE = 0x200;
const HANDLER = 0x300;

// A machine that runs Thumb code, with another one for all interrupts. Flash is free, if nothing else is said.
function machine(code, handler = [0x4770], miss = 0) {
  return new Machine(undefined, (flash) => {
    const words = new DataView(flash.buffer, flash.byteOffset);
    const vectors = 0x100;
    words.setUint32(vectors, RAM_END, true);
    for (let i = 1; i < 48; i++) words.setUint32(vectors + 4 * i, 0x10000000 + (i === 1 ? CODE : HANDLER) | 1, true);
    code.forEach((op, i) => words.setUint16(CODE + 2 * i, op, true));
    handler.forEach((op, i) => words.setUint16(HANDLER + 2 * i, op, true));
  }, new Cache(miss));
}

const LOOP = [0xe7fe]; // b .
const SLEEP = [0xbf30, 0xe7fd]; // wfi; b back

test('a handler begins at an even address, and takes its time', () => {
  const m = machine(LOOP, LOOP);
  m.run(10);
  const { core } = m.mcu;
  core.enabledInterrupts = 1 << 27;
  core.setInterrupt(27, true);
  const before = m.cycle;
  m.step(Infinity);
  assert.equal(core.PC % 2, 0);
  assert.equal(core.PC, 0x10000000 + HANDLER);
  assert.ok(m.cycle - before >= 15);
});

test('a pending SysTick ends a sleep', () => {
  const m = machine(SLEEP);
  m.run(100);
  m.mcu.writeUint32(0xe000e014, 12799);
  m.mcu.writeUint32(0xe000e018, 0);
  m.mcu.writeUint32(0xe000e010, 7);
  let entered = 0;
  const { core } = m.mcu;
  const enter = core.exceptionEntry;
  core.exceptionEntry = (n) => { entered += n === 15; enter(n); };
  m.run(128_000);
  assert.ok(entered >= 9, `${entered} times`);
});

// A state machine of PIO0 that drives GP2, and its program.
function pio(m, program) {
  const { mcu } = m;
  const at = 0x50200000;
  program.forEach((op, i) => mcu.writeUint32(at + 0x48 + 4 * i, op));
  mcu.writeUint32(at + 0xc8, 1 << 16);
  mcu.writeUint32(at + 0xcc, (program.length - 1) << 12);
  mcu.writeUint32(at + 0xd0, 1 << 19);
  mcu.writeUint32(at + 0xdc, 1 << 26 | 2 << 5);
  mcu.writeUint32(at + 0xd8, 0xe081); // set pindirs, 1
  mcu.writeUint32(0x40014004 + 8 * 2, 6); // GP2 is PIO0's
  const edges = [];
  m.edgeListeners.push((gpio, level, cycle) => { if (gpio === 2) edges.push([cycle, level]); });
  mcu.writeUint32(at, 1);
  return edges;
}

test('state machines run on the clock of the CPU, with delays', () => {
  const m = machine(SLEEP);
  m.run(100);
  const edges = pio(m, [0xe301, 0xe400]); // set pins, 1 [3]; set pins, 0 [4]
  m.run(10_000);
  const rises = edges.filter(([, level]) => level).map(([cycle]) => cycle);
  assert.ok(rises.length >= 1_100);
  assert.deepEqual(new Set(rises.slice(1).map((cycle, i) => cycle - rises[i])), new Set([9]));
});

test('long waits are as long as if they were counted', () => {
  const m = machine(SLEEP);
  m.run(100);
  // set pins, 1; mov x, osr; jmp x-- here; set pins, 0; pull block
  const edges = pio(m, [0xe001, 0xa027, 0x0042, 0xe000, 0x80a0]);
  m.run(50);
  const high = (count) => {
    const from = edges.length;
    m.mcu.writeUint32(0x50200010, count);
    m.run(count + 100);
    const [rise, fall] = edges.slice(from);
    return fall[0] - rise[0];
  };
  for (const count of [0, 1, 2, 1_000, 100_000]) assert.equal(high(count), count + 3, `${count}`);
});

test('a FIFO that is joined or parted is empty', () => {
  const m = machine(LOOP);
  const at = 0x50200000;
  m.mcu.writeUint32(at + 0x10, 1);
  assert.equal(m.mcu.readUint32(at + 0xc) & 0xf, 1);
  m.mcu.writeUint32(at + 0xd0, 0x80000000);
  assert.equal(m.mcu.readUint32(at + 0xc) & 0xf, 0);
});

test('a byte takes its time on the line, and then interrupts', () => {
  const m = machine(SLEEP);
  m.run(100);
  const uart = 0x40034000;
  const { mcu } = m;
  mcu.clkPeri = CLOCK_HZ;
  mcu.writeUint32(uart + 0x24, 69);
  mcu.writeUint32(uart + 0x28, 28);
  mcu.writeUint32(uart + 0x38, 1 << 5);
  mcu.writeUint32(uart, 0x41);
  mcu.writeUint32(uart, 0x42);
  assert.equal(mcu.readUint32(uart + 0x18) & 1 << 5, 1 << 5, 'full');
  m.run(11_000);
  assert.equal(m.heard[0].length, 0);
  m.run(300);
  assert.deepEqual(m.heard[0], [0x41]);
  assert.equal(mcu.readUint32(uart + 0x3c) & 1 << 5, 1 << 5, 'it may take another');
  mcu.writeUint32(uart + 0x44, 1 << 5);
  assert.equal(mcu.readUint32(uart + 0x3c) & 1 << 5, 0);
});

test('a byte that is not taken in time is lost, and said to be', () => {
  const m = machine(SLEEP);
  m.run(100);
  m.uarts[0].feed(0x41);
  m.uarts[0].feed(0x42);
  const first = m.mcu.readUint32(0x40034000);
  assert.equal(first & 0xff, 0x41);
  assert.equal(first & 1 << 11, 1 << 11);
  assert.equal(m.mcu.readUint32(0x40034018) & 1 << 4, 1 << 4, 'empty');
});

test('the DMA has aborted what it was told to', () => {
  const m = machine(LOOP);
  m.mcu.writeUint32(0x50000444, 3);
  assert.equal(m.mcu.readUint32(0x50000444), 0);
});

test('the boot ROM has the functions of the flash', () => {
  const m = machine(LOOP);
  const { mcu } = m;
  const table = mcu.readUint16(0x14);
  const names = [];
  for (let at = table; mcu.readUint16(at); at += 4) names.push(String.fromCharCode(mcu.readUint8(at), mcu.readUint8(at + 1)));
  assert.deepEqual(names, ['IF', 'EX', 'FC', 'CX', 'RE', 'RP', 'MC', 'C4', 'UB']);
});

test('to write to flash clears bits alone', () => {
  const m = machine(LOOP);
  const { mcu } = m;
  const { core } = mcu;
  const write = (word) => {
    mcu.writeUint32(0x20000000, word);
    [core.registers[0], core.registers[1], core.registers[2]] = [0x1000, 0x20000000, 4];
    core.LR = 0x10000000 + CODE | 1;
    core.PC = 0x180;
    m.run(100);
  };
  write(0xffffff00);
  write(0xff00ffff);
  assert.equal(mcu.readUint32(0x10001000), 0xff00ff00);
});

test('a reset by the watchdog keeps scratch registers and flash', () => {
  const m = machine(LOOP);
  m.mcu.flash[0x1000] = 7;
  m.mcu.writeUint32(0x4005800c, 0x4b5a);
  m.mcu.writeUint32(0x40058000, 0x80000000);
  m.run(10);
  assert.equal(m.resets, 1);
  assert.equal(m.mcu.readUint32(0x4005800c), 0x4b5a);
  assert.equal(m.mcu.readUint32(0x40058008), 2, 'the reason');
  assert.equal(m.mcu.flash[0x1000], 7);
});

test('a CPU that is stuck is bitten once', () => {
  const m = machine(LOOP);
  m.mcu.writeUint32(0x40058004, 2_000);
  m.mcu.writeUint32(0x40058000, 1 << 30);
  m.stick();
  m.run(990 * 128);
  assert.equal(m.resets, 0);
  m.run(20 * 128);
  assert.equal(m.resets, 1);
  assert.equal(m.mcu.readUint32(0x40058008), 1, 'the reason');
  m.run(10 * 128_000);
  assert.equal(m.resets, 1);
});

// A device on the bus that has been asked for its descriptor.
function device() {
  const m = machine(SLEEP);
  const [unit, memory] = [0x50110000, 0x50100000];
  m.run(100);
  m.mcu.writeUint32(unit + 0x40, 1);
  m.mcu.writeUint32(unit + 0x4c, 1 << 16);
  m.run(3 * 128_000);
  assert.equal(m.mcu.readUint32(unit + 0x50) >>> 19 & 1, 1, 'the bus is reset');
  m.mcu.writeUint32(unit + 0x50, 1 << 19);
  m.run(12 * 128_000);
  assert.equal(m.mcu.readUint32(unit + 0x50) >>> 17 & 1, 1, 'a request has come');
  assert.equal(m.mcu.readUint32(memory), 0x01000680);
  return { m, unit, memory };
}

test('USB has a buffer for as long as its packet needs', () => {
  const { m, unit, memory } = device();
  const control = (word) => {
    m.mcu.writeUint32(memory + 0x80, word);
    return m.mcu.readUint32(memory + 0x80);
  };
  const [FULL, DATA1, AVAILABLE] = [1 << 15, 1 << 13, 1 << 10];
  assert.equal(control(FULL | DATA1 | AVAILABLE | 18) & AVAILABLE, AVAILABLE);
  m.run(128 * 60);
  assert.equal(m.mcu.readUint32(memory + 0x80) & (FULL | AVAILABLE), 0);
  assert.equal(m.mcu.readUint32(unit + 0x58), 1);
  // Its acknowledgement waits for a buffer.
  m.run(128_000);
  assert.equal(m.mcu.readUint32(unit + 0x58), 1);
  m.mcu.writeUint32(memory + 0x84, DATA1 | AVAILABLE);
  m.run(128 * 60);
  assert.equal(m.mcu.readUint32(unit + 0x58), 3);
});

test('packets of USB out of turn are faults', () => {
  const { m, memory } = device();
  m.mcu.writeUint32(memory + 0x80, 1 << 15 | 1 << 10 | 18);
  assert.throws(() => m.run(128 * 60), /out of turn/);
});

test('switches share a pin, and let go some steps back', () => {
  const [levels, edgeListeners, is] = [[0, 0], [], {}];
  const motors = new Motors({ levels, edgeListeners, drive: (gpio, high) => { is[gpio] = high; } }, [{ step: 0, dir: 1 }]);
  const ends = (gpio, opens) => [
    { gpio, opens, motor: 0, step: -2, above: false, back: 2 },
    { gpio, opens, motor: 0, step: 2, above: true, back: 2 },
  ];
  motors.wire([...ends(5, false), ...ends(6, true)]);
  const high = [is[5]];
  for (const down of [1, 1, 1, 0, 0, 0, 0, 0, 1, 1]) {
    levels[1] = down;
    edgeListeners[0](0, 1, 0);
    high.push(is[5]);
    assert.equal(is[6], !is[5]);
  }
  //                       0     -1    -2     -3     -2     -1     0     1     2      1      0
  assert.deepEqual(high, [true, true, false, false, false, false, true, true, false, false, true]);
});

// Numbers that look random, the same each time.
function* numbers(seed) {
  for (let x = seed; ; ) {
    x ^= x << 13; x ^= x >>> 17; x ^= x << 5;
    yield x >>> 0;
  }
}

// Where instructions of the next test find words, and a core of which they are tried: registers and flags.
const WINDOW = 0x20001000;
function prepare(core, registers, flags) {
  registers.forEach((value, i) => { core.registers[i] = value; });
  [core.N, core.Z, core.C, core.V] = [1, 2, 4, 8].map((bit) => (flags & bit) > 0);
  core.interruptsUpdated = false;
}

// What differs from rp2040js on purpose: the carry behind a shift by none, or by 32 and more, and the overflow where the carry takes the second number
// across the ends of its range; and where BLX goes to by the link register, which rp2040js has written by then.
function differs(op, registers, flags) {
  const [row, second, carry] = [op >> 6, registers[op >> 3 & 7], flags & 4 ? 1 : 0];
  const by = second & 0xff;
  const isShift = [0x102, 0x103, 0x104].includes(row) && (by === 0 || by >= 32);
  const isSum = (row === 0x105 && carry) || (row === 0x106 && !carry);
  return { carry: isShift, overflow: isSum && second === 0x7fffffff, link: op === 0x47f0 };
}

test('each instruction of a sprint does what it does in rp2040js', () => {
  const [theirs, ours] = [machine(LOOP), machine(LOOP)];
  const next = numbers(1);
  const number = () => next.next().value;
  const values = [0, 1, 32, 0x7fffffff, 0x80000000, 0xffffffff];
  const value = () => {
    const kind = number() % 4;
    return kind === 0 ? values[number() % 6] : kind === 1 ? number() : kind === 2 ? number() % 40 : WINDOW + 0x400 + number() % 64 * 4;
  };
  let taken = 0;
  for (let op = 0; op < 65536; op++) {
    const registers = Array.from({ length: 16 }, value);
    [registers[13], registers[14], registers[15]] = [WINDOW + 0x400, 0x10000301, 0x10000400];
    const [low, flags] = [op >> 11 === 0x1e ? 0xd000 | number() & 0x2fff : number() & 0xffff, number() & 15];
    for (const { mcu } of [theirs, ours]) {
      [op, low].forEach((half, i) => { mcu.flashView.setUint16(0x400 + 2 * i, half, true); });
      prepare(mcu.core, registers, flags);
    }
    const spent = ours.sprint(1);
    const state = ({ core }) => [...core.registers, core.N, core.Z, core.C, core.V];
    if (!spent) {
      assert.deepEqual(state(ours.mcu), state((prepare(theirs.mcu.core, registers, flags), theirs.mcu)), `${op.toString(16)} leaves all as it is`);
      continue;
    }
    taken++;
    assert.equal(spent, theirs.mcu.core.executeInstruction(), `cycles of ${op.toString(16)}`);
    const [wanted, is, free] = [state(theirs.mcu), state(ours.mcu), differs(op, registers, flags)];
    if (free.carry) is[18] = wanted[18];
    if (free.overflow) is[19] = wanted[19];
    if (free.link) is[15] = wanted[15];
    assert.deepEqual(is, wanted, `${op.toString(16)} with ${registers.map((x) => x.toString(16))}, ${flags}`);
    const [from, to] = [0x1000, 0x1800];
    assert.equal(Buffer.compare(theirs.mcu.sram.subarray(from, to), ours.mcu.sram.subarray(from, to)), 0, `memory of ${op.toString(16)}`);
  }
  assert.ok(taken > 40_000, `${taken}`);
});

test('flags and places behind what rp2040js has wrong', () => {
  const m = machine(LOOP);
  const { core } = m.mcu;
  const after = (op, first, second, flags) => {
    m.mcu.flashView.setUint16(0x400, op, true);
    prepare(core, [first, second], flags);
    core.PC = 0x10000400;
    m.sprint(1);
    return [core.registers[0], core.C, core.V];
  };
  const CARRY = 4;
  assert.deepEqual(after(0x4148, 0, 0x7fffffff, CARRY), [0x80000000, false, true], 'adcs');
  assert.deepEqual(after(0x4188, 0, 0x7fffffff, 0), [0x80000000, false, false], 'sbcs');
  assert.deepEqual(after(0x4088, 1, 0, CARRY), [1, true, false], 'lsls by 0');
  assert.deepEqual(after(0x40c8, 0x80000000, 0, 0), [0x80000000, false, false], 'lsrs by 0');
  assert.deepEqual(after(0x40c8, 0x80000000, 32, 0), [0, true, false], 'lsrs by 32');
  assert.deepEqual(after(0x4108, 0x80000000, 40, 0), [0xffffffff, true, false], 'asrs by 40');
  core.LR = 0x10000801;
  after(0x47f0, 0, 0, 0);
  assert.deepEqual([core.PC, core.LR], [0x10000800, 0x10000403], 'blx lr');
});

test('a sprint ends before what is not memory', () => {
  // ldr r1, [r0]; str r1, [r2]; then the timer.
  const m = machine([0x6801, 0x6011, ...LOOP]);
  [m.mcu.core.registers[0], m.mcu.core.registers[2]] = [0x20000000, 0x40054000];
  assert.equal(m.sprint(100), 2);
  assert.equal(m.mcu.core.PC, 0x10000000 + CODE + 2);
  m.step(m.cycle + 1);
  assert.equal(m.mcu.core.PC, 0x10000000 + CODE + 4);
});

test('the sensors of a spindle see their marks at its speed', () => {
  const m = machine(SLEEP);
  const seen = [];
  m.drive = (gpio, high) => seen.push([gpio, high, m.cycle]);
  m.spindle = new Spindle(m, { index: 5, sync: 6, pulses: 4 });
  m.run(1e6);
  assert.deepEqual(seen, [], 'it stands still');
  m.spindle.turn(600);
  m.run(2.55 * CLOCK_HZ / 10);
  const falls = (gpio) => seen.filter(([pin, high]) => pin === gpio && !high).map(([, , cycle]) => cycle);
  assert.deepEqual([falls(5).length, falls(6).length], [3, 10]);
  const [first, second] = falls(5);
  assert.equal(second - first, CLOCK_HZ / 10);
  assert.equal(falls(6)[1] - falls(6)[0], CLOCK_HZ / 40);
  m.spindle.turn(-300);
  m.run(CLOCK_HZ);
  assert.deepEqual([falls(5).length, falls(6).length], [8, 30]);
});

test('a line of flash costs its price once, until two others of its set have been read', () => {
  const cache = new Cache(50);
  const [a, b, c] = [0x10000000, 0x10002000, 0x10004000];
  const costs = (at) => cache.touch(at);
  assert.deepEqual([a, a + 4, a + 7, a + 8].map(costs), [50, 0, 0, 50]);
  assert.deepEqual([b, a, b, a].map(costs), [50, 0, 0, 0]);
  // The one that was used least recently goes.
  assert.deepEqual([c, a, b].map(costs), [50, 0, 50]);
  cache.flush();
  assert.deepEqual([a, b].map(costs), [50, 50]);
  assert.equal(cache.waited, 350);
});

test('code in flash waits for its lines, and for numbers there', () => {
  // Twice around four instructions in a line: only the first time waits. ldr r0, [pc] reads the next line.
  const waited = (code, miss) => { const m = machine(code, undefined, miss); m.run(1000); return m.cache.waited; };
  assert.equal(waited([0xbf00, 0xbf00, 0xbf00, 0xe7fb], 50), 50);
  assert.equal(waited([0x4801, 0xbf00, 0xbf00, 0xe7fb, 0x1234, 0x5678], 50), 100);
  assert.equal(waited([0xbf00, 0xbf00, 0xbf00, 0xe7fb], 0), 0);
});

test('an alarm of the timer goes off when the count is its value', () => {
  const m = machine(SLEEP);
  m.run(77);
  const { core } = m.mcu;
  let seen;
  const enter = core.exceptionEntry;
  core.exceptionEntry = (n) => { seen ??= m.mcu.readUint32(0x40054028); enter(n); };
  core.enabledInterrupts = 1;
  m.mcu.writeUint32(0x40054038, 1);
  const due = m.mcu.readUint32(0x40054028) + 10;
  m.mcu.writeUint32(0x40054010, due);
  m.run(128 * 20);
  assert.equal(seen, due);
});

test('pads are as after a reset: pulled down, 4 mA', () => {
  const { gpio } = machine(LOOP).mcu;
  assert.ok(gpio.every(({ padValue }) => padValue === 0x56));
});

// movs r0, #3; lsls r0, r0, #28; ldr r1, [r0]; b .
const NOWHERE = [0x2003, 0x0700, 0x6801, 0xe7fe];

test('an access where nothing is faults, at its own address', () => {
  const m = machine(NOWHERE, LOOP);
  m.run(100);
  const { core } = m.mcu;
  assert.deepEqual([core.IPSR, core.PC], [3, 0x10000000 + HANDLER]);
  assert.equal(m.mcu.readUint32(core.SPmain + 0x18), 0x10000000 + CODE + 4);
});

test('without a place for the frame of a fault the CPU stands still', () => {
  for (const sp of [0x20000000, 0x20000018]) {
    const m = machine(NOWHERE, LOOP);
    m.mcu.core.SPmain = sp;
    m.run(100);
    assert.ok(m.mcu.core.waiting);
  }
});

test('the stack tells how deep it has been', () => {
  const m = machine([0xb40f, 0xbc0f, 0xe7fe]); // push {r0-r3}; pop {r0-r3}; b .
  m.run(100);
  assert.equal(m.deepest(), 16);
});

test('noise changes the level of a pin twice in a period', () => {
  const m = machine(LOOP);
  const edges = [];
  m.drive = (gpio, high) => edges.push([gpio, high]);
  m.noise = new Noise(m, { gpio: 5, period: 64 });
  m.run(130);
  assert.deepEqual(edges, [[5, false], [5, true], [5, false], [5, true]]);
});
