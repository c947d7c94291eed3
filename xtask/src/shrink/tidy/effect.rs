//! The effect of each instruction: the registers and flags that it reads and writes.

use super::super::text::{Insn, Line};

/// A set of registers and flags: a bit for each of the registers 0 to 31, then for the flags.
pub type Set = u64;

pub const C: Set = 1 << 32;
pub const Z: Set = 1 << 33;
pub const N: Set = 1 << 34;
pub const V: Set = 1 << 35;
pub const S: Set = 1 << 36;
pub const H: Set = 1 << 37;
pub const T: Set = 1 << 38;

/// Flags that arithmetic writes.
const SUM: Set = C | Z | N | V | S | H;
/// Flags that logic writes.
const LOGIC: Set = Z | N | V | S;
/// Flags that right shifts and additions to pairs write.
const SHIFT: Set = C | Z | N | V | S;
pub const FLAGS: Set = SUM | T;
pub const REGISTERS: Set = u32::MAX as Set;
pub const ALL: Set = REGISTERS | FLAGS;

/// Callee-saved registers.
pub const KEPT: Set = range(2, 17) | range(28, 29);
/// Registers of arguments.
pub const ARGUMENTS: Set = range(8, 25);
/// Registers of results.
pub const RESULTS: Set = range(18, 25);
/// Registers and flags that a call leaves undefined.
const LOST: Set = bit(0) | range(26, 27) | range(30, 31) | FLAGS;

/// The effect of an instruction on registers and flags.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effect {
    /// What the result depends on.
    pub reads: Set,
    /// What is always written.
    pub writes: Set,
    /// What may also be written.
    pub spoils: Set,
    /// Whether it does more: memory, ports, the stack, or control flow.
    pub acts: bool,
}

impl Effect {
    /// The effect of unknown code.
    pub const UNKNOWN: Effect = Effect { reads: ALL, writes: 0, spoils: ALL, acts: true };

    fn pure(reads: Set, writes: Set) -> Option<Effect> {
        Some(Effect { reads, writes, spoils: 0, acts: false })
    }

    fn acting(reads: Set, writes: Set) -> Option<Effect> {
        Some(Effect { reads, writes, spoils: 0, acts: true })
    }

    /// Returns the registers and flags that may have other values afterwards.
    pub fn changes(&self) -> Set {
        self.writes | self.spoils
    }
}

pub const fn bit(register: u8) -> Set {
    1 << register
}

const fn range(first: u8, last: u8) -> Set {
    (bit(last) << 1) - bit(first)
}

pub const fn pair(register: u8) -> Set {
    3 << register
}

/// Returns the register that an operand names.
pub fn register(operand: &str) -> Option<u8> {
    operand.strip_prefix('r')?.parse().ok().filter(|number| *number < 32)
}

/// The operands of an instruction, at most two.
pub fn operands(insn: &Insn) -> (&str, &str) {
    // A search for a character is many times as fast as a search for a text, and this function is called more often
    // than any other.
    match insn.args.split_once(',') {
        Some((first, second)) => (first, second.trim_start()),
        None => (&insn.args, ""),
    }
}

/// Returns the pointer of a memory operand, and what is added to it.
pub fn place(operand: &str) -> Option<(u8, &str)> {
    let base = match operand.get(..1)? {
        "X" => 26,
        "Y" => 28,
        "Z" => 30,
        _ => return None,
    };
    Some((base, &operand[1..]))
}

/// Returns the effect of a line.
pub fn of_line(line: &Line) -> Effect {
    match line {
        Line::Insn(insn) => of(insn).unwrap_or(Effect::UNKNOWN),
        Line::Fixed(_) => Effect::UNKNOWN,
        Line::Label(_) | Line::Note(_) => Effect { reads: 0, writes: 0, spoils: 0, acts: true },
    }
}

