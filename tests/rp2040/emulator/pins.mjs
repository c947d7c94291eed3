// What is wired to the pins of the board: motors that count their steps, and switches that they work.

// A switch at a pin, closed while a motor is at or beyond a step, or open there.
class Near {
  constructor({ gpio, motor, step, above, opens }) {
    Object.assign(this, { gpio, motor, step, above, opens });
  }
  // Whether the pin is high: closed is low.
  isHigh(position) {
    const worked = this.above ? position >= this.step : position <= this.step;
    return worked === this.opens;
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
    this.near = [];
    // While someone records: when each motor's steps rise, and the shortest pulse.
    this.times = undefined;
    this.shortest = Infinity;
    machine.edgeListeners.push((gpio, level, cycle) => { level ? this.rose(gpio, cycle) : this.fell(gpio, cycle); });
  }

  // Begins to record, or ends: then all that has been recorded.
  record(on) {
    const { times, shortest } = this;
    this.times = on ? this.pins.map(() => []) : undefined;
    this.shortest = Infinity;
    return { times, shortest };
  }

  fell(gpio, cycle) {
    const motor = this.times ? this.pins.findIndex((pins) => pins.step === gpio) : -1;
    if (motor >= 0) this.shortest = Math.min(this.shortest, cycle - (this.last[motor] ?? -Infinity));
  }

  rose(gpio, cycle) {
    const motor = this.pins.findIndex((pins) => pins.step === gpio);
    if (motor < 0) return;
    this.positions[motor] += this.machine.levels[this.pins[motor].dir] ? -1 : 1;
    this.totals[motor]++;
    this.gaps[motor] = Math.min(this.gaps[motor], cycle - (this.last[motor] ?? -Infinity));
    this.last[motor] = cycle;
    this.lastStep = cycle;
    this.times?.[motor].push(cycle);
    for (const near of this.near) if (near.motor === motor) this.work(near);
  }

  wire(switches) {
    this.near = switches.map((one) => new Near(one));
    this.near.forEach((near) => this.work(near));
  }

  work(near) { this.machine.drive(near.gpio, near.isHigh(this.positions[near.motor])); }
}
