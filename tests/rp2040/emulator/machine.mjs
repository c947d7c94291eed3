// An RP2040 of rp2040js with what tests of an image need: an ELF, one clock for CPU and PIO, time of interrupts, pins, two serial lines, USB.
//
// What rp2040js lacks is put right here and in the files beside; `cures.test.mjs` has a test for each.
import { readFileSync } from 'node:fs';
import { BasePeripheral, ConsoleLogger, LogLevel, RP2040 } from 'rp2040js';
import { quicken } from './core.mjs';
import { Pio } from './pio.mjs';
import { BOOT_LOADER, bootRom } from './rom.mjs';
import { Uart } from './uart.mjs';
import { Computer, Usb } from './usb.mjs';
import { Cache } from './xip.mjs';

// The system clock of Kerf's image.
export const CLOCK_HZ = 128e6;
const NANOS = 1e9 / CLOCK_HZ;
const FLASH = 0x10000000;
// Behind the second stage of the boot loader, which is as good as run.
const VECTORS = FLASH + 0x100;
// A Cortex-M0+ takes 15 cycles and more to enter an interrupt, and 11 to leave it; rp2040js none.
const ENTRY = 15;
const EXIT = 11;
// The CPU runs for so many cycles at most before others are looked at.
const SPRINT = 10_000;
const WATCHDOG = 0x40058;
// The watchdog's reason: software has asked for it.
const FORCED = 2;
const TIMER = 0x40054;
const ALARM0 = 0x10;
// Ends whose rates differ by more do not understand each other.
const GARBLES = 0.045;
// Bits of a frame: start, eight, stop.
const FRAME = 10;
const CHAN_ABORT = 0x444;
const USB = 0x50110;
const RESETS = 0x4000c;
const RESET_USB = 1 << 24;
// The port of USB, behind those of the UARTs.
export const USB_PORT = 2;
const UARTS = [[0x40034, 'UART0', 20], [0x40038, 'UART1', 21]];

const RAM = 0x20000000;
// What the stack has in it where it has not been used.
const PAINT = 0xa5;
const HARD_FAULT = 3;
const XIP_FLUSH = 4;
// A pad after a reset: input, pulled down, 4 mA (RP2040 data sheet, 2.19.6.3); that of rp2040js drives 12.
const PAD = 0x56;
// The state of a pin that nobody drives or pulls.
const FLOATS = 2;

// XIP_CTRL, which rp2040js lacks: never streaming. What is written to one register empties the cache.
class XipControl extends BasePeripheral {
  constructor(mcu, name, cache) {
    super(mcu, name);
    this.cache = cache;
  }
  readUint32() { return 0; }
  writeUint32(offset) { if (offset === XIP_FLUSH) this.cache.flush(); }
}

// Whether nothing is at an address: behind the boot ROM, below and behind RAM.
const isNowhere = (at) => (at >= 0x4000 && at < FLASH) || (at >= 0x19000000 && at < RAM) || (at >= RAM + 0x42000 && at < 0x40000000);

// Tells of each access where nothing is, which rp2040js lets pass. Its narrow accesses there are made of whole ones.
function watchAddresses(mcu, onFault) {
  for (const name of ['readUint32', 'writeUint32']) {
    const access = mcu[name].bind(mcu);
    mcu[name] = (at, value) => {
      if (isNowhere(at >>> 0)) onFault();
      return access(at, value);
    };
  }
}

// An alarm of the timer goes off when the count becomes its value; that of rp2040js up to a microsecond before, so that who looks at the count then sees
// that it is not due.
function goOffInTime({ clock, peripherals }) {
  const timer = peripherals[TIMER];
  const write = timer.writeUint32.bind(timer);
  timer.writeUint32 = (offset, value) => {
    if (offset < ALARM0 || offset >= ALARM0 + 4 * timer.alarms.length) return write(offset, value);
    const alarm = timer.alarms[(offset - ALARM0) / 4];
    const now = clock.nanos / 1000;
    const whole = Math.floor(now);
    const left = ((value - whole) >>> 0) || 2 ** 32;
    alarm.armed = true;
    alarm.targetMicros = value;
    alarm.clockAlarm.schedule((left - (now - whole)) * 1000);
  };
}

