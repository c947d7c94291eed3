// Shift registers at pins of the chip. `node --test .` where the emulator is installed.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Machine } from './machine.mjs';
import { Register } from './register.mjs';
import { Cache } from './xip.mjs';

const SIO = 0xd0000000;
const [DATA, CLOCK, LATCH] = [14, 15, 16];

// A chip that sleeps, with a chain of registers at three of its pins, which the CPU drives.
function chain(outputs) {
  const m = new Machine(undefined, (flash) => {
    const words = new DataView(flash.buffer, flash.byteOffset);
    words.setUint32(0x100, 0x20042000, true);
    for (let i = 1; i < 48; i++) words.setUint32(0x100 + 4 * i, 0x10000201, true);
    words.setUint32(0x200, 0xe7fdbf30, true); // wfi; b back
  }, new Cache(0));
  const register = new Register(m, 1, { data: DATA, clock: CLOCK, latch: LATCH, outputs });
  connect(m);
  const edges = [];
  m.edgeListeners.push((gpio, level, cycle) => { if (gpio >= 64) edges.push([gpio - 64, level, cycle]); });
  return { m, register, edges };
}

function connect(m) {
  for (const pin of [DATA, CLOCK, LATCH]) {
    m.mcu.writeUint32(0x40014004 + 8 * pin, 5);
    m.mcu.writeUint32(SIO + 0x24, 1 << pin);
  }
}

// Drives a pin, and lets cycles pass.
function set(m, pin, high, cycles = 4) {
  m.mcu.writeUint32(SIO + (high ? 0x14 : 0x18), 1 << pin);
  m.run(cycles);
}

// Sends bits, the last output first, and latches them.
function send(m, bits, outputs, cycles) {
  for (let i = outputs - 1; i >= 0; i--) {
    set(m, DATA, bits >> i & 1, cycles);
    set(m, CLOCK, true, cycles);
    set(m, CLOCK, false, cycles);
  }
  set(m, LATCH, true, cycles);
  set(m, LATCH, false, cycles);
}

test('the bit that comes first is at the last output, and all outputs change with the latch', () => {
  const { m, register, edges } = chain(16);
  send(m, 0x8421, 16);
  assert.equal(register.held, 0x8421);
  assert.equal(new Set(edges.map(([, , cycle]) => cycle)).size, 1);
  edges.length = 0;
  send(m, 0x8423, 16);
  assert.deepEqual(edges.map(([output, level]) => [output, level]), [[1, 1]]);
});

test('a bit that is not followed by the latch changes nothing', () => {
  const { m, register, edges } = chain(8);
  send(m, 0x0f, 8);
  edges.length = 0;
  for (let i = 0; i < 5; i++) { set(m, CLOCK, true); set(m, CLOCK, false); }
  assert.deepEqual([register.held, edges], [0x0f, []]);
});

test('all outputs are high at power-up, and stay as they are over a reset of the chip', () => {
  const { m, register } = chain(8);
  assert.equal(register.held, 0xff);
  send(m, 0x35, 8);
  m.reset();
  m.run(1_000);
  assert.equal(register.held, 0x35);
  register.powerUp();
  assert.equal(register.held, 0xff);
});

test('the shortest time between edges is told', () => {
  const { m, register } = chain(8);
  assert.equal(register.least, Infinity);
  send(m, 0x35, 8, 7);
  assert.equal(register.least, 7);
  set(m, CLOCK, true, 3);
  set(m, CLOCK, false, 9);
  assert.equal(register.least, 3);
});
