// The core, in sprints: the usual instructions in one loop, which leaves all others, and what is not memory, to the core of rp2040js.
//
// `quicken` returns a function that runs instructions until so many cycles have passed or one comes that is not for it, and says how many cycles it
// took. Memory, registers and flags alone change meanwhile: whoever calls looks at the clock, the PIO and interrupts between two sprints. An instruction
// takes the cycles that it takes in rp2040js, and what it waits for flash; `cures.test.mjs` holds each against it.

const RAM = 0x20000000;
// The highest byte of addresses in flash.
const FLASH = 0x10;
const [SP, LR, PC] = [13, 14, 15];

// Instructions by the bits of their first halfword, from the highest; `.` is any. The number is that of its case below. A later row wins.
const ROWS = [
  [1, '00000', 'LSLS'], [2, '00001', 'LSRS'], [3, '00010', 'ASRS'],
  [4, '0001100', 'ADDS'], [5, '0001101', 'SUBS'], [6, '0001110', 'ADDS #3'], [7, '0001111', 'SUBS #3'],
  [8, '00100', 'MOVS'], [9, '00101', 'CMP #8'], [10, '00110', 'ADDS #8'], [11, '00111', 'SUBS #8'],
  [12, '0100000000', 'ANDS'], [13, '0100000001', 'EORS'], [14, '0100000010', 'LSLS r'], [15, '0100000011', 'LSRS r'],
  [16, '0100000100', 'ASRS r'], [17, '0100000101', 'ADCS'], [18, '0100000110', 'SBCS'], [19, '0100001000', 'TST'],
  [20, '0100001001', 'RSBS'], [21, '0100001010', 'CMP'], [22, '0100001011', 'CMN'], [23, '0100001100', 'ORRS'],
  [24, '0100001101', 'MULS'], [25, '0100001110', 'BICS'], [26, '0100001111', 'MVNS'],
  // With the program counter, which reads as another instruction's place and is a branch: not for it.
  [27, '01000100', 'ADD'], [28, '01000101', 'CMP'], [29, '01000110', 'MOV'],
  [0, '010001...1111...'], [0, '010001..1....111'],
  [30, '010001110....000', 'BX'], [31, '010001111....000', 'BLX'], [0, '01000111.1111000'],
  [32, '01001', 'LDR pc'], [33, '0101000', 'STR r'], [34, '0101001', 'STRH r'], [35, '0101010', 'STRB r'], [36, '0101011', 'LDRSB'],
  [37, '0101100', 'LDR r'], [38, '0101101', 'LDRH r'], [39, '0101110', 'LDRB r'], [40, '0101111', 'LDRSH'],
  [41, '01100', 'STR'], [42, '01101', 'LDR'], [43, '01110', 'STRB'], [44, '01111', 'LDRB'], [45, '10000', 'STRH'], [46, '10001', 'LDRH'],
  [47, '10010', 'STR sp'], [48, '10011', 'LDR sp'], [49, '10100', 'ADR'], [50, '10101', 'ADD sp'],
  [51, '101100000', 'ADD sp, sp'], [52, '101100001', 'SUB sp, sp'],
  [53, '1011001000', 'SXTH'], [54, '1011001001', 'SXTB'], [55, '1011001010', 'UXTH'], [56, '1011001011', 'UXTB'],
  [57, '1011010', 'PUSH'], [58, '1011110', 'POP'], [59, '1011101000', 'REV'], [60, '1011111100000000', 'NOP'],
  [61, '11000', 'STM'], [62, '11001', 'LDM'],
  [63, '1101', 'B cond'], [0, '1101111'], [64, '11100', 'B'], [65, '11110', 'BL'],
];

