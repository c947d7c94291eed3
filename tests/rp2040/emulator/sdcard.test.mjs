import assert from 'node:assert/strict';
import test from 'node:test';
import { SdCard } from './sdcard.mjs';

// A machine of which a card needs no more than this.
function slot(access) {
  const spi = { clockFrequency: 8e6, completeTransmit() {} };
  const machine = { levels: [1], cycle: 0, mcu: { spi: [spi, spi], clock: { createAlarm: () => ({ schedule() {} }) } } };
  const card = new SdCard(machine, { image: Buffer.alloc(4096), select: 0, clock: 2, access });
  const say = (...bytes) => bytes.map((byte) => card.exchange(byte));
  const command = (number, argument, sum = 1) => {
    machine.levels[0] = 0;
    say(0x40 | number, 0, 0, argument >> 8, argument & 0xff, sum);
    return say(0xff, 0xff)[1];
  };
  return { machine, card, say, command };
}

function ready(access) {
  const its = slot(access);
  assert.equal(its.command(0, 0, 0x95), 1);
  for (let tries = 1; tries <= 5; tries++) {
    its.command(55, 0);
    assert.equal(its.command(41, 0), tries < 5 ? 1 : 0);
  }
  return its;
}

test('a card that is not initialized reads nothing', () => {
  const { command } = slot(300);
  assert.equal(command(17, 0), 5);
});

test('a block is written, the card is busy, and the block is read', () => {
  const { machine, card, say, command } = ready(100);
  assert.equal(command(24, 3), 0);
  const block = Array.from({ length: 512 }, (_, n) => n & 0xff);
  say(0xff, 0xfe, ...block, 0, 0);
  assert.deepEqual(say(0xff, 0xff), [0xe5, 0]);
  assert.equal(command(17, 3), 4);
  machine.cycle += 100 * 128;
  assert.equal(command(17, 3), 0);
  assert.deepEqual(say(0xff), [0xff]);
  machine.cycle += 100 * 128;
  assert.deepEqual(say(...Array(513).fill(0xff)), [0xfe, ...block]);
  assert.equal(card.image[3 * 512 + 5], 5);
});

test('a card that is not selected, or not there, is silent', () => {
  const { machine, card, say } = ready(100);
  machine.levels[0] = 1;
  assert.deepEqual(say(0x40, 0, 0, 0, 0, 0x95, 0xff, 0xff), Array(8).fill(0xff));
  machine.levels[0] = 0;
  card.isThere = false;
  assert.deepEqual(say(0x40, 0, 0, 0, 0, 0x95, 0xff, 0xff), Array(8).fill(0xff));
});
