// The model of drivers: a test for what tests of the image rely on. `node --test .` where the emulator is installed.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { CLOCK_HZ } from './machine.mjs';
import { checksum, Drivers } from './tmc2209.mjs';

const FULL_STEP = 8;
// Eight microsteps of which each takes so many cycles: 1,000 full steps a second.
const GAP = CLOCK_HZ / 8000;

// A driver with the address 0, whose motor is held up at -10 full steps, and what it does.
function driver() {
  const is = { diag: undefined, alarms: [] };
  const machine = {
    cycle: 0,
    byteListeners: [],
    drive: (gpio, high) => { is.diag = high; },
    mcu: { clock: { createAlarm: (end) => ({ schedule: () => is.alarms.push(end) }) } },
  };
  const motors = { stepListeners: [] };
  const drivers = new Drivers(machine, motors);
  drivers.wire([{ address: 0, motor: 0, gpio: 4, stop: -10, above: false, powered: true }]);
  is.hear = (bytes) => bytes.forEach((byte) => machine.byteListeners[0](1, byte));
  // Steps down, and whether DIAG was high at any of them.
  is.down = (steps, gap = GAP) => {
    let high = false;
    for (let n = 0; n < steps; n++) {
      machine.cycle += gap;
      motors.stepListeners[0](0, -1, machine.cycle);
      high ||= is.diag;
    }
    return high;
  };
  is.rest = (cycles) => { machine.cycle += cycles; is.alarms.splice(0).forEach((end) => end()); };
  is.at = () => drivers.rotors[0];
  return is;
}

// GCONF by register, CHOPCONF of 8 microsteps, TCOOLTHRS of 60 cycles, SGTHRS of 50; checksums by the data sheet's algorithm.
const GCONF = [0x05, 0x00, 0x80, 0x00, 0x00, 0x01, 0xc0];
const CHOPCONF = [0x05, 0x00, 0xec, 0x15, 0x03, 0x00, 0x53];
const TCOOLTHRS = [0x05, 0x00, 0x94, 0x00, 0x00, 0x00, 60];
const SGTHRS = [0x05, 0x00, 0xc0, 0x00, 0x00, 0x00, 50];

function signed(bytes) {
  let crc = 0;
  for (let byte of bytes) {
    for (let bit = 0; bit < 8; bit++, byte >>= 1) crc = (crc & 0x80 ? 1 : 0) ^ (byte & 1) ? (crc << 1 ^ 7) & 0xff : crc << 1 & 0xff;
  }
  return [...bytes, crc];
}

function told(...registers) {
  const is = driver();
  registers.forEach((bytes) => is.hear(signed(bytes)));
  return is;
}

test('a stall is told at the stop alone, and ends at standstill', () => {
  const is = told(GCONF, CHOPCONF, TCOOLTHRS, SGTHRS);
  assert.equal(is.down(10 * FULL_STEP), false);
  assert.equal(is.at(), -10);
  assert.equal(is.down(2 * FULL_STEP), true);
  assert.equal(is.at(), -10);
  is.rest(CLOCK_HZ);
  assert.equal(is.diag, false);
});

test('a motor slips by four full steps at the stop', () => {
  const is = told(GCONF, CHOPCONF, TCOOLTHRS, SGTHRS);
  is.down(12 * FULL_STEP + 1);
  assert.equal(is.at(), -12 - 1 / FULL_STEP + 4);
});

test('no stall is told below the speed, without a threshold, with spreadCycle, or with a wrong checksum', () => {
  assert.equal(told(GCONF, CHOPCONF, TCOOLTHRS, SGTHRS).down(20 * FULL_STEP, 2 * GAP), false);
  assert.equal(told(GCONF, CHOPCONF, TCOOLTHRS).down(20 * FULL_STEP), false);
  assert.equal(told([...GCONF.slice(0, 6), 0xc4], CHOPCONF, TCOOLTHRS, SGTHRS).down(20 * FULL_STEP), false);
  const is = told(GCONF, CHOPCONF, TCOOLTHRS);
  is.hear([...SGTHRS, 0]);
  assert.equal(is.down(20 * FULL_STEP), false);
});

test('a slow motor looks like a stall', () => {
  const slow = [...TCOOLTHRS.slice(0, 5), 0x10, 0];
  assert.equal(told(GCONF, CHOPCONF, slow, SGTHRS).down(4 * FULL_STEP, 20 * GAP), true);
});

test('a driver counts what it has taken, and answers what it is asked, on the one wire', () => {
  const heard = [];
  const alarms = [];
  const machine = {
    cycle: 0,
    byteListeners: [],
    drive: () => {},
    uarts: [undefined, { bit: 1e9 / 115200, feed: (byte) => heard.push(byte) }],
    send: (port, bytes) => heard.push(...bytes),
    mcu: { clock: { createAlarm: (end) => ({ schedule: (nanos) => alarms.push([nanos, end]) }) } },
  };
  const drivers = new Drivers(machine, { stepListeners: [] }, [0, 2, 1, 3]);
  const say = (bytes) => {
    heard.length = 0;
    bytes.forEach((byte) => machine.byteListeners[0](1, byte));
    const [due] = alarms.splice(0);
    due?.[1]();
    return { echo: heard.slice(0, bytes.length), answer: heard.slice(bytes.length), pause: due?.[0] };
  };
  const withSum = (bytes) => [...bytes, checksum(bytes)];
  // By the data sheet's algorithm.
  assert.equal(checksum([5, 0, 0]), 0x48);
  const count = withSum([5, 2, 2]);
  assert.deepEqual(say(count).echo, count);
  assert.deepEqual(say(count).answer, withSum([5, 0xff, 2, 0, 0, 0, 0]));
  assert.equal(Math.round(say(count).pause), Math.round(8e9 / 115200));
  assert.deepEqual(say(withSum([5, 2, 0x83, 0, 0, 2, 0])).answer, []);
  assert.deepEqual(say(count).answer, withSum([5, 0xff, 2, 0, 0, 0, 1]));
  assert.equal(Math.round(say(count).pause), Math.round(24e9 / 115200));
  // It was reset, until that is cleared.
  assert.equal(say(withSum([5, 2, 1])).answer[6], 1);
  say(withSum([5, 2, 0x81, 0, 0, 0, 7]));
  assert.equal(say(withSum([5, 2, 1])).answer[6], 0);
  drivers.ail([{ address: 2, deaf: true }]);
  assert.deepEqual(say(count).answer, []);
  drivers.ail([{ deaf: false, reset: true, status: 3 }]);
  assert.equal(say(withSum([5, 2, 1])).answer[6], 1);
  assert.equal(say(withSum([5, 2, 0x6f])).answer[6], 3);
  // A damaged request is none.
  assert.deepEqual(say([5, 2, 2, 0]).answer, []);
});
