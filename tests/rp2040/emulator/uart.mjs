// A UART of the RP2040 (PL011). That of rp2040js takes no time, keeps no levels of its FIFOs, and its transmit interrupt never goes away.
import { BasePeripheral } from 'rp2040js';

const RX = 1 << 4;
const TX = 1 << 5;
const RX_TIMEOUT = 1 << 6;
const OVERRUN = 1 << 10;

// Levels at which FIFOs interrupt, by the code in UARTIFLS.
const LEVELS = [4, 8, 16, 24, 28];
// Bits of a frame: start, eight, stop.
const FRAME = 10;
// Bits without a byte after which those that wait are told.
const TIMEOUT = 32;

export class Uart extends BasePeripheral {
  constructor(mcu, name, irq) {
    super(mcu, name);
    this.irq = irq;
    this.onByte = () => {};
    this.registers = { 0x24: 0, 0x28: 0, 0x2c: 0, 0x30: 0x300, 0x34: 0x12, 0x38: 0, 0x48: 0 };
    this.raw = 0;
    this.tx = [];
    this.rx = [];
    this.overrun = false;
    this.leaving = undefined;
    this.txAlarm = mcu.clock.createAlarm(() => this.left());
    this.timeout = mcu.clock.createAlarm(() => this.set(RX_TIMEOUT));
  }

  get depth() { return this.registers[0x2c] & 0x10 ? 32 : 1; }
  // A bit, ns.
  get bit() { return (this.registers[0x24] + this.registers[0x28] / 64) * 16e9 / this.rp2040.clkPeri; }
  get txLevel() { return this.depth === 1 ? 0 : LEVELS[this.registers[0x34] & 7]; }
  get rxLevel() { return this.depth === 1 ? 1 : LEVELS[this.registers[0x34] >> 3 & 7]; }

  set(bits) { this.raw |= bits; this.update(); }
  clear(bits) { this.raw &= ~bits; this.update(); }
  update() { this.rp2040.setInterrupt(this.irq, !!(this.raw & this.registers[0x38])); }

  // The byte on the line is through.
  left() {
    this.onByte(this.leaving);
    this.leaving = undefined;
    this.send();
  }

  // The next byte goes on the line, if that is free.
  send() {
    if (this.leaving !== undefined || !this.tx.length) return;
    const before = this.tx.length;
    this.leaving = this.tx.shift();
    if (before > this.txLevel && this.tx.length <= this.txLevel) this.set(TX);
    this.txAlarm.schedule(FRAME * this.bit);
  }

  // A byte has come, whole or not.
  feed(byte, whole = true) {
    if (this.rx.length >= this.depth) {
      this.overrun = true;
      this.set(OVERRUN);
      return;
    }
    this.rx.push(whole ? byte : byte | 1 << 8);
    if (this.rx.length >= this.rxLevel) this.set(RX);
    if (this.depth > 1) this.timeout.schedule(TIMEOUT * this.bit);
  }

  readUint32(offset) {
    switch (offset) {
      case 0x00: {
        const byte = (this.rx.shift() ?? 0) | (this.overrun ? 1 << 11 : 0);
        this.overrun = false;
        if (this.rx.length < this.rxLevel) this.raw &= ~RX;
        if (!this.rx.length) { this.raw &= ~RX_TIMEOUT; this.timeout.cancel(); }
        this.update();
        return byte;
      }
      case 0x04: return 0;
      case 0x18: {
        const { tx, rx, depth, leaving } = this;
        return (!tx.length && 1 << 7) | (rx.length >= depth && 1 << 6) | (tx.length >= depth && 1 << 5)
          | (!rx.length && 1 << 4) | ((tx.length || leaving !== undefined) && 1 << 3);
      }
      case 0x3c: return this.raw;
      case 0x40: return this.raw & this.registers[0x38];
    }
    return this.registers[offset] ?? super.readUint32(offset);
  }

  writeUint32(offset, value) {
    if (offset === 0x00) {
      if (this.tx.length < this.depth) this.tx.push(value & 0xff);
      if (this.tx.length > this.txLevel) this.clear(TX);
      this.send();
    } else if (offset === 0x44) {
      this.clear(this.rawWriteValue);
    } else if (offset in this.registers) {
      this.registers[offset] = value;
      this.update();
    } else {
      super.writeUint32(offset, value);
    }
  }
}
