//! A CPU model: runs a piece of a function and records its visible actions.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use super::super::text::{Insn, Line};
use super::copies::Copies;
use super::effect::{self, Effect, Set, bit, operands, register};
use super::flow::{Flow, Known, immediate};

/// Most steps of a piece. A piece that takes more never ends.
const STEPS: usize = 3_000;

/// All flags except the interrupt flag.
const FLAGS: u8 = (effect::FLAGS >> 32) as u8;

/// Where a piece ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// At a label.
    At(String),
    /// It left the function.
    Left,
    /// It did not end.
    Endless,
}

/// A CPU.
pub struct Run {
    seed: u64,
    registers: [u8; 32],
    /// The flags as in the bits of [`Set`], shifted by 32.
    flags: u8,
    /// Bytes written since unknown code last changed memory.
    memory: HashMap<u16, u8>,
    /// How often unknown code has changed memory.
    touched: u64,
    /// The actions that are visible outside.
    pub log: Vec<(String, Vec<u8>)>,
}

impl Run {
    /// Makes a CPU whose registers hold random values that agree with what is known. Two CPUs with the same `seed`
    /// find the same values in memory.
    pub fn new(seed: u64, registers: u64, (known, copies): (&Known, &Copies)) -> Run {
        let value = |number: usize| {
            let root = copies.root(number as u8);
            let same = (0..32).filter(|other| copies.root(*other) == root);
            let (zeros, ones) = same.fold((0, 0), |(zeros, ones), other| {
                let bits = known.bits(other);
                (zeros | bits.zeros, ones | bits.ones)
            });
            usual(hash(&(registers, root)), seed) & !zeros | ones
        };
        let flags = hash(&(registers, "flags")) & FLAGS;
        let (registers, memory) = (std::array::from_fn(value), HashMap::new());
        Run { seed, registers, flags, memory, touched: 0, log: Vec::new() }
    }

    /// Copies some registers and flags from another CPU.
    pub fn take(&mut self, other: &Run, parts: Set) {
        for number in (0..32).filter(|number| parts & bit(*number) != 0) {
            self.registers[usize::from(number)] = other.part(number);
        }
        let mask = (parts >> 32) as u8;
        self.flags = self.flags & !mask | other.flags & mask;
    }

    /// Returns a register, or a flag as 0 or 1.
    pub fn part(&self, part: u8) -> u8 {
        match part {
            0..32 => self.registers[usize::from(part)],
            _ => self.flags >> (part - 32) & 1,
        }
    }

    /// Runs up to a label where pieces end.
    pub fn run(&mut self, flow: &Flow, from: usize, stops: &HashMap<&str, ()>) -> End {
        let mut at = from;
        for step in 0..STEPS {
            let next = &flow.next[at];
            let line = flow.lines[at];
            if let Line::Label(label) = line
                && step > 0
                && stops.contains_key(label.as_str())
            {
                return End::At(label.clone());
            }
            let taken = match (line, flow.insn(at)) {
                (_, Some(insn)) => self.step(insn, &flow.effects[at]),
                (Line::Fixed(text), None) => {
                    let effect = &flow.effects[at];
                    self.note(text, effect.reads);
                    self.spoil(effect.changes() & !bit(1), text);
                    false
                }
                _ => false,
            };
            at = match next[..] {
                [] => return End::Left,
                [only] => only,
                // For a branch the first line is its destination, for a skip the second.
                [first, second, ..] => match line {
                    Line::Insn(insn) if insn.is_branch() == taken => first,
                    _ => second,
                },
            };
        }
        End::Endless
    }

    fn get(&self, register: u8) -> u8 {
        self.registers[usize::from(register)]
    }

    fn set(&mut self, register: u8, value: u8) {
        self.registers[usize::from(register)] = value;
    }

    fn word(&self, low: u8) -> u16 {
        u16::from_le_bytes([self.get(low), self.get(low + 1)])
    }

    fn set_word(&mut self, low: u8, value: u16) {
        let [a, b] = value.to_le_bytes();
        self.set(low, a);
        self.set(low + 1, b);
    }

    fn flag(&self, flag: Set) -> bool {
        self.flags & (flag >> 32) as u8 != 0
    }

