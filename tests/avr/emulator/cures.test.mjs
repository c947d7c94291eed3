// What is put right in avr8js: a test for each. `node --test .` where the simulator is installed.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { SREG } from './core.mjs';
import { Machine } from './machine.mjs';
import { Spindle } from './pins.mjs';

const [NOP, SEI, CLI, RETI, RET, SLEEP, WDR, NEG, LOOP] = [0, 0x9478, 0x94f8, 0x9518, 0x9508, 0x9588, 0x95a8, 0x9401, 0xcfff];
const ldi = (register, value) => 0xe000 | (value & 0xf0) << 4 | (register - 16) << 4 | value & 0xf;
const sts = (address, register) => [0x9200 | register << 4, address];
const set = (address, value) => [ldi(16, value), ...sts(address, 16)];
const out = (address, register) => 0xb800 | (address & 0x30) << 5 | register << 4 | address & 0xf;
const MAIN = 0x100;

// A machine that runs words from MAIN on, with these at vectors and elsewhere, by word address.
function machine(words, others = {}) {
  const flash = new Uint16Array(0x20000);
  flash.fill(RETI, 2, 0x72);
  flash.set([0x940c, MAIN], 0);
  flash.set(words, MAIN);
  for (const [at, code] of Object.entries(others)) flash.set(code, Number(at));
  return new Machine(flash);
}

// Executes so many instructions, or entries of interrupts.
function steps(m, count) { for (let i = 0; i < count; i++) m.cpu.step(Infinity); }

function executed(words, registers = {}, flags = 0) {
  const m = machine(words);
  steps(m, 1);
  for (const [n, value] of Object.entries(registers)) m.cpu.data[n] = value;
  m.cpu.data[SREG] = flags;
  const before = m.cpu.cycles;
  steps(m, words.length);
  return { flags: m.cpu.data[SREG], cycles: m.cpu.cycles - before, data: m.cpu.data };
}

test('half carry is that of bit 3', () => {
  assert.equal(executed([0x0c01], { 0: 0x08, 1: 0x08 }).flags & 0x20, 0x20); // add r0, r1
  assert.equal(executed([0x0c01], { 0: 0x01, 1: 0x01 }).flags & 0x20, 0);
});

test('the negation of 0x80 overflows', () => {
  assert.equal(executed([NEG], { 0: 0x80 }).flags & 0x0f, 0x0d);
  assert.equal(executed([NEG], { 0: 0x7f }).flags & 0x08, 0);
});

test('zero stays zero over a whole borrow', () => {
  for (const op of [0x0801, 0x0401]) assert.equal(executed([op], { 0: 0, 1: 0xff }, 0x03).flags & 0x03, 0x03); // sbc, cpc
});

test('a product of zero is zero', () => {
  assert.equal(executed([0x0398], { 17: 0, 16: 5 }).flags & 2, 2); // fmulsu r17, r16
});

test('CBI takes two cycles', () => { assert.equal(executed([0x982c]).cycles, 2); });

test('a return beyond 64 Ki words', () => {
  for (const op of [RET, RETI]) {
    const m = machine([op]);
    steps(m, 1);
    const { cpu } = m;
    cpu.data.set([1, 0, 0], 0x21fd);
    cpu.SP = 0x21fc;
    steps(m, 1);
    assert.equal(cpu.pc, 0x10000);
  }
});

test('an interrupt is entered in five cycles, from sleep in nine', () => {
  for (const [wait, cycles] of [[[NOP, NOP], 5], [[...set(0x53, 1), SLEEP], 9]]) {
    const m = machine([...wait, LOOP], { 42: [LOOP] });
    steps(m, wait.length);
    const { cpu } = m;
    cpu.data[SREG] |= 0x80;
    const before = cpu.cycles;
    cpu.queueInterrupt({ address: 42, flagRegister: 0x35, flagMask: 2 });
    cpu.enter();
    assert.equal(cpu.cycles - before, cycles);
    assert.equal(cpu.pc, 42);
  }
});

test('an instruction is executed behind SEI and behind RETI', () => {
  // USART2's transmitter is always empty; its interrupt asks for as long as it is enabled.
  const m = machine([...set(0xd1, 0x28), SEI, NOP, NOP, NOP], { 104: [0x9503, RETI] }); // inc r16; reti
  steps(m, 4);
  const { cpu } = m;
  assert.equal(cpu.pc, MAIN + 4);
  steps(m, 1);
  assert.equal(cpu.pc, 104);
  steps(m, 2);
  assert.equal(cpu.pc, MAIN + 5);
  steps(m, 1);
  assert.equal(cpu.pc, 104);
});

