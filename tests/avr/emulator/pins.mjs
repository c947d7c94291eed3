// The pins of the ATmega2560, the interrupts of pins, and what the pins of a board lead to: motors, switches that they work, and the sensors of a spindle. A pin is a
// number: eight times its port, A first and without an I, and its bit.
import avr8js from 'avr8js';

const { AVRIOPort } = avr8js;

const CLOCK_HZ = 16e6;
// PIN, DDR and PORT of a port (data sheet, 33).
const PORTS = [0x20, 0x23, 0x26, 0x29, 0x2c, 0x2f, 0x32, 0x100, 0x103, 0x106, 0x109];
const [B, D, E, J, K] = [1, 3, 4, 8, 9];
const [PCIFR, EIFR, EIMSK, PCICR, EICRA, PCMSK] = [0x3b, 0x3c, 0x3d, 0x68, 0x69, 0x6b];
// INT0 to INT3 are on port D, INT4 to INT7 on port E (15); the first vectors, and those of PCINT behind them.
const EXTERNAL = 1;
const CHANGE = 9;

// The numbers of the interrupts of pins. PCINT0 to 7 are on port B, 8 on E, 9 to 15 on J, 16 to 23 on K (15.2).
const EXTERNALS = new Map();
const CHANGES = new Map();
const bits = (count, name, port, first, number) => { for (let bit = 0; bit < count; bit++) name.set(8 * port + first + bit, number + bit); };
bits(4, EXTERNALS, D, 0, 0);
bits(4, EXTERNALS, E, 4, 4);
bits(8, CHANGES, B, 0, 0);
bits(1, CHANGES, E, 0, 8);
bits(7, CHANGES, J, 0, 9);
bits(8, CHANGES, K, 0, 16);

// A port whose inputs are pulled up where PORT says so and nobody drives them (13.2). In avr8js they are low.
class Port extends AVRIOPort {
  constructor(cpu, base, edge) {
    super(cpu, { PIN: base, DDR: base + 1, PORT: base + 2, externalInterrupts: [] });
    Object.assign(this, { edge, driven: 0, levels: 0 });
  }
  drive(bit, high) {
    this.driven |= 1 << bit;
    this.levels = high ? this.levels | 1 << bit : this.levels & ~(1 << bit);
    this.updatePinRegister(this.cpu.data[this.portConfig.DDR]);
  }
  updatePinRegister(ddr) {
    this.pinValue = this.levels & this.driven | this.cpu.data[this.portConfig.PORT] & ~this.driven;
    super.updatePinRegister(ddr);
  }
  toggleInterrupt(bit, rising) { this.edge(bit, rising); }
}

// The interrupts of pins, in place of those of avr8js. Data sheet, 15.1: a flag goes up whether or not it is enabled, and waits; each group has its enable in PCICR. In
// avr8js a masked edge is lost, PCICR is not looked at when it is written, and a write of one PCMSK enables or disables all groups.
export class Pins {
  constructor(cpu) {
    this.cpu = cpu;
    this.ports = PORTS.map((base, port) => new Port(cpu, base, (bit, rising) => this.edge(port, bit, rising)));
    const source = (vector, flagRegister, bit, enableRegister) => ({ address: 2 * vector, flagRegister, flagMask: 1 << bit, enableRegister, enableMask: 1 << bit });
    this.externals = [0, 1, 2, 3, 4, 5, 6, 7].map((n) => source(EXTERNAL + n, EIFR, n, EIMSK));
    this.changes = [0, 1, 2].map((n) => source(CHANGE + n, PCIFR, n, PCICR));
    for (const [flags, mask, sources] of [[EIFR, EIMSK, this.externals], [PCIFR, PCICR, this.changes]]) {
      cpu.writeHooks[flags] = (value, old, address, touched) => {
        for (const interrupt of sources) if (value & touched & interrupt.flagMask) cpu.clearInterrupt(interrupt);
        return true;
      };
      cpu.writeHooks[mask] = (value) => { for (const interrupt of sources) cpu.updateInterruptEnable(interrupt, value); };
    }
  }

