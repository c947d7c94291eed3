// Chains of 74HC595 shift registers at pins of the chip. Their outputs are pins as well, with numbers beyond those of the chip, for whoever listens to edges.

// The number of the first output of each chain: steps, and others.
export const FIRST = [32, 64];

export class Register {
  // Output 0 is QA of the register that the data go to. At power-up all are high, which is the worst that they may be; a reset of the chip changes none.
  constructor(machine, which, { data, clock, latch, outputs }) {
    Object.assign(this, { machine, data, clock, latch, outputs, first: FIRST[which] });
    this.mask = 2 ** outputs - 1;
    // Cycles of the last edges, and the least of all times that a register asks for: data before the clock, the clock high and low, the clock before the
    // latch, the latch high.
    [this.changed, this.rose, this.fell, this.latched] = [-Infinity, -Infinity, -Infinity, -Infinity];
    this.least = Infinity;
    this.powerUp();
    machine.edgeListeners.push((gpio, level, cycle) => this.edge(gpio, level, cycle));
  }

  powerUp() {
    this.bits = this.mask;
    this.latchBits(this.machine.cycle);
  }

  edge(gpio, level, cycle) {
    if (gpio === this.clock) this.clocked(level, cycle);
    else if (gpio === this.latch) this.latchMoved(level, cycle);
    else if (gpio === this.data) {
      this.takes(cycle - this.rose);
      this.changed = cycle;
    }
  }

  clocked(level, cycle) {
    if (!level) {
      this.takes(cycle - this.rose);
      this.fell = cycle;
      return;
    }
    this.takes(cycle - this.fell);
    this.takes(cycle - this.changed);
    this.rose = cycle;
    this.bits = (this.bits << 1 | this.machine.levels[this.data]) & this.mask;
  }

  latchMoved(level, cycle) {
    if (!level) return this.takes(cycle - this.latched);
    this.takes(cycle - this.rose);
    this.latched = cycle;
    this.latchBits(cycle);
  }

  takes(cycles) { if (cycles < this.least) this.least = cycles; }

  // All outputs change at once.
  latchBits(cycle) {
    const turned = this.bits ^ this.held;
    this.held = this.bits;
    for (let i = 0; i < this.outputs; i++) {
      if (turned >> i & 1) this.machine.output(this.first + i, this.bits >> i & 1, cycle);
    }
  }
}