test('without its enable a sleep does nothing', () => {
  const m = machine([SEI, SLEEP, NOP, LOOP]);
  steps(m, 4);
  assert.ok(!m.cpu.asleep);
});

test('UDRE stays when its interrupt is entered, and is cleared by writing UDR', () => {
  const m = machine([...set(0xc1, 0x28), SEI, NOP, LOOP], { 52: [LOOP] });
  steps(m, 6);
  assert.equal(m.cpu.pc, 52);
  const uart = m.uarts[0];
  assert.equal(m.cpu.data[0xc0] & 0x20, 0x20);
  uart.write(1);
  assert.equal(m.cpu.data[0xc0] & 0x20, 0x20, 'the first goes to the shift register');
  uart.write(2);
  assert.equal(m.cpu.data[0xc0] & 0x20, 0);
});

test('bytes take their time, follow one another, and are buffered', () => {
  const m = machine([...set(0xc4, 8), ...set(0xc1, 0x18), LOOP]);
  steps(m, 6);
  const { cpu } = m;
  const uart = m.uarts[0];
  const sent = [];
  uart.sent = (byte) => sent.push([byte, cpu.cycles]);
  const now = cpu.cycles;
  uart.write(65);
  uart.write(66);
  assert.throws(() => uart.write(67));
  m.runUntil(now + 4000, false);
  assert.deepEqual(sent.map(([byte]) => byte), [65, 66]);
  assert.ok(Math.abs(sent[0][1] - now - 1440) <= 4 && Math.abs(sent[1][1] - sent[0][1] - 1440) <= 2, `${sent}`);
});

test('three bytes wait, a fourth is lost, and a write to UCSRB loses none', () => {
  const m = machine([...set(0xc4, 8), ...set(0xc1, 0x10), LOOP]);
  steps(m, 6);
  const { cpu } = m;
  m.lines[0].send([1, 2, 3]);
  m.runUntil(cpu.cycles + 3 * 1389 + 1500, false);
  cpu.writeHooks[0xc1](0x90, 0x10, 0xc1, 0xff);
  assert.equal(m.uarts[0].lost, 0);
  const read = () => cpu.readHooks[0xc6]();
  assert.deepEqual([read(), read(), read(), cpu.data[0xc0] & 0x80], [1, 2, 3, 0]);
  m.lines[0].send([1, 2, 3, 4]);
  m.runUntil(cpu.cycles + 4 * 1389 + 1500, false);
  assert.equal(m.uarts[0].lost, 1);
  assert.deepEqual([read(), read(), cpu.data[0xc0] & 0x08, read()], [1, 2, 8, 4]);
});

// Timer 1 clears itself at a count.
const ctc = (top, clock) => [...set(0x89, top >> 8), ...set(0x88, top & 0xff), ...set(0x6f, 2), ...set(0x81, 8 | clock)];

test('a timer has its interrupts in time', () => {
  for (const [clock, divider] of [[1, 1], [2, 8], [3, 64]]) {
    const m = machine([...ctc(199, clock), SEI, LOOP]);
    const { cpu } = m;
    const at = [];
    const enter = cpu.enter.bind(cpu);
    cpu.enter = () => { at.push(cpu.cycles); enter(); };
    m.runUntil(200 * divider * 10, false);
    assert.ok(at.length >= 9, `${at}`);
    // The timer starts at cycle 15, and its prescaler runs by itself from cycle 0 on. An instruction of two cycles may be under way.
    const first = Math.floor(15 / divider) * divider + 200 * divider;
    assert.ok(at[0] >= first && at[0] <= first + 2, `${divider}: ${at}`);
    at.slice(1).forEach((cycle, n) => assert.ok(Math.abs(cycle - at[n] - 200 * divider) <= 2, `${divider}: ${at}`));
  }
});

test('a flag goes up one clock behind the match', () => {
  const m = machine([...ctc(4, 2), ...Array(100).fill(NOP)]);
  steps(m, 9);
  const { cpu } = m;
  while (!(cpu.data[0x36] & 2)) steps(m, 1);
  assert.equal(cpu.cycles % 8, 0);
  assert.equal(cpu.readHooks[0x84](), 0);
});

test('a flag is cleared alone, also by SBI', () => {
  const m = machine([0x9ab1, LOOP]); // sbi 0x16, 1: TIFR1, OCF1A
  m.cpu.data[0x36] = 7;
  steps(m, 2);
  assert.equal(m.cpu.data[0x36], 5);
});