// A sender: bytes that are under way to a port, one behind the other.
class Sender {
  constructor() {
    this.bytes = [];
    this.head = 0;
    this.rate = 115200;
    // When the byte that is on the line is through.
    this.due = Infinity;
  }
  // Puts bytes on the line, or one ahead of those that wait.
  send(bytes, now) {
    for (const byte of bytes) this.bytes.push(byte);
    this.begin(now);
  }
  sendNow(byte, now) {
    const isBusy = this.due !== Infinity;
    this.bytes.splice(this.head + (isBusy ? 1 : 0), 0, byte);
    this.begin(now);
  }
  begin(now) {
    if (this.due === Infinity && this.head < this.bytes.length) this.due = now + FRAME * CLOCK_HZ / this.rate;
  }
  // The byte that is through; the next one begins.
  take() {
    const byte = this.bytes[this.head++];
    const now = this.due;
    this.due = Infinity;
    if (this.head > 4096) { this.bytes.splice(0, this.head); this.head = 0; }
    this.begin(now);
    return byte;
  }
}

// Puts what an ELF has for the flash there.
function loadElf(elf, flash) {
  const [count, size] = [elf.readUInt16LE(44), elf.readUInt16LE(42)];
  for (let i = 0, p = elf.readUInt32LE(28); i < count; i++, p += size) {
    const [type, offset, , physical, bytes] = [0, 4, 8, 12, 16].map((o) => elf.readUInt32LE(p + o));
    if (type !== 1 || !bytes || physical >>> 28 !== 1) continue;
    flash.set(elf.subarray(offset, offset + bytes), physical - FLASH);
  }
}

// The value of the symbol whose name has this in it.
function symbol(elf, part) {
  const [table, size, count] = [elf.readUInt32LE(32), elf.readUInt16LE(46), elf.readUInt16LE(48)];
  const section = (i) => [4, 16, 20, 24].map((o) => elf.readUInt32LE(table + i * size + o));
  for (let i = 0; i < count; i++) {
    const [type, offset, bytes, link] = section(i);
    if (type !== 2) continue;
    const [, names] = section(link);
    for (let at = offset; at < offset + bytes; at += 16) {
      const name = names + elf.readUInt32LE(at);
      if (elf.toString('latin1', name, elf.indexOf(0, name)).includes(part)) return elf.readUInt32LE(at + 4);
    }
  }
  throw new Error(`no ${part} in the image`);
}

export class Machine {
  // With an ELF in its flash, or what `load` puts there.
  constructor(elf, load = (flash) => loadElf(readFileSync(elf), flash), cache = new Cache()) {
    this.load = load;
    this.cache = cache;
    this.cycle = 0;
    this.edgeListeners = [];
    this.byteListeners = [];
    this.resetListeners = [];
    this.heard = [[], [], []];
    this.computer = new Computer((byte) => this.listen(USB_PORT, byte));
    this.senders = [new Sender(), new Sender()];
    // Whose sensors work pins; none by itself.
    this.spindle = { due: Infinity };
    this.noise = { due: Infinity };
    this.inputs = new Map();
    this.sensed = [0, 0, 0, 0, 0];
    this.levels = new Array(30).fill(0);
    this.resets = 0;
    // The boot loader has been started.
    this.loads = false;
    // Line ends that have been heard.
    this.lines = 0;
    // Bytes that have been heard.
    this.said = 0;
    this.asleep = 0;
    // For how many cycles interrupts were off at most.
    this.masked = 0;
    // Cycles of each exception's handler by itself, by its number; 0 is thread mode.
    this.spent = new Array(48).fill(0);
    // What had been spent when each exception's handler began its run, how many runs have ended, the longest, and which one has just ended.
    this.begun = new Array(48).fill(0);
    this.runs = new Array(48).fill(0);
    this.longest = new Array(48).fill(0);
    this.left = 0;
    this.boot();
  }

  // The supply fails, and is there again.
  cutPower() {
    this.boot({ flash: this.mcu.flash });
  }

