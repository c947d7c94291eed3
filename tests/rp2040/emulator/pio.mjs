// The PIO on the clock of the chip. That of rp2040js runs from `setTimeout`, with no relation to the clock, and without delays.
// Here each state machine has its next cycle.

// It can go on only when the CPU or the DMA gives it a word, or someone changes a flag that is not yet as it waits for.
const TX_FIFO = 3;
const IRQ = 4;
const OUT = 5;
const waitsForFlag = (sm) => sm.waitType === IRQ && !!(sm.pio.irq & 1 << sm.waitIndex) !== sm.waitPolarity;
const isStalled = (sm) => sm.waiting && (sm.waitType === TX_FIFO || sm.waitType === OUT || waitsForFlag(sm));

// `jmp x-- here`, without a delay: all rounds but the first and the last, in one go. How many cycles that is.
function skip(pio, sm) {
  const op = pio.instructions[sm.pc];
  if (sm.waiting || (op & 0xffe0) !== 0x0040 || (op & 0x1f) !== sm.pc) return 0;
  const rounds = sm.x >>> 0;
  if (rounds < 2) return 0;
  sm.x = 1;
  return rounds - 1;
}

// To join FIFOs, or to part them, empties them.
const SHIFTCTRL = 0x8;
const JOINS = 3 << 30;
function emptiesFifos(sm) {
  const write = sm.writeUint32.bind(sm);
  sm.writeUint32 = (offset, value) => {
    if (offset === SHIFTCTRL && (sm.shiftCtrl ^ value) & JOINS) {
      sm.txFIFO.reset();
      sm.rxFIFO.reset();
      sm.updateDMATx();
      sm.updateDMARx();
    }
    write(offset, value);
  };
}

export class Pio {
  constructor(pio) {
    this.pio = pio;
    // Runs when the clock says so.
    pio.run = () => {};
    this.next = [0, 0, 0, 0];
    // Up to where all has run, and the first cycle behind it at which there is something to do.
    this.at = 0;
    this.first = 0;
    // The cycle of the instruction that runs.
    this.now = undefined;
    // Whoever writes to it may have something to do for it.
    const write = pio.writeUint32.bind(pio);
    pio.writeUint32 = (offset, value) => { this.first = 0; write(offset, value); };
    pio.machines.forEach(emptiesFifos);
  }

  // Runs all that is due before the cycle `until`.
  run(until) {
    if (until > this.first && !this.pio.stopped) this.catchUp(until);
    this.at = until;
  }

  catchUp(until) {
    const { pio, next, at } = this;
    for (;;) {
      let first = Infinity;
      let which = -1;
      for (let i = 0; i < 4; i++) {
        const sm = pio.machines[i];
        if (!sm.enabled || isStalled(sm)) continue;
        // What was disabled, or waited for a word, does not catch up.
        if (next[i] < at) next[i] = at;
        if (next[i] < first) { first = next[i]; which = i; }
      }
      this.first = first;
      if (first >= until) return;
      this.step(which, first);
    }
  }

  // An instruction of a state machine, at its cycle.
  step(which, cycle) {
    const { pio, next } = this;
    const sm = pio.machines[which];
    const divider = (sm.clockDivInt || 65536) + sm.clockDivFrac / 256;
    const skipped = skip(pio, sm);
    if (skipped) {
      next[which] = cycle + skipped * divider;
      return;
    }
    const before = sm.cycles;
    this.now = cycle;
    sm.step();
    pio.checkChangedPins();
    this.now = undefined;
    next[which] = cycle + (sm.waiting ? 1 : Math.max(1, sm.cycles - before)) * divider;
  }

  // The next cycle at which something happens by itself.
  due() {
    const { pio, next } = this;
    let first = Infinity;
    if (pio.stopped) return first;
    for (let i = 0; i < 4; i++) {
      const sm = pio.machines[i];
      if (!sm.enabled || isStalled(sm)) continue;
      // Rounds in which nothing happens are none.
      const op = pio.instructions[sm.pc];
      const rounds = !sm.waiting && (op & 0xffe0) === 0x0040 && (op & 0x1f) === sm.pc ? sm.x >>> 0 : 0;
      first = Math.min(first, next[i] + rounds * ((sm.clockDivInt || 65536) + sm.clockDivFrac / 256));
    }
    return first;
  }
}
