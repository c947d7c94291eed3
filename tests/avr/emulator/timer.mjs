// The timers of avr8js, put right, and faster: avr8js counts every clock of a timer as an event.
import avr8js from 'avr8js';

const { AVRTimer, timer0Config, timer1Config, timer2Config } = avr8js;

const [TOV, OCFA, OCFB, OCFC] = [1, 2, 4, 8];
const FLAGS = { TOV, OCFA, OCFB, OCFC, TOIE: TOV, OCIEA: OCFA, OCIEB: OCFB, OCIEC: OCFC };
const NO_PINS = { compPortA: 0, compPortB: 0, compPortC: 0, externalClockPort: 0 };
// The ways of counting in which a timer goes up and down, as avr8js numbers them.
const UP_AND_DOWN = [1, 4];

// A timer of 16 bits: its first register, TIFR, TIMSK and the vector of its input capture; compare A, B, C and overflow follow (data sheet, 14 and 33).
const wide = (base, TIFR, TIMSK, vector) => ({
  ...timer1Config, ...FLAGS, ...NO_PINS, TIFR, TIMSK,
  TCCRA: base, TCCRB: base + 1, TCCRC: base + 2, TCNT: base + 4, ICR: base + 6, OCRA: base + 8, OCRB: base + 10, OCRC: base + 12,
  captureInterrupt: 2 * vector, compAInterrupt: 2 * (vector + 1), compBInterrupt: 2 * (vector + 2), compCInterrupt: 2 * (vector + 3), ovfInterrupt: 2 * (vector + 4),
});
const narrow = (config, vector) => ({ ...config, ...NO_PINS, compAInterrupt: 2 * vector, compBInterrupt: 2 * (vector + 1), ovfInterrupt: 2 * (vector + 2) });

export const TIMERS = [
  narrow(timer0Config, 21), wide(0x80, 0x36, 0x6f, 16), narrow(timer2Config, 13), wide(0x90, 0x38, 0x71, 31), wide(0xa0, 0x39, 0x72, 41), wide(0x120, 0x3a, 0x73, 46),
];

// What AVRTimer sees of the CPU: its next event comes where a flag is due, and not with the next clock.
class View {
  constructor(cpu) {
    Object.assign(this, { cpu, data: cpu.data, readHooks: cpu.readHooks, writeHooks: cpu.writeHooks, gpioByPort: cpu.gpioByPort, timer: undefined });
  }
  get cycles() { return this.cpu.cycles; }
  addClockEvent(callback, cycles) { if (cycles === 0) this.cpu.addClockEvent(callback, 0); else this.timer.plan(); }
  clearClockEvent(callback) { return this.cpu.clearClockEvent(callback); }
  updateClockEvent(callback, cycles) { return this.cpu.updateClockEvent(callback, cycles); }
  setInterruptFlag(interrupt) { this.cpu.setInterruptFlag(interrupt); }
  updateInterruptEnable(interrupt, value) { this.cpu.updateInterruptEnable(interrupt, value); }
  clearInterruptByFlag(interrupt, value) { this.cpu.clearInterruptByFlag(interrupt, value); }
}

export class Timer extends AVRTimer {
  constructor(cpu, config) {
    const view = new View(cpu);
    super(view, config);
    view.timer = this;
    const { data, readHooks, writeHooks } = cpu;
    const { TCNT, TIFR, TIMSK, bits } = config;
    // A look at the counter changes nothing but TEMP (17.3).
    readHooks[TCNT] = () => {
      const count = this.counted();
      if (bits === 16) data[TCNT + 1] = count >> 8;
      return count & 0xff;
    };
    // 17.11.36: a flag is cleared by a one, and by SBI this flag alone. avr8js stores what is written, and SBI writes all ones back.
    writeHooks[TIFR] = (value, old, address, mask) => {
      for (const interrupt of this.sources) if (value & mask & interrupt.flagMask) cpu.clearInterrupt(interrupt);
      this.plan();
      return true;
    };
    // avr8js forgets the third channel.
    writeHooks[TIMSK] = (value) => {
      data[TIMSK] = value;
      for (const interrupt of this.sources) cpu.updateInterruptEnable(interrupt, value);
      this.plan();
      return true;
    };
    this.channels = [[this.OCFA, 'ocrA'], [this.OCFB, 'ocrB'], [this.OCFC, 'ocrC']].slice(0, config.OCRC ? 3 : 2);
    this.sources = [this.OVF, ...this.channels.map(([interrupt]) => interrupt)];
    // The cycle up to which flags are up.
    this.synced = 0;
    this.blocked = false;
    const setCount = writeHooks[TCNT];
    writeHooks[TCNT] = (value) => { this.blocked = true; setCount(value); };
    for (const register of [config.OCRA, config.OCRB, config.OCRC, config.ICR].filter((address) => address)) {
      const set = writeHooks[register];
      writeHooks[register] = (value) => { this.catchUp(); set(value); this.plan(); };
    }
  }

  // 17.9.2: a counter beyond its top counts on to its maximum. In avr8js it wraps there.
  get TOP() {
    const top = super.TOP;
    return this.tcnt > top ? this.MAX : top;
  }

  get isIdle() { return !this.divider || UP_AND_DOWN.includes(this.timerMode); }

  // Clocks since the counter was as it is stored.
  get elapsed() { return this.isIdle ? 0 : Math.floor((this.cpu.cycles - this.lastCycle) / this.divider); }

  counted() {
    const count = this.tcntUpdated ? this.tcntNext : this.tcnt;
    return (count + this.elapsed) % (this.TOP + 1);
  }

  catchUp() { if (!this.isIdle && !this.tcntUpdated && !this.updateDivider) this.count(false); }

  // The counter has gone from `before` to `count`, where it may have wrapped. 17.10, figure 17-11: a flag goes up one clock behind the match; avr8js has it with the
  // match, and none where the counter has come once round. 17.7.2: a count that is written does not match.
  timerUpdated(count, before) {
    if (this.tcntUpdated) return;
    const { TOP, blocked } = this;
    const period = TOP + 1;
    const passed = (this.lastCycle - this.synced) / this.divider;
    this.synced = this.lastCycle;
    this.blocked = false;
    for (const [interrupt, register] of this.channels) {
      const compare = this[register];
      const after = (compare - before + period) % period;
      if (compare <= TOP && after < passed && !(blocked && after === 0)) this.cpu.setInterruptFlag(interrupt);
    }
  }

  // Makes the event at which the next flag is due. The pins of timers that go up and down are not followed.
  plan() {
    this.cpu.clearClockEvent(this.count);
    if (this.tcntUpdated || this.updateDivider) return this.cpu.addClockEvent(this.count, 0);
    if (this.isIdle) return undefined;
    // 19.1: the prescaler runs by itself. In avr8js it starts with the timer.
    this.lastCycle -= this.lastCycle % this.divider;
    this.synced = this.lastCycle;
    const { tcnt, TOP } = this;
    // A flag that is up, and that no interrupt takes down, need not be watched.
    const up = this.cpu.data[this.config.TIFR] & ~this.cpu.data[this.config.TIMSK];
    let wait = TOP + 1 - tcnt;
    for (const [{ flagMask }, register] of this.channels) {
      const compare = this[register];
      if (!(up & flagMask) && compare >= tcnt && compare <= TOP) wait = Math.min(wait, compare + 1 - tcnt);
    }
    const due = this.lastCycle + wait * this.divider;
    this.cpu.cpu.addClockEvent(this.count, due - this.cpu.cycles);
    return undefined;
  }
}