    fn set_flag(&mut self, flag: Set, on: bool) {
        let mask = (flag >> 32) as u8;
        self.flags = if on { self.flags | mask } else { self.flags & !mask };
    }

    /// Records an action, and the registers that it depends on.
    fn note(&mut self, what: &str, parts: Set) {
        let mut values: Vec<u8> =
            (0..32).filter(|r| parts & bit(*r) != 0).map(|r| self.get(r)).collect();
        if parts & effect::FLAGS != 0 {
            values.push(self.flags & (parts >> 32) as u8);
        }
        self.log.push((what.into(), values));
    }

    /// Puts random values into registers.
    fn spoil(&mut self, parts: Set, why: &str) {
        let times = self.log.len();
        for r in (0..32).filter(|r| parts & bit(*r) != 0) {
            self.set(r, usual(hash(&(self.seed, times, why, r)), self.seed));
        }
        if parts & effect::FLAGS != 0 {
            self.flags = hash(&(self.seed, times, why)) & FLAGS;
        }
        self.memory.clear();
        self.touched += 1;
    }

    /// Executes an instruction. Returns whether its condition is true.
    fn step(&mut self, insn: &Insn, effect: &Effect) -> bool {
        let (first, second) = operands(insn);
        let (d, s) = (register(first), register(second));
        let op = insn.op.as_str();
        if let Some(flag) = effect::branch(op) {
            let on = self.flag(flag);
            return on == matches!(op, "breq" | "brlo" | "brcs" | "brlt" | "brmi" | "brvs");
        }
        match op {
            "sbrc" | "sbrs" => {
                let mask = 1 << second.parse::<u8>().unwrap_or(0);
                return (d.is_some_and(|d| self.get(d) & mask != 0)) == (op == "sbrc");
            }
            "cpse" => return d.map(|d| self.get(d)) != s.map(|s| self.get(s)),
            "sbic" | "sbis" => {
                self.note(&insn.args, 0);
                return hash(&(self.seed, self.log.len())) & 1 != 0;
            }
            _ => {}
        }
        match (op, d, s) {
            ("mov", Some(d), Some(s)) => self.set(d, self.get(s)),
            ("movw", Some(d), Some(s)) => self.set_word(d, self.word(s)),
            ("ldi", Some(d), _) => self.set(d, number(second)),
            ("adiw", Some(d), _) => self.add_word(d, u16::from(number(second)), false),
            ("sbiw", Some(d), _) => self.add_word(d, u16::from(number(second)), true),
            ("mul", Some(d), Some(s)) => {
                self.multiplied(u16::from(self.get(d)) * u16::from(self.get(s)))
            }
            ("muls", Some(d), Some(s)) => {
                let product =
                    i16::from(self.get(d).cast_signed()) * i16::from(self.get(s).cast_signed());
                self.multiplied(product.cast_unsigned());
            }
            ("bst", Some(d), _) => self.set_flag(effect::T, self.get(d) >> number(second) & 1 != 0),
            ("bld", Some(d), _) => {
                let mask = 1 << number(second);
                self.set(d, self.get(d) & !mask | if self.flag(effect::T) { mask } else { 0 });
            }
            ("swap", Some(d), _) => self.set(d, self.get(d).rotate_left(4)),
            ("ld" | "ldd" | "lpm" | "elpm", Some(d), _) => self.load(op, d, second),
            ("st" | "std", _, Some(s)) => self.store(first, s),
            ("lds", Some(d), _) => {
                let value = self.loaded("lds", address(second));
                self.set(d, value);
            }
            ("sts", _, Some(s)) => self.stored(address(first), s),
            ("pop", Some(d), _) => self.read(insn, d),
            ("in", Some(d), _) if second == "63" => self.set(d, self.flags),
            ("in", Some(d), _) => self.read(insn, d),
            ("out", _, Some(s)) if first == "63" => self.flags = self.get(s) & FLAGS,
            ("call" | "eicall", ..) => {
                self.note(&insn.args, effect.reads);
                self.spoil(effect.changes(), &insn.args);
            }
            ("rjmp", ..) => {}
            _ if !self.computed(op, d, s, second) => {
                let what = match s.or(d) {
                    Some(_) if s.is_some() => format!("{op} {first}"),
                    _ => format!("{op} {}", if d.is_some() { "" } else { &insn.args }),
                };
                self.note(&what, effect.reads);
            }
            _ => {}
        }
        false
    }

