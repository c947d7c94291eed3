// What is put right in rp2040js: a test for each. `node --test .` where the emulator is installed.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { CLOCK_HZ, Machine } from './machine.mjs';
import { Motors } from './pins.mjs';

const RAM_END = 0x20042000;
const CODE = 0x200;
const HANDLER = 0x300;

// A machine that runs Thumb code, with another one for all interrupts.
function machine(code, handler = [0x4770]) {
  return new Machine(undefined, (flash) => {
    const words = new DataView(flash.buffer, flash.byteOffset);
    const vectors = 0x100;
    words.setUint32(vectors, RAM_END, true);
    for (let i = 1; i < 48; i++) words.setUint32(vectors + 4 * i, 0x10000000 + (i === 1 ? CODE : HANDLER) | 1, true);
    code.forEach((op, i) => words.setUint16(CODE + 2 * i, op, true));
    handler.forEach((op, i) => words.setUint16(HANDLER + 2 * i, op, true));
  });
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
  assert.deepEqual(names, ['IF', 'EX', 'FC', 'CX', 'RE', 'RP', 'MC', 'C4']);
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