test('a counter beyond its top goes on to its maximum', () => {
  const m = machine([...set(0x81, 9), LOOP]);
  steps(m, 3);
  const timer = m.timers[1];
  m.cpu.writeHooks[0x85](0xff);
  m.cpu.writeHooks[0x84](0x00);
  m.cpu.writeHooks[0x89](0);
  m.cpu.writeHooks[0x88](10);
  m.runUntil(m.cpu.cycles + 100, false);
  assert.ok(timer.counted() > 0xff40, `${timer.counted()}`);
  m.runUntil(m.cpu.cycles + 300, false);
  assert.ok(timer.counted() <= 10, `${timer.counted()}`);
});

test('a pin flag waits while it is masked, and groups do not meddle with each other', () => {
  const m = machine([LOOP]);
  const { cpu, pins } = m;
  const write = (address, value) => { if (!cpu.writeHooks[address]?.(value, cpu.data[address], address, 0xff)) cpu.data[address] = value; };
  write(0x6b, 0x10);
  pins.drive(12, true);
  assert.equal(cpu.data[0x3b], 1);
  assert.equal(cpu.nextInterrupt, -1);
  write(0x68, 1);
  assert.equal(cpu.nextInterrupt, 18);
  write(0x6d, 0xff);
  assert.equal(cpu.nextInterrupt, 18);
  write(0x3b, 1);
  assert.equal(cpu.nextInterrupt, -1);
  write(0x6a, 0x0c); // INT5 at a rising edge
  pins.drive(37, true);
  pins.drive(37, false);
  assert.equal(cpu.data[0x3c], 0x20);
});

test('an input that nobody drives is pulled up', () => {
  const m = machine([...set(0x25, 1), LOOP]);
  steps(m, 3);
  assert.equal(m.cpu.data[0x23], 1);
});

// A byte is programmed.
const programmed = [...set(0x41, 7), ...set(0x40, 0x5a), 0x9afa, 0x9af9, LOOP]; // sbi 0x1f, 2; sbi 0x1f, 1

test('a byte of the EEPROM takes 3.4 ms, and a cut leaves anything in it', () => {
  const m = machine(programmed);
  steps(m, 8);
  const began = m.cpu.cycles;
  assert.equal(m.cpu.data[0x3f] & 2, 2);
  m.runUntil(began + 54_000, false);
  assert.equal(m.cpu.data[0x3f] & 2, 2);
  assert.deepEqual([0, 1, 2, 3].map((chance) => m.cells.left(chance)[7]), [0xff, 0xff, 0x5a ^ 0x55, 0x5a]);
  m.runUntil(began + 54_410, false);
  assert.equal(m.cpu.data[0x3f] & 2, 0);
  assert.deepEqual([0, 1, 2, 3].map((chance) => m.cells.left(chance)[7]), [0x5a, 0x5a, 0x5a, 0x5a]);
});

test('a bite of the watchdog resets all but RAM, and the watchdog stays on', () => {
  const m = machine([WDR, ...set(0x60, 0x18), ...set(0x60, 0x08), ...set(0x200, 9), ...set(0x24, 1), LOOP]);
  m.runUntil(260_000, false);
  assert.equal(m.resets, 1);
  assert.deepEqual([0x54, 0x60, 0x200].map((at) => m.cpu.data[at]), [8, 8, 9]);
  // It cannot be switched off while WDRF stands.
  const write = m.cpu.writeHooks[0x60];
  write(0x18, 8);
  write(0, 8);
  assert.equal(m.cpu.data[0x60] & 8, 8);
  m.cpu.data[0x54] = 0;
  write(0x18, 8);
  write(0, 8);
  assert.equal(m.cpu.data[0x60] & 8, 0);
});

test('a spindle has its pulses in time', () => {
  const m = machine([LOOP]);
  m.fit(new Spindle({ index: 13, sync: 79, pulses: 4 }));
  const edges = [];
  m.pins.edge = (port, bit, rising) => { if (!rising) edges.push([port, m.cpu.cycles]); };
  m.spindle.turn(600, 0);
  m.runUntil(3_400_000, false);
  assert.deepEqual(edges.map(([port]) => port), [9, 9, 9, 9, 1, 9, 9, 9, 9, 1]);
  assert.ok(Math.abs(edges[4][1] - 1_616_000) < 4, `${edges}`);
});