// The case of each first halfword; 0 is not for it.
const CASES = new Uint8Array(65536);
for (const [number, bits] of ROWS) {
  const mask = parseInt(bits.replace(/[01]/g, '1').replace(/\./g, '0').padEnd(16, '0'), 2);
  const value = parseInt(bits.replace(/\./g, '0').padEnd(16, '0'), 2);
  for (let op = 0; op < 65536; op++) if ((op & mask) === value) CASES[op] = number;
}

// How many bits are set in a byte.
const COUNT = Uint8Array.from({ length: 256 }, (_, byte) => [...byte.toString(2)].filter((bit) => bit === '1').length);

export function quicken(mcu, cache) {
  const { core } = mcu;
  const view = (bytes, View) => new View(bytes.buffer, bytes.byteOffset, bytes.length / View.BYTES_PER_ELEMENT);
  const r = new Int32Array(core.registers.buffer, core.registers.byteOffset, 16);
  const [ram8, ram16, ram32] = [Uint8Array, Uint16Array, Int32Array].map((View) => view(mcu.sram, View));
  const [flash8, flash16, flash32] = [Uint8Array, Uint16Array, Int32Array].map((View) => view(mcu.flash, View));
  const bytes = ram8.length;

  // Whether an address is one of RAM, or of any memory, on a boundary that `mask` says.
  const isRam = (at, mask) => (at - RAM) >>> 0 < bytes && (at & mask) === 0;
  const isMemory = (at, mask) => ((at - RAM) >>> 0 < bytes || at >>> 24 === FLASH) && (at & mask) === 0;
  const isFlash = (at) => at >>> 24 === FLASH;
  // Cycles that the present instruction waits for flash.
  let waits = 0;
  const load32 = (at) => (isFlash(at) ? (waits += cache.touch(at), flash32[(at & 0xffffff) >> 2]) : ram32[(at - RAM) >> 2]);
  const load16 = (at) => (isFlash(at) ? (waits += cache.touch(at), flash16[(at & 0xffffff) >> 1]) : ram16[(at - RAM) >> 1]);
  const load8 = (at) => (isFlash(at) ? (waits += cache.touch(at), flash8[at & 0xffffff]) : ram8[at - RAM]);

  return (limit) => {
    let { N: n, Z: z, C: c, V: v } = core;
    let pc = r[PC];
    let spent = 0;
    sprint: while (spent < limit) {
      let op;
      if (isFlash(pc)) op = load16(pc);
      else if ((pc - RAM) >>> 0 < bytes) op = ram16[(pc - RAM) >> 1];
      else break;
      let cycles = 1;
      let next = pc + 2;
      // The usual registers.
      const d = op & 7;
      const m = op >> 3 & 7;
      let result;
      switch (CASES[op]) {
        case 1: { // LSLS
          const x = r[m];
          const by = op >> 6 & 31;
          if (by) c = (x >>> (32 - by) & 1) === 1;
          r[d] = result = x << by;
          n = result < 0; z = result === 0;
          break;
        }
        case 2: { // LSRS
          const x = r[m];
          const by = op >> 6 & 31;
          c = (x >>> (by ? by - 1 : 31) & 1) === 1;
          r[d] = result = by ? x >>> by | 0 : 0;
          n = result < 0; z = result === 0;
          break;
        }
        case 3: { // ASRS
          const x = r[m];
          const by = op >> 6 & 31 || 32;
          c = (x >> (by - 1) & 1) === 1;
          r[d] = result = x >> Math.min(by, 31);
          n = result < 0; z = result === 0;
          break;
        }
        case 4: case 6: case 10: case 22: { // ADDS; CMN
          const kind = CASES[op];
          const x = kind === 10 ? r[op >> 8 & 7] : kind === 22 ? r[d] : r[m];
          const y = kind === 4 ? r[op >> 6 & 7] : kind === 6 ? op >> 6 & 7 : kind === 10 ? op & 0xff : r[m];
          result = x + y | 0;
          c = result >>> 0 < x >>> 0;
          v = (~(x ^ y) & (x ^ result)) < 0;
          n = result < 0; z = result === 0;
          if (kind === 10) r[op >> 8 & 7] = result;
          else if (kind !== 22) r[d] = result;
          break;
        }
        case 5: case 7: case 9: case 11: case 20: case 21: case 28: { // SUBS; CMP; RSBS
          const kind = CASES[op];
          let x, y;
          if (kind === 5) { x = r[m]; y = r[op >> 6 & 7]; }
          else if (kind === 7) { x = r[m]; y = op >> 6 & 7; }
          else if (kind === 9 || kind === 11) { x = r[op >> 8 & 7]; y = op & 0xff; }
          else if (kind === 20) { x = 0; y = r[m]; }
          else if (kind === 21) { x = r[d]; y = r[m]; }
          else { x = r[d | op >> 4 & 8]; y = r[op >> 3 & 15]; }
          result = x - y | 0;
          c = x >>> 0 >= y >>> 0;
          v = ((x ^ y) & (x ^ result)) < 0;
          n = result < 0; z = result === 0;
          if (kind === 11) r[op >> 8 & 7] = result;
          else if (kind === 5 || kind === 7 || kind === 20) r[d] = result;
          break;
        }
        case 8: { // MOVS
          r[op >> 8 & 7] = result = op & 0xff;
          n = false; z = result === 0;
          break;
        }
        case 12: r[d] = result = r[d] & r[m]; n = result < 0; z = result === 0; break; // ANDS
        case 13: r[d] = result = r[d] ^ r[m]; n = result < 0; z = result === 0; break; // EORS
        case 14: { // LSLS by a register
          const x = r[d];
          const by = r[m] & 0xff;
          if (by) c = by <= 32 && (x >>> (32 - by) & 1) === 1;
          r[d] = result = by < 32 ? x << by : 0;
          n = result < 0; z = result === 0;
          break;
        }
        case 15: { // LSRS by a register
          const x = r[d];
          const by = r[m] & 0xff;
          if (by) c = by <= 32 && (x >>> (by - 1) & 1) === 1;
          r[d] = result = by < 32 ? x >>> by | 0 : 0;
          n = result < 0; z = result === 0;
          break;
        }
        case 16: { // ASRS by a register
          const x = r[d];
          const by = Math.min(r[m] & 0xff, 32);
          if (by) c = (x >> (by - 1) & 1) === 1;
          r[d] = result = x >> Math.min(by, 31);
          n = result < 0; z = result === 0;
          break;
        }
        case 17: { // ADCS
          const x = r[d];
          const y = r[m];
          const carry = c ? 1 : 0;
          const sum = (x >>> 0) + (y >>> 0) + carry;
          r[d] = result = sum | 0;
          c = sum > 0xffffffff;
          v = (~(x ^ y) & (x ^ result)) < 0;
          n = result < 0; z = result === 0;
          break;
        }
        case 18: { // SBCS
          const x = r[d];
          const y = r[m];
          const borrow = c ? 0 : 1;
          r[d] = result = x - y - borrow | 0;
          c = x >>> 0 >= (y >>> 0) + borrow;
          v = ((x ^ y) & (x ^ result)) < 0;
          n = result < 0; z = result === 0;
          break;
        }
        case 19: result = r[d] & r[m]; n = result < 0; z = result === 0; break; // TST
        case 23: r[d] = result = r[d] | r[m]; n = result < 0; z = result === 0; break; // ORRS
        case 24: r[d] = result = Math.imul(r[d], r[m]); n = result < 0; z = result === 0; break; // MULS
        case 25: r[d] = result = r[d] & ~r[m]; n = result < 0; z = result === 0; break; // BICS
        case 26: r[d] = result = ~r[m]; n = result < 0; z = result === 0; break; // MVNS
        case 27: { // ADD
          const to = d | op >> 4 & 8;
          result = r[to] + r[op >> 3 & 15] | 0;
          r[to] = to === SP ? result & ~3 : result;
          break;
        }
        case 29: { // MOV
          const to = d | op >> 4 & 8;
          result = r[op >> 3 & 15];
          r[to] = to === SP ? result & ~3 : result;
          break;
        }
        case 30: case 31: { // BX, BLX
          const to = r[op >> 3 & 15];
          // The end of an exception.
          if (to >>> 28 === 0xf) break sprint;
          if (op & 0x80) r[LR] = next | 1;
          next = to & ~1;
          cycles = 2;
          break;
        }
        case 32: { // LDR from behind the code
          const at = (pc + 4 & ~3) + ((op & 0xff) << 2);
          if (!isMemory(at, 3)) break sprint;
          r[op >> 8 & 7] = load32(at);
          cycles = 2;
          break;
        }
        case 33: case 41: case 47: { // STR
          const kind = CASES[op];
          const at = (kind === 33 ? r[m] + r[op >> 6 & 7] : kind === 41 ? r[m] + (op >> 4 & 0x7c) : r[SP] + ((op & 0xff) << 2)) | 0;
          if (!isRam(at, 3)) break sprint;
          ram32[(at - RAM) >> 2] = r[kind === 47 ? op >> 8 & 7 : d];
          cycles = 2;
          break;
        }
        case 34: case 45: { // STRH
          const at = r[m] + (CASES[op] === 34 ? r[op >> 6 & 7] : op >> 5 & 0x3e) | 0;
          if (!isRam(at, 1)) break sprint;
          ram16[(at - RAM) >> 1] = r[d];
          cycles = 2;
          break;
        }
        case 35: case 43: { // STRB
          const at = r[m] + (CASES[op] === 35 ? r[op >> 6 & 7] : op >> 6 & 0x1f) | 0;
          if (!isRam(at, 0)) break sprint;
          ram8[at - RAM] = r[d];
          cycles = 2;
          break;
        }
        case 37: case 42: case 48: { // LDR
          const kind = CASES[op];
          const at = (kind === 37 ? r[m] + r[op >> 6 & 7] : kind === 42 ? r[m] + (op >> 4 & 0x7c) : r[SP] + ((op & 0xff) << 2)) | 0;
          if (!isMemory(at, 3)) break sprint;
          r[kind === 48 ? op >> 8 & 7 : d] = load32(at);
          cycles = 2;
          break;
        }
        case 38: case 46: case 40: { // LDRH, LDRSH
          const kind = CASES[op];
          const at = r[m] + (kind === 46 ? op >> 5 & 0x3e : r[op >> 6 & 7]) | 0;
          if (!isMemory(at, 1)) break sprint;
          r[d] = kind === 40 ? load16(at) << 16 >> 16 : load16(at);
          cycles = 2;
          break;
        }
        case 39: case 44: case 36: { // LDRB, LDRSB
          const kind = CASES[op];
          const at = r[m] + (kind === 44 ? op >> 6 & 0x1f : r[op >> 6 & 7]) | 0;
          if (!isMemory(at, 0)) break sprint;
          r[d] = kind === 36 ? load8(at) << 24 >> 24 : load8(at);
          cycles = 2;
          break;
        }
        case 49: r[op >> 8 & 7] = (pc & ~3) + 4 + ((op & 0xff) << 2); break; // ADR
        case 50: r[op >> 8 & 7] = r[SP] + ((op & 0xff) << 2); break; // ADD from the stack pointer
        case 51: r[SP] = r[SP] + ((op & 0x7f) << 2); break;
        case 52: r[SP] = r[SP] - ((op & 0x7f) << 2); break;
        case 53: r[d] = r[m] << 16 >> 16; break; // SXTH
        case 54: r[d] = r[m] << 24 >> 24; break; // SXTB
        case 55: r[d] = r[m] & 0xffff; break; // UXTH
        case 56: r[d] = r[m] & 0xff; break; // UXTB
        case 57: { // PUSH
          const count = COUNT[op & 0xff] + (op >> 8 & 1);
          let at = r[SP] - 4 * count | 0;
          if (!count || !isRam(at, 3) || !isRam(r[SP] - 4, 3)) break sprint;
          r[SP] = at;
          for (let i = 0; i < 8; i++) if (op >> i & 1) { ram32[(at - RAM) >> 2] = r[i]; at += 4; cycles++; }
          if (op >> 8 & 1) ram32[(at - RAM) >> 2] = r[LR];
          break;
        }
        case 58: { // POP
          const count = COUNT[op & 0xff] + (op >> 8 & 1);
          let at = r[SP];
          const last = at + 4 * (count - 1) | 0;
          if (!count || !isRam(at, 3) || !isRam(last, 3)) break sprint;
          if (op >> 8 & 1) {
            const to = ram32[(last - RAM) >> 2];
            if (to >>> 28 === 0xf) break sprint;
            next = to & ~1;
            cycles = 3;
          }
          for (let i = 0; i < 8; i++) if (op >> i & 1) { r[i] = ram32[(at - RAM) >> 2]; at += 4; cycles++; }
          r[SP] = last + 4;
          break;
        }
        case 59: { // REV
          const x = r[m];
          r[d] = x << 24 | (x & 0xff00) << 8 | x >>> 8 & 0xff00 | x >>> 24;
          break;
        }
        case 60: break; // NOP
        case 61: { // STM
          const base = op >> 8 & 7;
          const count = COUNT[op & 0xff];
          let at = r[base];
          if (!count || op >> base & 1 || !isRam(at, 3) || !isRam(at + 4 * (count - 1) | 0, 3)) break sprint;
          for (let i = 0; i < 8; i++) if (op >> i & 1) { ram32[(at - RAM) >> 2] = r[i]; at += 4; cycles++; }
          r[base] = at;
          break;
        }
        case 62: { // LDM
          const base = op >> 8 & 7;
          const count = COUNT[op & 0xff];
          let at = r[base];
          if (!count || !isMemory(at, 3) || !isMemory(at + 4 * (count - 1) | 0, 3)) break sprint;
          for (let i = 0; i < 8; i++) if (op >> i & 1) { r[i] = load32(at); at += 4; cycles++; }
          if (!(op >> base & 1)) r[base] = at;
          break;
        }
        case 63: { // B, on a condition
          let is;
          switch (op >> 9 & 7) {
            case 0: is = z; break;
            case 1: is = c; break;
            case 2: is = n; break;
            case 3: is = v; break;
            case 4: is = c && !z; break;
            case 5: is = n === v; break;
            default: is = n === v && !z;
          }
          if (is !== (op >> 8 & 1) > 0) { next = pc + 4 + ((op << 24 >> 24) << 1); cycles = 2; }
          break;
        }
        case 64: next = pc + 4 + ((op << 21 >> 21) << 1); cycles = 2; break; // B
        case 65: { // BL
          const low = load16(next);
          if ((low & 0xd000) !== 0xd000) break sprint;
          const sign = op >> 10 & 1;
          const i1 = 1 ^ low >> 13 & 1 ^ sign;
          const i2 = 1 ^ low >> 11 & 1 ^ sign;
          r[LR] = pc + 4 | 1;
          next = pc + 4 + (-sign << 24 | i1 << 23 | i2 << 22 | (op & 0x3ff) << 12 | (low & 0x7ff) << 1);
          cycles = 3;
          break;
        }
        default: break sprint;
      }
      pc = next;
      spent += cycles + waits;
      waits = 0;
    }
    // An instruction that is left to others has waited all the same.
    spent += waits;
    waits = 0;
    r[PC] = pc;
    core.N = n; core.Z = z; core.C = c; core.V = v;
    core.cycles += spent;
    return spent;
  };
}
