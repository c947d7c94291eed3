// What stands for the boot ROM: a table of functions, and the functions that embassy-rp looks up. To write to flash clears bits of it; to erase
// it sets all.

// Thumb code, by hand: see the comments.
const LOOKUP = 0x100;
const NOP = 0x140;
const ERASE = 0x150;
const PROGRAM = 0x180;
const COPY = 0x1a0;
const FLUSH = 0x1c0;
const BOOT = 0x1d0;
const FUNCTIONS = 0x200;
const DATA = 0x280;

// The boot loader is a breakpoint of this number.
export const BOOT_LOADER = 0xb0;

export function bootRom() {
  const rom = new Uint16Array(8192);
  const put = (at, words) => words.forEach((word, i) => { rom[at / 2 + i] = word; });
  // "Mu", 1, version 2; then where the tables and the look-up are.
  put(0x10, [0x754d, 0x0201]);
  put(0x14, [FUNCTIONS, DATA, LOOKUP | 1]);
  put(LOOKUP, [
    0x8802, // r0 table, r1 code; next: ldrh r2, [r0]
    0x2a00, // cmp r2, #0
    0xd005, // beq none
    0x428a, // cmp r2, r1
    0xd001, // beq found
    0x3004, // adds r0, #4
    0xe7f8, // b next
    0x8840, // found: ldrh r0, [r0, #2]
    0x4770, // bx lr
    0x2000, // none: movs r0, #0
    0x4770, // bx lr
  ]);
  put(NOP, [0x4770]); // bx lr
  put(ERASE, [
    0x2210, // r0 offset, r1 count; movs r2, #0x10
    0x0612, // lsls r2, r2, #24
    0x1880, // adds r0, r0, r2
    0x2200, // movs r2, #0
    0x43d2, // mvns r2, r2
    0x3904, // next: subs r1, #4
    0x5042, // str r2, [r0, r1]
    0x2900, // cmp r1, #0
    0xd1fb, // bne next
    0x4770, // bx lr
  ]);
  put(PROGRAM, [
    0xb510, // r0 offset, r1 from, r2 count; push {r4, lr}
    0x2310, // movs r3, #0x10
    0x061b, // lsls r3, r3, #24
    0x18c0, // adds r0, r0, r3
    0x3a04, // next: subs r2, #4
    0x588b, // ldr r3, [r1, r2]
    0x5884, // ldr r4, [r0, r2]
    0x4023, // ands r3, r4
    0x5083, // str r3, [r0, r2]
    0x2a00, // cmp r2, #0
    0xd1f8, // bne next
    0xbd10, // pop {r4, pc}
  ]);
  // r0 to, r1 from, r2 count: a word each, from the last one on.
  put(COPY, [0x3a04, 0x588b, 0x5083, 0x2a00, 0xd1fa, 0x4770]);
  put(FLUSH, [
    0x2014, // movs r0, #0x14
    0x0600, // lsls r0, r0, #24
    0x2101, // movs r1, #1
    0x6041, // str r1, [r0, #4]
    0x4770, // bx lr
  ]);
  put(BOOT, [0xbe00 | BOOT_LOADER, 0xe7fe]); // bkpt; b .
  const code = (name) => name.charCodeAt(0) | name.charCodeAt(1) << 8;
  const functions = { IF: NOP, EX: NOP, FC: FLUSH, CX: NOP, RE: ERASE, RP: PROGRAM, MC: COPY, C4: COPY, UB: BOOT };
  put(FUNCTIONS, [...Object.entries(functions).flatMap(([name, at]) => [code(name), at | 1]), 0, 0]);
  put(DATA, [0, 0]);
  return new Uint32Array(rom.buffer);
}
