// An ATmega2560 of avr8js on a board: an image in its flash, two serial lines, motors, switches, the sensors of a spindle, EEPROM and watchdog.
//
// What avr8js gets wrong is put right here and in the files beside, each with what the data sheet of the ATmega2560 (2549) says; `cures.test.mjs` has a test for each.
import { readFileSync } from 'node:fs';
import avr8js from 'avr8js';
import { Core } from './core.mjs';
import { Motors, Pins } from './pins.mjs';
import { TIMERS, Timer } from './timer.mjs';
import { Uart } from './uart.mjs';

const { AVREEPROM, AVRWatchdog, EEPROMMemoryBackend, eepromConfig, watchdogConfig } = avr8js;

const CLOCK_HZ = 16e6;
const FLASH = 0x40000;
const CELLS = 4096;
// The first register and the first vector of each USART, and those that lead to lines.
const USARTS = [[0xc0, 25], [0xc8, 36], [0xd0, 51], [0x130, 54]];
const LINES = [0, 1];
// Bits of a frame: start, eight, stop.
const FRAME = 10;
const LINE_END = 10;
const FILL = 0xff;
const EE_READY = 30;
// Table 8-1: 3.4 ms for a byte erased and written, at 16 MHz 54,400 cycles. In avr8js 1.8 ms for each, also together. The 2 are those of the store.
const WRITE = 28_800;
const ERASE = 54_400 - WRITE + 2;
const [MCUSR, WDTCSR] = [0x54, 0x60];
const [PORF, WDRF, WDE] = [0x01, 0x08, 0x08];
const RAM = 0x200;

// What an ELF has for the flash.
export function flashOf(elf) {
  const flash = new Uint8Array(FLASH).fill(FILL);
  const [count, size] = [elf.readUInt16LE(44), elf.readUInt16LE(42)];
  for (let i = 0, p = elf.readUInt32LE(28); i < count; i++, p += size) {
    const [type, offset, , physical, bytes] = [0, 4, 8, 12, 16].map((o) => elf.readUInt32LE(p + o));
    if (type === 1 && physical + bytes <= FLASH) flash.set(elf.subarray(offset, offset + bytes), physical);
  }
  return new Uint16Array(flash.buffer);
}

// The cells, and the one that is being programmed.
class Cells extends EEPROMMemoryBackend {
  constructor(cpu, memory) {
    super(CELLS);
    this.cpu = cpu;
    this.memory.set(memory);
    this.under = undefined;
  }
  eraseMemory(address) {
    this.under = { address, before: this.memory[address], until: this.cpu.cycles + ERASE + WRITE };
    super.eraseMemory(address);
  }
  // What a failure of the supply leaves: a byte under way is the old one, or erased, or something between, or new, by `chance`, 0 to 3.
  left(chance) {
    const left = Uint8Array.from(this.memory);
    const { under } = this;
    if (under && this.cpu.cycles < under.until) {
      const { address, before } = under;
      left[address] = [before, FILL, before & left[address] ^ 0x55, left[address]][chance];
    }
    return left;
  }
}

// Data sheet, 12.5: WDE stays set while WDRF is, which is after a reset by the watchdog. In avr8js it does not, and is not on then.
class Watchdog extends AVRWatchdog {
  constructor(cpu) {
    super(cpu, { ...watchdogConfig, watchdogInterrupt: 2 * 12 }, { frequency: CLOCK_HZ });
    const write = cpu.writeHooks[WDTCSR];
    cpu.writeHooks[WDTCSR] = (value, old) => write(cpu.data[MCUSR] & WDRF ? value | WDE : value, old);
    if (cpu.data[MCUSR] & WDRF) this.begin();
  }
  begin() {
    this.cpu.data[WDTCSR] = WDE;
    this.enabledValue = true;
    this.resetWatchdog();
    this.scheduled = true;
    this.cpu.addClockEvent(this.checkWatchdog, this.watchdogTimeout - this.cpu.cycles);
  }
}

// The sender's end of a line.
class Line {
  constructor() { Object.assign(this, { bit: CLOCK_HZ / 115_200, bytes: [], head: 0, free: 0, heard: [] }); }
  attach(cpu, uart) {
    Object.assign(this, { cpu, uart });
    uart.sent = (byte) => { this.heard.push(byte); };
    this.pass = () => this.start();
    this.arm();
  }
  send(bytes) { for (const byte of bytes) this.bytes.push(byte); this.arm(); }
  sendNow(byte) { this.bytes.splice(this.head, 0, byte); this.arm(); }
  arm() {
    this.cpu.clearClockEvent(this.pass);
    this.due = Math.max(this.free, this.cpu.cycles);
    if (this.head < this.bytes.length) this.cpu.addClockEvent(this.pass, this.due - this.cpu.cycles);
  }
  start() {
    this.uart.start(this.bytes[this.head++], this.bit, this.due);
    this.free = this.due + Math.round(this.bit * FRAME);
    this.arm();
  }
}

export class Machine {
  // An image, and the step pin and the direction pin of each motor.
  constructor(flash, motors = []) {
    this.flash = flash;
    this.motors = new Motors(motors);
    this.lines = LINES.map(() => new Line());
    this.spindle = undefined;
    this.resets = 0;
    this.drives = new Map();
    this.start(0, PORF, new Uint8Array(RAM).fill(0), new Uint8Array(CELLS).fill(FILL));
  }

  // The chip in its state after a reset: RAM and EEPROM stay, and so does the world outside. avr8js keeps its registers and the state of most parts.
  start(cycles, cause, ram, cells) {
    const cpu = new Core(this.flash);
    cpu.cycles = cycles;
    cpu.data.set(ram.subarray(RAM), RAM);
    cpu.data[MCUSR] = cause;
    this.cpu = cpu;
    this.pins = new Pins(cpu);
    this.timers = TIMERS.map((config) => new Timer(cpu, config));
    this.uarts = USARTS.map((usart) => new Uart(cpu, usart));
    this.cells = new Cells(cpu, cells);
    new AVREEPROM(cpu, this.cells, { ...eepromConfig, eepromReadyInterrupt: 2 * EE_READY, eraseCycles: ERASE, writeCycles: WRITE });
    new Watchdog(cpu);
    cpu.reset = () => { this.bitten = true; };
    this.drives.forEach((high, pin) => this.pins.drive(pin, high));
    this.motors.attach(this.pins);
    this.lines.forEach((line, n) => line.attach(cpu, this.uarts[LINES[n]]));
    this.spindle?.attach(this.pins);
  }

  drive(pin, high) {
    this.drives.set(pin, high);
    this.pins.drive(pin, high);
  }

  fit(spindle) {
    this.spindle = spindle;
    spindle.attach(this.pins);
  }

  // Runs to a cycle, or, with `line`, until a whole line has come on the first line that was not taken.
  runUntil(cycle, line) {
    const { heard } = this.lines[0];
    let seen = 0;
    const isOver = () => {
      if (this.bitten) return true;
      if (!line) return false;
      while (seen < heard.length) if (heard[seen++] === LINE_END) return true;
      return false;
    };
    if (isOver()) return;
    do {
      this.cpu.runUntil(cycle, isOver);
    } while (this.bite());
  }

  // The watchdog has bitten.
  bite() {
    if (!this.bitten) return false;
    this.bitten = false;
    this.resets++;
    this.start(this.cpu.cycles, WDRF, this.cpu.data, this.cells.memory);
    return true;
  }
}

// The machine of an ELF file.
export const load = (file, motors) => new Machine(flashOf(readFileSync(file)), motors);
