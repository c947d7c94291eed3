// An SD card on an SPI of the chip. It answers CMD0, 8, 16, 17, 24, 41, 55 and 58 as the SD specification says (Physical Layer, simplified, chapter 7), in the
// order that the specification allows. A block comes `access` microseconds after it was requested; after a block was written the card is busy for the same time.
import { CLOCK_HZ } from './machine.mjs';

const BLOCK = 512;
const IDLE = 1;
const ILLEGAL = 4;
const START = 0xfe;
const TAKEN = 0xe5;
// How often CMD41 must be sent until the card is ready.
const TRIES = 5;
const BITS = 8;

export class SdCard {
  // `image` is a buffer with the card's contents, `select` the pin that selects the card, `clock` one that tells which SPI it is.
  constructor(machine, { image, select, clock, access = 300 }) {
    Object.assign(this, { machine, image, select, access });
    this.isThere = true;
    this.isIdle = true;
    this.isApplication = false;
    this.tries = 0;
    this.busyUntil = 0;
    this.release();
    const { mcu } = machine;
    const spi = mcu.spi[clock >> 3 & 1];
    let answer = 0xff;
    const through = mcu.clock.createAlarm(() => spi.completeTransmit(answer));
    spi.onTransmit = (byte) => {
      answer = this.exchange(byte);
      through.schedule(BITS * 1e9 / spi.clockFrequency);
    };
  }
  // Nobody selects the card: what was under way is forgotten.
  release() {
    this.command = [];
    this.out = [];
    this.coming = undefined;
    this.write = undefined;
  }
  exchange(byte) {
    if (this.machine.levels[this.select] !== 0) this.release();
    if (!this.isThere || this.machine.levels[this.select] !== 0) return 0xff;
    const { cycle } = this.machine;
    if (this.coming && this.coming.at <= cycle) {
      const from = this.coming.block * BLOCK;
      this.out.push(START, ...this.image.subarray(from, from + BLOCK), 0, 0);
      this.coming = undefined;
    }
    const reply = this.out.length ? this.out.shift() : cycle < this.busyUntil ? 0 : 0xff;
    this.take(byte, cycle);
    return reply;
  }
  take(byte, cycle) {
    if (this.write) {
      const { bytes, block } = this.write;
      if (!bytes.length && byte !== START) return;
      bytes.push(byte);
      if (bytes.length < 1 + BLOCK + 2) return;
      this.image.set(bytes.slice(1, 1 + BLOCK), block * BLOCK);
      this.write = undefined;
      this.out.push(TAKEN);
      this.busyUntil = cycle + this.access * CLOCK_HZ / 1e6;
      return;
    }
    if (!this.command.length && (byte & 0xc0) !== 0x40) return;
    this.command.push(byte);
    if (this.command.length < 6) return;
    const [first, ...rest] = this.command;
    this.command = [];
    const argument = rest.slice(0, 4).reduce((value, part) => value * 256 + part, 0);
    this.out.push(0xff, ...this.answer(first & 0x3f, argument, rest[4], cycle));
  }
  answer(number, argument, sum, cycle) {
    const application = this.isApplication;
    this.isApplication = number === 55;
    const fits = (argument + 1) * BLOCK <= this.image.length;
    const ready = !this.isIdle && cycle >= this.busyUntil;
    const idle = this.isIdle ? IDLE : 0;
    if (number === 0 && sum === 0x95) {
      this.isIdle = true;
      this.tries = 0;
      return [IDLE];
    }
    if (number === 8 && sum === 0x87) return [idle, 0, 0, argument >> 8 & 0xff, argument & 0xff];
    if (number === 55) return [idle];
    if (number === 41 && application) {
      this.tries += 1;
      if (this.tries >= TRIES) this.isIdle = false;
      return [this.isIdle ? IDLE : 0];
    }
    if (number === 58) return [idle, 0xc0, 0xff, 0x80, 0];
    if (number === 16 && ready && argument === BLOCK) return [0];
    if (number === 17 && ready && fits) {
      this.coming = { block: argument, at: cycle + this.access * CLOCK_HZ / 1e6 };
      return [0];
    }
    if (number === 24 && ready && fits) {
      this.write = { block: argument, bytes: [] };
      return [0];
    }
    return [ILLEGAL | idle];
  }
}
