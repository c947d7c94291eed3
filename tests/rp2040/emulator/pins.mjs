// What is wired to the pins of the board: motors that count their steps, switches that they work, and the sensors of a spindle.

import { CLOCK_HZ } from './machine.mjs';
import { FIRST } from './register.mjs';

// A switch that is worked while a motor is at or beyond a step, and until it is `back` steps back.
class Switch {
  constructor({ motor, step, above, back }) {
    Object.assign(this, { motor, step, sign: above ? 1 : -1, back: back ?? 0, worked: false });
  }
  isWorked(positions) {
    const beyond = this.sign * (positions[this.motor] - this.step);
    this.worked = beyond >= 0 || (this.worked && beyond > -this.back);
    return this.worked;
  }
}

// A pin and its switches, which close when they are worked, side by side; or open, one behind the other.
class Pin {
  constructor(gpio, switches) {
    this.gpio = gpio;
    this.opens = switches[0].opens;
    this.switches = switches.map((one) => new Switch(one));
    this.motors = this.switches.map(({ motor }) => motor);
    this.isHeld = false;
  }
  // Whether it is high: closed is low, and so is one that somebody holds.
  isHigh(positions) {
    const worked = this.switches.map((one) => one.isWorked(positions));
    return !this.isHeld && worked.includes(true) === this.opens;
  }
}

export class Motors {
  // Motors by the numbers of their pins: `{ step, dir }`.
  constructor(machine, pins) {
    this.machine = machine;
    this.pins = pins;
    this.positions = pins.map(() => 0);
    this.totals = pins.map(() => 0);
    this.gaps = pins.map(() => Infinity);
    this.last = pins.map(() => undefined);
    this.lastStep = 0;
    this.wired = [];
    this.stepListeners = [];
    // While someone records: when each motor's steps rise and in which direction they are, edges of outputs behind a register that are no steps, and the shortest pulse.
    this.times = undefined;
    this.edges = [];
    this.shortest = Infinity;
    this.watchDirections();
    machine.edgeListeners.push((gpio, level, cycle) => {
      if (this.times && gpio >= FIRST[1]) this.edges.push([gpio - FIRST[1], level === 1, cycle]);
      if (level) this.rose(gpio, cycle);
      else this.fell(gpio, cycle);
    });
  }

  // Begins to record, or ends: then all that has been recorded.
  record(on) {
    const { times, signs, edges, shortest } = this;
    const [hold, setup] = [this.hold, this.setup].map((least) => (Number.isFinite(least) ? least : null));
    this.times = on ? this.pins.map(() => []) : undefined;
    this.signs = this.pins.map(() => []);
    this.edges = [];
    this.shortest = Infinity;
    this.watchDirections();
    return { times, signs, edges, shortest, hold, setup };
  }

  // The least time from the end of a pulse to the next change of the motor's direction, and from there to the next pulse.
  watchDirections() {
    [this.hold, this.setup] = [Infinity, Infinity];
    this.fallen = this.pins.map(() => -Infinity);
    this.turned = this.pins.map(() => -Infinity);
  }

  turns(gpio, cycle) {
    const motor = this.pins.findIndex((pins) => pins.dir === gpio);
    if (motor < 0) return;
    this.hold = Math.min(this.hold, cycle - this.fallen[motor]);
    this.turned[motor] = cycle;
  }

  fell(gpio, cycle) {
    if (!this.times) return;
    this.turns(gpio, cycle);
    const motor = this.pins.findIndex((pins) => pins.step === gpio);
    if (motor < 0) return;
    this.shortest = Math.min(this.shortest, cycle - (this.last[motor] ?? -Infinity));
    this.fallen[motor] = cycle;
  }

