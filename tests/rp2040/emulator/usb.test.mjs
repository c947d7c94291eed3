// USB and its faults: a small device that answers as firmware does, and what it sees of the bus. `node --test .` where the emulator is installed.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { CLOCK_HZ, Machine } from './machine.mjs';
import { Cache } from './xip.mjs';

const USB = 0x50110000;
const MEMORY = 0x50100000;
const [SIE_CTRL, SIE_STATUS, SOF_RD, BUFF_STATUS, INTR] = [0x4c, 0x50, 0x48, 0x58, 0x8c];
const [BUS_RESET, SETUP, SUSPENDED, RESUME] = [1 << 19, 1 << 17, 1 << 4, 1 << 11];
const [CRC, STUFFING, TIMEOUT, SEQUENCE] = [1 << 24, 1 << 25, 1 << 27, 2 ** 31];
const [FULL, DATA1, AVAILABLE] = [1 << 15, 1 << 13, 1 << 10];
const CONFIGURATION = [9, 2, 32, 0, 1, 1, 0, 0x80, 50, 9, 4, 0, 0, 2, 10, 0, 0, 0, 7, 5, 0x81, 2, 64, 0, 0, 7, 5, 0x01, 2, 64, 0, 0];

// A machine whose CPU sleeps, and in its place a device with one endpoint each way.
class Device {
  constructor() {
    this.m = new Machine(undefined, (flash) => {
      const words = new DataView(flash.buffer, flash.byteOffset);
      words.setUint32(0x100, 0x20042000, true);
      words.setUint32(0x104, 0x10000201, true);
      [0xbf30, 0xe7fd].forEach((op, i) => words.setUint16(0x200 + 2 * i, op, true));
    }, new Cache(0));
    this.heard = [];
    this.errors = 0;
    this.begin();
  }
  get usb() { return this.m.usb; }
  read(offset) { return this.m.mcu.readUint32(USB + offset); }
  write(offset, value) { this.m.mcu.writeUint32(USB + offset, value); }
  memory(offset, value) { this.m.mcu.writeUint32(MEMORY + offset, value); }
  word(offset) { return this.m.mcu.readUint32(MEMORY + offset); }
  begin() { this.write(SIE_CTRL, 1 << 16); }
  // As firmware does, each 20 us.
  run(ms) {
    for (let n = 0; n < 50 * ms; n++) {
      this.m.run(CLOCK_HZ / 50_000);
      this.serve();
    }
  }
  serve() {
    const status = this.read(SIE_STATUS);
    this.errors = (this.errors | status & (CRC | STUFFING | TIMEOUT | SEQUENCE)) >>> 0;
    if (status & BUS_RESET) { this.write(SIE_STATUS, BUS_RESET); this.isReady = false; this.memory(8, 0); this.memory(0xc, 0); }
    if (status & SETUP) { this.write(SIE_STATUS, SETUP); this.answer(); }
    const done = this.read(BUFF_STATUS);
    this.write(BUFF_STATUS, done);
    if (done & 8) this.take();
  }
  // Answers a request: a descriptor, or nothing.
  answer() {
    const [first, second] = [this.word(0), this.word(4)];
    const [type, request, kind, length] = [first & 0xff, first >> 8 & 0xff, first >>> 24, second >>> 16];
    const bytes = type !== 0x80 ? [] : (kind === 1 ? new Array(18).fill(0) : CONFIGURATION).slice(0, length);
    bytes.forEach((byte, i) => this.m.mcu.usbDPRAMView.setUint8(0x100 + i, byte));
    this.memory(0x80, FULL | DATA1 | AVAILABLE | bytes.length);
    this.memory(0x84, DATA1 | AVAILABLE | (request === 0x20 ? 64 : 0));
    if (request === 9) this.configure();
  }
  configure() {
    this.memory(8, 2 ** 31 + 0x180);
    this.memory(0xc, 2 ** 31 + 0x1c0);
    [this.in, this.isReady] = [DATA1, true];
    this.out = 0;
    this.memory(0x88, 0);
    this.memory(0x8c, AVAILABLE | 64);
  }
  // Takes a packet, and has room for the next one.
  take() {
    const length = this.word(0x8c) & 0x3ff;
    for (let i = 0; i < length; i++) this.heard.push(this.m.mcu.usbDPRAM[0x1c0 + i]);
    this.out ^= DATA1;
    this.memory(0x8c, this.out | AVAILABLE | 64);
  }
  say(text) {
    [...text].forEach((letter, i) => { this.m.mcu.usbDPRAM[0x180 + i] = letter.charCodeAt(0); });
    this.in ^= DATA1;
    this.memory(0x88, this.in | FULL | AVAILABLE | text.length);
  }
  said() { const bytes = this.m.heard[2]; this.m.heard[2] = []; return Buffer.from(bytes).toString(); }
  text() { const { heard } = this; this.heard = []; return Buffer.from(heard).toString(); }
}