  // The CPU sleeps from now on, and wakes for nobody, until a reset gives it another core.
  stick() {
    const { core } = this.mcu;
    core.checkForInterrupts = () => false;
    core.waiting = true;
  }

  // Faults of USB and its bus: [what, ...].
  trouble(faults) {
    const { usb } = this;
    const ms = (n) => n * 1e6;
    for (const [what, first, second] of faults) {
      switch (what) {
        case 'sleep': usb.sleep(ms(first)); break;
        case 'skip': usb.skip(ms(first)); break;
        case 'unplug': usb.unplug(ms(first)); break;
        case 'reset': usb.resetBus(); break;
        case 'abort': usb.abort(); break;
        case 'noise': usb.noise(first, second); break;
        default: usb.damage(what, first);
      }
    }
  }

  // A panic: a cell is borrowed twice, in a file of that name.
  panic(elf, file) {
    const { core, sram } = this.mcu;
    const [at, name] = [0x20030000, 0x20030100];
    Buffer.from(file).copy(sram, name - 0x20000000);
    [name, file.length, 7, 9].forEach((word, i) => this.mcu.writeUint32(at + 4 * i, word));
    core.registers[0] = at;
    core.PC = (symbol(readFileSync(elf), 'panic_already_borrowed') & ~1) >>> 0;
    core.waiting = false;
  }

  // The reset button.
  reset() { this.boot(this.mcu, this.mcu.sram); }

  // A new image has been loaded: the boot ROM starts it by the watchdog. Nobody has left a mark.
  startLoaded() {
    const watchdog = this.mcu.peripherals[WATCHDOG];
    watchdog.scratchData.fill(0);
    watchdog.reason = FORCED;
    this.boot(this.mcu);
  }

  // The next instruction is one that reads where nothing is; or the stack ends right below what is on it.
  crash(where) {
    const { core, sram } = this.mcu;
    core.waiting = false;
    if (where === 'stack') core.SPmain = RAM + 8;
    sram.set([0x03, 0x68], sram.length - 16); // LDR r3, [r0]
    core.registers[0] = 0x30000000;
    core.PC = RAM + sram.length - 16;
  }

  // What a channel of the converter reads, of 4095.
  sense(channel, value) { this.sensed[channel] = value; }

  // A chip as it is at power-up, or behind a reset, with the flash and perhaps RAM as it was.
  boot(before, sram) {
    const mcu = new RP2040();
    this.mcu = mcu;
    // The pins that were neither driven nor pulled since, as bits.
    this.floated = 0;
    mcu.logger = new ConsoleLogger(LogLevel.Error, true);
    this.cache.flush();
    mcu.peripherals[0x14000] = new XipControl(mcu, 'XIP_CTRL', this.cache);
    mcu.loadBootrom(bootRom());
    if (sram) mcu.sram.set(sram);
    if (before) mcu.flash.set(before.flash);
    else this.load(mcu.flash);
    this.uarts = UARTS.map(([at, name, irq], port) => {
      const uart = mcu.peripherals[at] = new Uart(mcu, name, irq);
      uart.onByte = (byte) => this.hear(port, byte, 1e9 / uart.bit);
      return uart;
    });
    this.usb = mcu.usbCtrl = mcu.peripherals[USB] = new Usb(mcu, this.computer);
    mcu.adc.channelValues = this.sensed;
    const watchdog = mcu.peripherals[WATCHDOG];
    if (before?.peripherals) {
      const old = before.peripherals[WATCHDOG];
      watchdog.scratchData.set(old.scratchData);
      watchdog.reason = old.reason;
    }
    // It bites once: that of rp2040js would go on at the same instant for ever.
    watchdog.onWatchdogTrigger = () => { watchdog.alarm.enable = false; this.isResetting = true; };
    const resets = mcu.peripherals[RESETS];
    const writeResets = resets.writeUint32.bind(resets);
    resets.writeUint32 = (offset, value) => {
      if (offset === 0 && value & ~resets.reset & RESET_USB) this.usb.resetUnit();
      writeResets(offset, value);
    };
    mcu.onBreak = (code) => {
      if (code !== BOOT_LOADER) throw new Error(`bkpt ${code} at ${mcu.core.PC.toString(16)}`);
      this.loads = true;
      this.stick();
    };
    this.pios = mcu.pio.map((pio) => new Pio(pio));
    for (const [gpio, pin] of mcu.gpio.entries()) {
      pin.padValue = PAD;
      pin.addListener((state) => this.changed(gpio, state));
      pin.setInputValue(this.inputs.get(gpio) ?? true);
    }
    // The stack is below its first place, which the first word of the image is, down to the lower end of RAM.
    this.stack = mcu.sram.subarray(0, mcu.readUint32(VECTORS) - RAM);
    if (!sram) this.stack.fill(PAINT);
    watchAddresses(mcu, () => { this.isFault = true; });
    goOffInTime(mcu);
    this.endAborts();
    this.timeInterrupts();
    this.sprint = quicken(mcu, this.cache);
    mcu.core.VTOR = VECTORS;
    mcu.core.reset();
    mcu.core.PC = (mcu.core.PC & ~1) >>> 0;
  }