  edge(port, bit, rising) {
    const { data } = this.cpu;
    const n = EXTERNALS.get(8 * port + bit);
    if (n !== undefined) {
      const sense = data[EICRA + (n >> 2)] >> 2 * (n & 3) & 3;
      if (sense === 1 || (sense === 3) === rising) this.cpu.setInterruptFlag(this.externals[n]);
    }
    const c = CHANGES.get(8 * port + bit);
    if (c !== undefined && data[PCMSK + (c >> 3)] & 1 << (c & 7)) this.cpu.setInterruptFlag(this.changes[c >> 3]);
  }

  drive(pin, high) { this.ports[pin >> 3].drive(pin & 7, high); }
  isHigh(pin) { return (this.ports[pin >> 3].lastValue & this.cpu.data[PORTS[pin >> 3] + 1]) >> (pin & 7) & 1; }
}

// The motors: their steps, up where the direction pin is low, and the switches that they work. A step counts from the edge of its pulse.
export class Motors {
  constructor(motors) {
    this.motors = motors;
    this.positions = motors.map(() => 0);
    this.totals = motors.map(() => 0);
    this.last = 0;
    this.times = undefined;
    this.switches = [];
  }

  // Looks at the pins of a chip that has just been started.
  attach(pins) {
    this.pins = pins;
    for (const port of new Set(this.motors.map(([step]) => step >> 3))) {
      pins.ports[port].addListener((now, before) => {
        const ddr = pins.cpu.data[PORTS[port] + 1];
        const rose = now & ~before & ddr;
        if (rose) this.motors.forEach(([step], motor) => { if (step >> 3 === port && rose >> (step & 7) & 1) this.step(motor); });
      });
    }
    this.switches.forEach((one) => this.work(one));
  }

  step(motor) {
    const now = this.pins.cpu.stores;
    this.positions[motor] += this.pins.isHigh(this.motors[motor][1]) ? -1 : 1;
    this.totals[motor]++;
    this.last = now;
    this.times?.[motor].push(now);
    for (const one of this.switches) if (one.motor === motor) this.work(one);
  }

  record() { this.times = this.motors.map(() => []); }

  wire(switches) {
    this.switches = switches;
    this.switches.forEach((one) => this.work(one));
  }

  // A switch is worked while its motor is at or beyond its step.
  work({ pin, motor, step, above, opens }) {
    const at = this.positions[motor];
    const isWorked = above ? at >= step : at <= step;
    this.pins.drive(pin, isWorked === opens);
  }
}

// The sensors of a spindle, which pull their pins low while marks pass: one mark of the index in a turn, and `pulses` of the others, the first half of the way between
// two behind it.
const INDEX_WIDTH = 0.02;
const WIDTH = 0.3;
// The edges come so late behind the angle; all alike.
const LATE = 16_000;

export class Spindle {
  constructor({ index, sync, pulses }) {
    const mark = (pin, at, width) => [{ at, pin, high: false }, { at: at + width, pin, high: true }];
    const marks = Array.from({ length: pulses }, (_, n) => mark(sync, (n + 0.5) / pulses, WIDTH / pulses));
    this.edges = [mark(index, 0, INDEX_WIDTH), ...marks].flat().sort((a, b) => a.at - b.at);
    Object.assign(this, { angle: 0, since: 0, speed: 0, next: 1, due: Infinity, idle: [index, sync] });
  }

  attach(pins) {
    this.pins = pins;
    this.idle.forEach((pin) => pins.drive(pin, true));
    this.pass = () => { this.turned(); };
    this.arm();
  }

  // It turns so fast from now on, turns a minute.
  turn(rpm, now) {
    this.angle += (now - this.since) * this.speed;
    Object.assign(this, { since: now, speed: rpm / 60 / CLOCK_HZ });
    this.plan();
    this.arm();
  }

  plan() {
    const { edges, next } = this;
    const angle = Math.floor(next / edges.length) + edges[next % edges.length].at;
    this.due = this.speed ? this.since + LATE + Math.floor((angle - this.angle) / this.speed) : Infinity;
  }

  arm() {
    this.pins.cpu.clearClockEvent(this.pass);
    if (this.due < Infinity) this.pins.cpu.addClockEvent(this.pass, this.due - this.pins.cpu.cycles);
  }

  turned() {
    const { pin, high } = this.edges[this.next++ % this.edges.length];
    this.pins.drive(pin, high);
    this.plan();
    this.arm();
  }
}