    fn read(&mut self, insn: &Insn, d: u8) {
        let (_, place) = operands(insn);
        self.note(&format!("{} {place}", insn.op), 0);
        self.set(d, usual(hash(&(self.seed, self.log.len(), place)), self.seed));
    }

    fn load(&mut self, op: &str, d: u8, from: &str) {
        let Some((base, offset)) = effect::place(from) else { return };
        let pointer = self.word(base);
        let address = pointer.wrapping_add(offset.trim_start_matches('+').parse().unwrap_or(0));
        // Reads of the frame are not recorded, because they are invisible outside.
        let times = self.log.len();
        let value = self.loaded(op, address);
        if base == 28 {
            self.log.truncate(times);
        }
        if offset == "+" {
            self.set_word(base, pointer.wrapping_add(1));
        }
        self.set(d, value);
    }

    /// Returns the byte in memory or in flash.
    fn loaded(&mut self, op: &str, address: u16) -> u8 {
        let is_flash = op.ends_with("pm");
        let found = self.memory.get(&address).copied().filter(|_| !is_flash);
        let value = found.unwrap_or_else(|| {
            usual(hash(&(self.seed, self.touched, address, is_flash)), self.seed)
        });
        let kind = if is_flash { op } else { "ld" };
        self.log.push((kind.into(), address.to_le_bytes().to_vec()));
        value
    }

    fn store(&mut self, to: &str, s: u8) {
        let Some((base, offset)) = effect::place(to) else { return };
        let pointer = self.word(base);
        self.stored(pointer.wrapping_add(offset.trim_start_matches('+').parse().unwrap_or(0)), s);
        if offset == "+" {
            self.set_word(base, pointer.wrapping_add(1));
        }
    }

    fn stored(&mut self, address: u16, s: u8) {
        let value = self.get(s);
        let [low, high] = address.to_le_bytes();
        self.log.push(("st".into(), vec![low, high, value]));
        self.memory.insert(address, value);
    }

    fn multiplied(&mut self, product: u16) {
        self.set_word(0, product);
        self.set_flag(effect::C, product & 0x8000 != 0);
        self.set_flag(effect::Z, product == 0);
    }

    fn add_word(&mut self, d: u8, number: u16, down: bool) {
        let before = self.word(d);
        let after = if down { before.wrapping_sub(number) } else { before.wrapping_add(number) };
        self.set_word(d, after);
        let (was, is) = (before & 0x8000 != 0, after & 0x8000 != 0);
        let (gone, come) = (was && !is, !was && is);
        self.set_flag(effect::V, if down { gone } else { come });
        self.set_flag(effect::C, if down { come } else { gone });
        self.set_flag(effect::Z, after == 0);
        self.sign(is);
    }

    /// Sets N, and S, which follows from N and V.
    fn sign(&mut self, negative: bool) {
        self.set_flag(effect::N, negative);
        self.set_flag(effect::S, negative != self.flag(effect::V));
    }

    /// Executes arithmetic and logic of one byte. Returns false for other instructions.
    fn computed(&mut self, op: &str, d: Option<u8>, s: Option<u8>, second: &str) -> bool {
        let Some(d) = d else { return false };
        let a = self.get(d);
        let b = s.map_or_else(|| number(second), |s| self.get(s));
        let carry = u8::from(self.flag(effect::C));
        match op {
            "add" | "adc" | "lsl" | "rol" => {
                let b = if matches!(op, "lsl" | "rol") { a } else { b };
                let carry = if matches!(op, "adc" | "rol") { carry } else { 0 };
                self.sum(d, a, b, carry);
            }
            "sub" | "subi" | "cp" | "cpi" => {
                self.difference(d, a, b, 0, false, op.starts_with('c'))
            }
            "sbc" | "sbci" | "cpc" => self.difference(d, a, b, carry, true, op == "cpc"),
            "neg" => self.difference(d, 0, a, 0, false, false),
            "and" | "andi" => self.logic(d, a & b),
            "or" | "ori" => self.logic(d, a | b),
            "eor" => self.logic(d, a ^ b),
            "tst" => self.logic(d, a),
            "clr" => self.logic(d, 0),
            "com" => {
                self.logic(d, !a);
                self.set_flag(effect::C, true);
            }
            "inc" | "dec" => {
                let result = if op == "inc" { a.wrapping_add(1) } else { a.wrapping_sub(1) };
                self.logic(d, result);
                self.set_flag(effect::V, if op == "inc" { a == 0x7F } else { a == 0x80 });
                self.sign(result & 0x80 != 0);
            }
            "lsr" | "asr" | "ror" => {
                let top = match op {
                    "lsr" => 0,
                    "asr" => a & 0x80,
                    _ => carry << 7,
                };
                let result = a >> 1 | top;
                self.logic(d, result);
                self.set_flag(effect::C, a & 1 != 0);
                self.set_flag(effect::V, (result & 0x80 != 0) != (a & 1 != 0));
                self.sign(result & 0x80 != 0);
            }
            _ => return false,
        }
        true
    }