  // The DMA says when it has aborted what it was told to, which is at once; rp2040js never says it.
  endAborts() {
    const { dma } = this.mcu;
    const read = dma.readUint32.bind(dma);
    dma.readUint32 = (offset) => (offset === CHAN_ABORT ? 0 : read(offset));
  }

  // What is said above; and a handler begins at an even address: rp2040js leaves the lowest bit of its vector in the program counter, where it puts
  // tables of jumps off by one.
  timeInterrupts() {
    const { core } = this.mcu;
    const [enter, leave] = [core.exceptionEntry.bind(core), core.exceptionReturn.bind(core)];
    this.extra = 0;
    core.exceptionEntry = (n) => { this.extra += ENTRY; this.begun[n] = this.spent[n]; enter(n); core.PC = (core.PC & ~1) >>> 0; };
    core.exceptionReturn = (n) => { this.extra += EXIT; this.left = core.IPSR; leave(n); };
  }

  // An output has changed.
  changed(gpio, state) {
    if (state === FLOATS) this.floated |= 1 << gpio;
    if (state > 1 || this.levels[gpio] === state) return;
    this.output(gpio, state, this.pios[0].now ?? this.pios[1].now ?? this.cycle);
  }

  // A pin of the chip, or what is behind it, has changed.
  output(gpio, level, cycle) {
    this.levels[gpio] = level;
    for (const listener of this.edgeListeners) listener(gpio, level, cycle);
  }

  // Drives an input.
  drive(gpio, high) {
    if ((this.inputs.get(gpio) ?? true) === high) return;
    this.inputs.set(gpio, high);
    this.mcu.gpio[gpio].setInputValue(high);
  }

  send(port, bytes) {
    if (port !== USB_PORT) return this.senders[port].send(bytes, this.cycle);
    for (const byte of bytes) this.computer.bytes.push(byte);
    this.usb.wake();
  }
  // Sends a byte ahead of those that wait.
  sendNow(port, byte) {
    if (port !== USB_PORT) return this.senders[port].sendNow(byte, this.cycle);
    this.computer.bytes.unshift(byte);
    this.usb.wake();
  }
  // What the program at the other end of USB does: whether it has the port open, and reads.
  talk({ open, reads }) {
    this.computer.open = open ?? this.computer.open;
    this.computer.reads = reads ?? this.computer.reads;
    this.usb.wake();
  }

  // Has the computer make a request.
  ask(packet) {
    this.computer.ask(packet);
    this.usb.wake();
  }

  // A byte has left. One at another speed is not understood.
  hear(port, byte, rate) {
    const wanted = this.senders[port].rate;
    const garbled = Math.abs(wanted - rate) > GARBLES * wanted;
    this.listen(port, garbled ? byte ^ 0xff : byte);
  }

  listen(port, byte) {
    this.heard[port].push(byte);
    this.said++;
    for (const listener of this.byteListeners) listener(port, byte);
    if (byte === 10) this.lines++;
  }

  receive() {
    for (const [port, sender] of this.senders.entries()) {
      while (sender.due <= this.cycle) this.arrive(port, sender.take(), sender.rate);
    }
  }