  rose(gpio, cycle) {
    if (this.times) this.turns(gpio, cycle);
    const motor = this.pins.findIndex((pins) => pins.step === gpio);
    if (motor < 0) return;
    if (this.times) this.setup = Math.min(this.setup, cycle - this.turned[motor]);
    const sign = this.machine.levels[this.pins[motor].dir] ? -1 : 1;
    this.positions[motor] += sign;
    this.totals[motor]++;
    this.gaps[motor] = Math.min(this.gaps[motor], cycle - (this.last[motor] ?? -Infinity));
    this.last[motor] = cycle;
    this.lastStep = cycle;
    if (this.times) {
      this.times[motor].push(cycle);
      this.signs[motor].push(sign);
    }
    for (const listener of this.stepListeners) listener(motor, sign, cycle);
    for (const pin of this.wired) if (pin.motors.includes(motor)) this.work(pin);
  }

  wire(switches) {
    const gpios = [...new Set(switches.map(({ gpio }) => gpio))];
    this.wired = gpios.map((gpio) => new Pin(gpio, switches.filter((one) => one.gpio === gpio)));
    this.wired.forEach((pin) => this.work(pin));
  }

  work(pin) { this.machine.drive(pin.gpio, pin.isHigh(this.positions)); }

  // Somebody drives a pin. Switches that close leave it low for as long as it is held so.
  drive(gpio, high) {
    const pin = this.wired.find((one) => one.gpio === gpio);
    if (pin && !pin.opens) pin.isHeld = !high;
    this.machine.drive(gpio, high);
  }
}

// Noise at a pin: its level changes with a period, in cycles.
export class Noise {
  constructor(machine, { gpio, period }) {
    Object.assign(this, { machine, gpio, half: period / 2, high: true });
    this.due = period ? machine.cycle + this.half : Infinity;
    if (!period) machine.drive(gpio, true);
  }
  // The edge that is due.
  pass() {
    this.high = !this.high;
    this.machine.drive(this.gpio, this.high);
    this.due += this.half;
  }
}

// The sensors of a spindle: they pull their pins low while marks pass. The index sees one in a turn, at its beginning; the other `pulses`, the first
// half of the way between two behind that.
const INDEX_WIDTH = 0.02;
const WIDTH = 0.3;

export class Spindle {
  constructor(machine, { index, sync, pulses }) {
    [this.machine, this.index, this.sync] = [machine, index, sync];
    // Turns up to a cycle, and turns a cycle from there on.
    [this.angle, this.since, this.speed] = [0, machine.cycle, 0];
    this.setMarks(pulses);
  }
  // It has so many sync marks from now on.
  setMarks(pulses) {
    if (pulses === this.pulses) return;
    this.pulses = pulses;
    const mark = (gpio, at, width) => [{ at, gpio, high: false }, { at: at + width, gpio, high: true }];
    const marks = Array.from({ length: pulses > 1 ? pulses : 0 }, (_, n) => mark(this.sync, (n + 0.5) / pulses, WIDTH / pulses));
    // Edges of a turn: at which angle, in turns, a pin goes where.
    this.edges = [mark(this.index, 0, INDEX_WIDTH), ...marks].flat().sort((a, b) => a.at - b.at);
    // The edge that comes next.
    const angle = this.angle + (this.machine.cycle - this.since) * this.speed;
    const turns = Math.floor(angle);
    const ahead = this.edges.findIndex(({ at }) => at >= angle - turns);
    this.next = turns * this.edges.length + (ahead < 0 ? this.edges.length : ahead);
    this.plan();
  }
  // It turns so fast from now on, turns a minute, to either side alike.
  turn(rpm) {
    const { cycle } = this.machine;
    this.angle += (cycle - this.since) * this.speed;
    [this.since, this.speed] = [cycle, Math.abs(rpm) / 60 / CLOCK_HZ];
    this.plan();
  }
  // When the next edge is due.
  plan() {
    const { edges, next } = this;
    const angle = Math.floor(next / edges.length) + edges[next % edges.length].at;
    this.due = this.speed ? this.since + (angle - this.angle) / this.speed : Infinity;
  }
  // The edge that is due passes.
  pass() {
    const { gpio, high } = this.edges[this.next++ % this.edges.length];
    this.machine.drive(gpio, high);
    this.plan();
  }
}