    fn logic(&mut self, d: u8, result: u8) {
        self.set(d, result);
        self.set_flag(effect::V, false);
        self.set_flag(effect::Z, result == 0);
        self.sign(result & 0x80 != 0);
    }

    fn sum(&mut self, d: u8, a: u8, b: u8, carry: u8) {
        let result = a.wrapping_add(b).wrapping_add(carry);
        let carries = a & b | (a | b) & !result;
        self.set_flag(effect::C, carries & 0x80 != 0);
        self.set_flag(effect::H, carries & 0x08 != 0);
        self.set_flag(effect::V, (a ^ result) & (b ^ result) & 0x80 != 0);
        self.set_flag(effect::Z, result == 0);
        self.sign(result & 0x80 != 0);
        self.set(d, result);
    }

    fn difference(&mut self, d: u8, a: u8, b: u8, carry: u8, goes_on: bool, compares: bool) {
        let result = a.wrapping_sub(b).wrapping_sub(carry);
        let borrows = !a & b | (!a | b) & result;
        self.set_flag(effect::C, borrows & 0x80 != 0);
        self.set_flag(effect::H, borrows & 0x08 != 0);
        self.set_flag(effect::V, (a ^ b) & (a ^ result) & 0x80 != 0);
        let was_zero = self.flag(effect::Z) || !goes_on;
        self.set_flag(effect::Z, result == 0 && was_zero);
        self.sign(result & 0x80 != 0);
        if !compares {
            self.set(d, result);
        }
    }
}

/// Returns the value of an operand; for an address any value, but always the same.
fn number(operand: &str) -> u8 {
    let inside = |half: &str| {
        operand.strip_prefix(half)?.strip_suffix(')').filter(|inside| !inside.contains('('))
    };
    let [low, high] = ["lo8(", "hi8("].map(|half| inside(half).map(address));
    match (low, high) {
        (Some(address), _) => address.to_le_bytes()[0],
        (_, Some(address)) => address.to_le_bytes()[1],
        _ => immediate(operand).unwrap_or_else(|| hash(&operand)),
    }
}

/// Returns an address: a number, or the address of a variable, which is arbitrary but fixed, plus an offset.
fn address(text: &str) -> u16 {
    let (symbol, offset) = text.split_once('+').unwrap_or((text, "0"));
    let base =
        symbol.parse().unwrap_or_else(|_| u16::from_le_bytes([hash(&symbol), hash(&(symbol, 1))]));
    base.wrapping_add(offset.parse().unwrap_or_else(|_| hash(&offset).into()))
}

fn hash(what: &impl Hash) -> u8 {
    let mut hasher = DefaultHasher::new();
    what.hash(&mut hasher);
    hasher.finish() as u8
}

/// Returns a test value for a run: as often near the ends of the range as elsewhere, or 0 or 1, or one of two.
fn usual(random: u8, seed: u64) -> u8 {
    const ENDS: [u8; 8] = [0, 1, 2, 0x7F, 0x80, 0x81, 0xFE, 0xFF];
    match seed % 3 {
        0 if random & 1 == 0 => ENDS[usize::from(random >> 1 & 7)],
        0 => random.rotate_left(3),
        1 => random & 1,
        _ => hash(&seed) ^ random & 0x80,
    }
}