  // A byte is through.
  arrive(port, byte, rate) {
    const uart = this.uarts[port];
    const own = 1e9 / uart.bit;
    const garbled = Math.abs(own - rate) > GARBLES * rate;
    uart.feed(byte, !garbled);
  }

  // Runs for so many cycles.
  run(cycles) { this.runUntil(this.cycle + cycles, () => false); }

  // Runs to a cycle, or until something is so; that is looked at after each byte that it says.
  runUntil(end, isDone) {
    let said = -1;
    while (this.cycle < end) {
      if (said !== this.said) {
        said = this.said;
        if (isDone()) return;
      }
      this.step(end);
    }
  }

  // Cycles until something happens that the CPU does not do itself, or `end`.
  untilDue(end) {
    const { clock } = this.mcu;
    const { cycle, noise, pios: [first, second], senders, spindle } = this;
    // What a state machine does at a cycle is done behind it.
    const due = Math.min(end, senders[0].due, senders[1].due, spindle.due, noise.due, first.due() + 1, second.due() + 1);
    const alarm = clock.nextAlarm ? clock.nanosToNextAlarm / NANOS : Infinity;
    return Math.ceil(Math.min(due - cycle, alarm));
  }

  // Bytes of the stack that have been used since power-up.
  deepest() { return this.stack.length - this.stack.findIndex((byte) => byte !== PAINT); }

  // The instruction at an address has faulted, with the stack as it was before. Behind a fault in a fault, and where there is no stack, the CPU stands
  // still.
  fault(pc, sp) {
    const { core } = this.mcu;
    const isSecond = core.IPSR === HARD_FAULT;
    [core.PC, core.SPmain, this.isFault] = [pc, sp, false];
    if (!isSecond) core.exceptionEntry(HARD_FAULT);
    core.PC = (core.PC & ~1) >>> 0;
    if (isSecond || this.isFault) this.stick();
    this.isFault = false;
  }

  // One instruction by the core of rp2040js: all that mask interrupts are among those.
  single() {
    const { core } = this.mcu;
    const waits = core.PC >>> 24 === FLASH >>> 24 ? this.cache.touch(core.PC) : 0;
    const wasMasked = core.PM;
    const [pc, sp] = [core.PC, core.SPmain];
    const spent = waits + core.executeInstruction();
    if (this.isFault) this.fault(pc, sp);
    if (core.PM && !wasMasked) this.maskedAt = this.cycle;
    if (!core.PM && wasMasked) this.masked = Math.max(this.masked, this.cycle + spent - this.maskedAt);
    return spent;
  }

  // A handler has ended its run.
  ended() {
    const n = this.left;
    this.left = 0;
    this.runs[n]++;
    this.longest[n] = Math.max(this.longest[n], this.spent[n] - this.begun[n]);
  }

  // Sleeps until something is due, or runs up to there.
  step(end) {
    const { mcu } = this;
    const { clock, core } = mcu;
    if (this.cycle >= this.senders[0].due || this.cycle >= this.senders[1].due) this.receive();
    while (this.cycle >= this.spindle.due) this.spindle.pass();
    while (this.cycle >= this.noise.due) this.noise.pass();
    let spent;
    if (core.waiting) {
      spent = Math.max(1, this.untilDue(end));
      this.asleep += spent;
      clock.tick(spent * NANOS);
      // A pending SysTick does not wake the core of rp2040js.
      if (core.interruptsUpdated && core.checkForInterrupts()) core.waiting = false;
    } else {
      if (core.interruptsUpdated) core.checkForInterrupts();
      const level = core.IPSR;
      spent = this.sprint(Math.min(this.untilDue(end), SPRINT)) || this.single();
      spent += this.extra;
      this.extra = 0;
      this.spent[level] += spent;
      if (this.left) this.ended();
      clock.tick(spent * NANOS);
    }
    this.cycle += spent;
    this.pios[0].run(this.cycle);
    this.pios[1].run(this.cycle);
    if (this.isResetting) {
      this.isResetting = false;
      this.resets++;
      for (const listener of this.resetListeners) listener();
      this.boot(mcu, mcu.sram);
    }
  }
}
