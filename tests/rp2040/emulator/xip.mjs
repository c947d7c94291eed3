// The cache between the CPU and the flash: 16 KiB, two ways, lines of 8 bytes, the line that was used least recently goes (data sheet 2.6.3; the order
// in which lines go is not documented, and taken to be that). A line that is not there takes `miss` cycles.
//
// With the settings of the second stage of the boot loader (SSI at a quarter of the clock, continuous read in four bits) a line takes 56 cycles; published
// measurements are about 50. `KERF_XIP_MISS` is another price.

const SETS = 1024;
const LINE_BITS = 3;
const PRICE = 50;

export class Cache {
  constructor(miss = Number(process.env.KERF_XIP_MISS ?? PRICE)) {
    this.miss = miss;
    // Two lines for each set, the one used last first.
    this.lines = new Int32Array(2 * SETS);
    // Cycles waited for flash, and how often each line was read, if that is asked for.
    this.waited = 0;
    this.reads = undefined;
    this.flush();
  }

  flush() {
    this.lines.fill(-1);
    this.last = -1;
  }

  // Reads an address of the flash. Returns the cycles to wait for it.
  touch(at) {
    const line = (at & 0xffffff) >>> LINE_BITS;
    if (line === this.last) return 0;
    this.last = line;
    const { lines } = this;
    const set = (line & (SETS - 1)) << 1;
    const used = lines[set];
    if (used === line) return 0;
    const isThere = lines[set + 1] === line;
    lines[set + 1] = used;
    lines[set] = line;
    if (isThere) return 0;
    this.waited += this.miss;
    if (this.reads) this.reads.set(line, (this.reads.get(line) ?? 0) + 1);
    return this.miss;
  }
}