// A device that the computer talks to.
function ready() {
  const device = new Device();
  device.run(20);
  assert.ok(device.m.computer.ready && device.isReady);
  return device;
}

test('frames are counted while the bus is awake', () => {
  const device = new Device();
  assert.equal(device.read(SOF_RD), 0);
  device.run(20);
  const from = device.read(SOF_RD);
  device.run(10);
  assert.equal(device.read(SOF_RD), from + 10);
  device.m.trouble([['skip', 2]]);
  device.run(2);
  assert.equal(device.read(SOF_RD), from + 10);
  assert.equal(device.read(SIE_STATUS) & SUSPENDED, 0);
  device.run(5);
  assert.ok(device.read(SOF_RD) > from + 13);
});

test('damaged packets come again, once each', () => {
  const bits = { token: 0, crc: CRC, stuffing: STUFFING, answer: SEQUENCE, ack: TIMEOUT, data: TIMEOUT };
  for (const [kind, bit] of Object.entries(bits)) {
    const device = ready();
    device.m.trouble([[kind, 2]]);
    device.m.send(2, Buffer.from('to the device'));
    device.say('to the computer');
    device.run(2);
    assert.deepEqual([device.text(), device.said(), device.errors], ['to the device', 'to the computer', bit], kind);
    device.m.send(2, Buffer.from('more'));
    device.say('most');
    device.run(2);
    assert.deepEqual([device.text(), device.said()], ['more', 'most'], kind);
  }
});

test('noise comes by a seed, and spoils nothing', () => {
  const run = (seed) => {
    const device = ready();
    device.m.trouble([['noise', seed, 4]]);
    let said = '';
    for (let n = 0; n < 50; n++) {
      device.m.send(2, Buffer.from(`${n},`));
      device.say(`${n};`);
      device.run(1);
      said += device.said();
    }
    device.run(3);
    const numbers = [...Array(50).keys()];
    assert.deepEqual([device.text(), said + device.said()], [numbers.map((n) => `${n},`).join(''), numbers.map((n) => `${n};`).join('')]);
    assert.ok(device.errors);
    return device.usb.random;
  };
  assert.equal(run(1), run(1));
  assert.notEqual(run(1), run(2));
});

test('a bus that sleeps says so, and when it wakes', () => {
  const device = ready();
  device.m.trouble([['sleep', 10]]);
  device.run(2);
  assert.equal(device.read(SIE_STATUS) & SUSPENDED, 0);
  device.run(2);
  assert.ok(device.read(SIE_STATUS) & SUSPENDED && device.read(INTR) & 1 << 14);
  device.write(SIE_STATUS, SUSPENDED);
  device.run(10);
  assert.ok(device.read(SIE_STATUS) & RESUME && device.read(INTR) & 1 << 15);
  assert.equal(device.read(SIE_STATUS) >> 2 & 3, 2, 'K');
  device.write(SIE_STATUS, RESUME);
  device.run(20);
  device.say('awake');
  device.run(2);
  assert.equal(device.said(), 'awake');
});

test('a device that hangs does nothing until its unit is reset', () => {
  const device = ready();
  device.m.trouble([['hang', 1]]);
  device.m.send(2, Buffer.from('first'));
  device.say('lost');
  device.run(2);
  assert.deepEqual([device.said(), device.usb.hangs], ['', 1]);
  const frame = device.read(SOF_RD);
  device.text();
  device.m.send(2, Buffer.from('more'));
  device.m.trouble([['reset']]);
  device.run(70);
  assert.deepEqual([device.read(SOF_RD), device.read(SIE_STATUS) & BUS_RESET, device.text()], [frame, 0, '']);
  const resets = 0x4000c000;
  device.m.mcu.writeUint32(resets, 1 << 24);
  device.m.mcu.writeUint32(resets, 0);
  assert.deepEqual([device.read(SIE_CTRL), device.read(SOF_RD), device.m.computer.ready], [0, 0, false]);
  device.begin();
  device.run(170);
  assert.ok(device.m.computer.ready);
  device.say('again');
  device.run(2);
  assert.equal(device.said(), 'again');
});

test('without its cable a device sleeps, and is found again', () => {
  const device = ready();
  device.m.send(2, Buffer.from('x'.repeat(1000)));
  device.m.trouble([['unplug', 20]]);
  device.run(5);
  assert.ok(device.read(SIE_STATUS) & SUSPENDED);
  assert.deepEqual([device.m.computer.bytes.length, device.m.computer.lost], [0, 1000]);
  device.run(200);
  assert.deepEqual([device.m.computer.ready, device.m.computer.attached], [true, 2]);
});

test('a request that is given up is followed by a reset of the bus', () => {
  const device = ready();
  device.run(1);
  device.m.trouble([['abort']]);
  assert.ok(device.read(SIE_STATUS) & SETUP);
  device.run(1);
  assert.equal(device.read(SIE_STATUS) >> 2 & 3, 0, 'SE0');
  device.run(60);
  assert.deepEqual([device.m.computer.ready, device.m.computer.attached], [true, 2]);
});