/// Returns the effect of an instruction; `None` if it is unknown.
pub fn of(insn: &Insn) -> Option<Effect> {
    let (first, second) = operands(insn);
    let (d, s) = (register(first), register(second));
    let same = d.is_some() && d == s;
    let set = |register: Option<u8>| register.map(bit);
    match insn.op.as_str() {
        "mov" => Effect::pure(set(s)?, set(d)?),
        "movw" => Effect::pure(pair(s?), pair(d?)),
        "ldi" => Effect::pure(0, set(d)?),
        "add" => Effect::pure(set(d)? | set(s)?, set(d)? | SUM),
        "adc" => Effect::pure(set(d)? | set(s)? | C, set(d)? | SUM),
        "lsl" => Effect::pure(set(d)?, set(d)? | SUM),
        "rol" => Effect::pure(set(d)? | C, set(d)? | SUM),
        "sub" if same => Effect::pure(0, set(d)? | SUM),
        "sub" => Effect::pure(set(d)? | set(s)?, set(d)? | SUM),
        "subi" | "neg" => Effect::pure(set(d)?, set(d)? | SUM),
        "sbc" if same => Effect::pure(C | Z, set(d)? | SUM),
        "sbc" => Effect::pure(set(d)? | set(s)? | C | Z, set(d)? | SUM),
        "sbci" => Effect::pure(set(d)? | C | Z, set(d)? | SUM),
        "cp" => Effect::pure(set(d)? | set(s)?, SUM),
        "cpi" => Effect::pure(set(d)?, SUM),
        "cpc" => Effect::pure(set(d)? | set(s)? | C | Z, SUM),
        "clr" => Effect::pure(0, set(d)? | LOGIC),
        "eor" if same => Effect::pure(0, set(d)? | LOGIC),
        "and" | "or" | "eor" => Effect::pure(set(d)? | set(s)?, set(d)? | LOGIC),
        "andi" | "ori" | "inc" | "dec" => Effect::pure(set(d)?, set(d)? | LOGIC),
        "tst" => Effect::pure(set(d)?, LOGIC),
        "com" | "lsr" | "asr" => Effect::pure(set(d)?, set(d)? | SHIFT),
        "ror" => Effect::pure(set(d)? | C, set(d)? | SHIFT),
        "swap" => Effect::pure(set(d)?, set(d)?),
        "adiw" | "sbiw" => Effect::pure(pair(d?), pair(d?) | SHIFT),
        "mul" | "muls" => Effect::pure(set(d)? | set(s)?, pair(0) | C | Z),
        "bst" => Effect::pure(set(d)?, T),
        "bld" => Effect::pure(set(d)? | T, set(d)?),
        "nop" | "wdr" => Effect::acting(0, 0),
        "ld" | "ldd" | "lpm" | "elpm" => load(d?, second),
        "st" | "std" => store(first, set(s)?),
        "lds" => Effect::acting(0, set(d)?),
        "sts" | "push" => Effect::acting(set(s.or(d))?, 0),
        "pop" => Effect::acting(0, set(d)?),
        "in" if second == "63" => Effect::acting(FLAGS, set(d)?),
        "in" => Effect::acting(0, set(d)?),
        "out" if first == "63" => Effect::acting(set(s)?, FLAGS),
        "out" => Effect::acting(set(s)?, 0),
        "cli" | "sei" | "sbi" | "cbi" | "rjmp" => Effect::acting(0, 0),
        "sbrc" | "sbrs" => Effect::acting(set(d)?, 0),
        "sbic" | "sbis" => Effect::acting(0, 0),
        "cpse" => Effect::acting(set(d)? | set(s)?, 0),
        "call" => call(0),
        "eicall" => call(pair(30)),
        "ret" => Effect::acting(KEPT | RESULTS | bit(1), 0),
        "jmp" => Effect::acting(KEPT | ARGUMENTS | bit(1), 0),
        op => branch(op).and_then(|flag| Effect::acting(flag, 0)),
    }
}

/// Returns the flag that a branch tests.
pub fn branch(op: &str) -> Option<Set> {
    match op {
        "breq" | "brne" => Some(Z),
        "brlo" | "brsh" | "brcs" | "brcc" => Some(C),
        "brlt" | "brge" => Some(S),
        "brmi" | "brpl" => Some(N),
        "brvs" | "brvc" => Some(V),
        _ => None,
    }
}

fn call(besides: Set) -> Option<Effect> {
    let reads = ARGUMENTS | bit(1) | besides;
    Some(Effect { reads, writes: LOST | RESULTS, spoils: 0, acts: true })
}

fn load(into: u8, from: &str) -> Option<Effect> {
    let (base, offset) = place(from)?;
    let moved = if offset == "+" { pair(base) } else { 0 };
    Effect::acting(pair(base), bit(into) | moved)
}

fn store(to: &str, what: Set) -> Option<Effect> {
    let (base, offset) = place(to)?;
    let moved = if offset == "+" { pair(base) } else { 0 };
    Effect::acting(pair(base) | what, moved)
}
