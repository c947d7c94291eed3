//! Peephole rules: code that can be removed or replaced.
//!
//! A rule examines one line with the facts that hold there, and returns the lines to change. Each rule is valid
//! independently: only one is applied between two labels before all facts are computed again.

use super::super::text::{Insn, Line};
use super::effect::{self, Set, bit, operands, pair, register};
use super::flow::{Flow, Known, immediate};
use super::local::Local;

/// Lines of a [`Flow`], and their replacements; `None` removes a line.
pub type Edit = Vec<(usize, Option<Insn>)>;

/// A line of a function, and the facts that hold there.
pub struct Place<'a> {
    pub flow: &'a Flow<'a>,
    /// The registers and flags that are live after each line.
    pub needed: &'a [Set],
    pub known: &'a [Known],
    pub local: &'a Local,
    /// Returns how many jumps and branches go to a label.
    pub calls: &'a dyn Fn(&str) -> usize,
    pub at: usize,
    pub insn: &'a Insn,
}

impl Place<'_> {
    pub fn edit(&self) -> Option<Edit> {
        let rules = [
            Self::dead,
            Self::mask,
            Self::again,
            Self::compare,
            Self::word,
            Self::truth,
            Self::copies,
            Self::zero,
            Self::neutral,
            Self::kept,
            Self::moved,
            Self::near,
            Self::fold,
            Self::pairs,
            Self::reload,
            Self::origin,
            Self::thread,
        ];
        rules.iter().find_map(|rule| rule(self))
    }

    pub(super) fn insn_at(&self, at: usize) -> Option<&Insn> {
        match self.flow.lines.get(at)? {
            Line::Insn(insn) => Some(insn),
            _ => None,
        }
    }

    pub(super) fn gone(&self) -> Option<Edit> {
        Some(vec![(self.at, None)])
    }

    pub(super) fn becomes(&self, insn: Insn) -> Option<Edit> {
        (insn != *self.insn).then(|| vec![(self.at, Some(insn))])
    }

    pub(super) fn known(&self) -> &Known {
        &self.known[self.at]
    }

    /// Dead code elimination: removes an instruction whose result is not read.
    fn dead(&self) -> Option<Edit> {
        let effect = &self.flow.effects[self.at];
        let is_dead = !effect.acts && effect.changes() & self.needed[self.at] == 0;
        let reads_frame = self.local.has_frame
            && self.insn.op == "ldd"
            && self.insn.args.contains("Y+")
            && effect.writes & self.needed[self.at] == 0;
        (is_dead || reads_frame).then(|| self.gone())?
    }

    /// Removes a mask of bits that are 0 already.
    fn mask(&self) -> Option<Edit> {
        let (first, second) = operands(self.insn);
        if self.insn.op != "andi"
            || effect::FLAGS & self.flow.effects[self.at].writes & self.needed[self.at] != 0
        {
            return None;
        }
        let mask = immediate(second)?;
        (self.known().bits(register(first)?).zeros | mask == u8::MAX).then(|| self.gone())?
    }

    /// Removes a redundant copy.
    fn again(&self) -> Option<Edit> {
        let (first, second) = operands(self.insn);
        let (d, s) = (register(first)?, register(second)?);
        let again = match self.insn.op.as_str() {
            "mov" => self.local.are_equal(d, s),
            "movw" => self.local.are_equal(d, s) && self.local.are_equal(d + 1, s + 1),
            _ => false,
        };
        again.then(|| self.gone())?
    }

    /// Removes an instruction that gives a register the value that it has.
    ///
    /// The code that gave it the value may be anywhere before, and may be live only because of this instruction. So
    /// nothing else may be removed in one step with it.
    pub fn constant(&self) -> Option<Edit> {
        let (first, second) = operands(self.insn);
        let d = register(first)?;
        let value = |r: u8| self.known().value(r);
        let are_equal = |d: u8, s: u8| value(d).is_some() && value(d) == value(s);
        let again = match self.insn.op.as_str() {
            "ldi" => immediate(second).is_some_and(|number| value(d) == Some(number)),
            "mov" => are_equal(d, register(second)?),
            "movw" => are_equal(d, register(second)?) && are_equal(d + 1, register(second)? + 1),
            _ => false,
        };
        if again { self.gone() } else { self.constant_pair() }
    }

    /// Replaces two instructions that give a pair, byte by byte, the values of another pair.
    fn constant_pair(&self) -> Option<Edit> {
        let value = |at: usize| {
            let insn = self.insn_at(at)?;
            let (first, second) = operands(insn);
            let is_free = !self.flow.may_be_skipped[at];
            let value = match insn.op.as_str() {
                "ldi" => immediate(second)?,
                "mov" => self.known[at].value(register(second)?)?,
                _ => return None,
            };
            is_free.then_some((register(first)?, value))
        };
        let (a, b) = (value(self.at)?, value(self.at + 1)?);
        let (low, high) = if a.0 < b.0 { (a, b) } else { (b, a) };
        if low.0 % 2 != 0 || high.0 != low.0 + 1 {
            return None;
        }
        let holds = |pair: &u8| {
            let value = |register| self.known().value(register);
            *pair != low.0 && value(*pair) == Some(low.1) && value(*pair + 1) == Some(high.1)
        };
        let pair = (0..32).step_by(2).find(holds)?;
        let copy = Insn::new(&format!("movw r{}, r{pair}", low.0));
        Some(vec![(self.at, Some(copy)), (self.at + 1, None)])
    }

    /// Copy propagation: removes a redundant copy, or reads the original, by the facts that hold on every path to this
    /// line.
    ///
    /// As with a [`constant`](Self::constant), nothing else may be removed in one step with it.
    pub fn copy(&self) -> Option<Edit> {
        self.again().or_else(|| self.copies())
    }

    /// Reads the original instead of a copy.
    fn copies(&self) -> Option<Edit> {
        let (first, second) = operands(self.insn);
        let original = |operand: &str| register(operand).and_then(|copy| self.local.original(copy));
        let op = self.insn.op.as_str();
        let mut insn = self.insn.clone();
        if op == "movw" {
            let s = register(second)?;
            let (low, high) = (self.local.original(s)?, self.local.original(s + 1)?);
            if low % 2 == 0 && high == low + 1 {
                insn.args = format!("{first}, r{low}");
                return self.becomes(insn);
            }
            return None;
        }
        let mut args = (first.to_owned(), second.to_owned());
        if let Some(s) = original(second).filter(|_| reads_second(op)) {
            args.1 = format!("r{s}");
        }
        if let Some(d) = original(first).filter(|_| matches!(op, "cp" | "cpc" | "push" | "tst")) {
            args.0 = format!("r{d}");
        }
        if args.0 == args.1 && first != second {
            return None;
        }
        insn.args = if second.is_empty() { args.0 } else { format!("{}, {}", args.0, args.1) };
        self.becomes(insn)
    }

    /// Reads register 1, which is 0, instead of another 0.
    fn zero(&self) -> Option<Edit> {
        let (first, second) = operands(self.insn);
        let op = self.insn.op.as_str();
        if self.known().value(1) != Some(0) {
            return None;
        }
        let is_zero = |operand: &str| {
            register(operand).is_some_and(|r| r != 1 && self.known().value(r) == Some(0))
        };
        let mut args = (first, second);
        if is_zero(second) && reads_second(op) {
            args.1 = "r1";
        }
        if is_zero(first) && matches!(op, "cp" | "cpc") && args.1 != "r1" {
            args.0 = "r1";
        }
        if first == second || args == (first, second) {
            return None;
        }
        self.becomes(Insn { op: op.into(), args: format!("{}, {}", args.0, args.1) })
    }

    /// Removes an addition of 0, or replaces an addition to 0 by a copy.
    fn neutral(&self) -> Option<Edit> {
        let (first, second) = operands(self.insn);
        let (d, s) = (register(first)?, register(second)?);
        let joins = matches!(self.insn.op.as_str(), "or" | "eor" | "add");
        if !joins || d == s || self.needed[self.at] & effect::FLAGS != 0 {
            return None;
        }
        let is_zero = |register: u8| self.known().value(register) == Some(0);
        if is_zero(s) {
            return self.gone();
        }
        if is_zero(d) { self.becomes(Insn::new(&format!("mov r{d}, r{s}"))) } else { None }
    }

    /// Copies a pair in one instruction instead of byte by byte.
    fn pairs(&self) -> Option<Edit> {
        let other = self.insn_at(self.at + 1)?;
        let copied = |insn: &Insn| {
            let (first, second) = operands(insn);
            (insn.op == "mov").then_some((register(first)?, register(second)?))
        };
        let (a, b) = (copied(self.insn)?, copied(other)?);
        let (low, high) = if a.0 < b.0 { (a, b) } else { (b, a) };
        let is_pair = low.0 % 2 == 0 && low.1 % 2 == 0 && high == (low.0 + 1, low.1 + 1);
        let is_free = !self.flow.may_be_skipped[self.at] && !self.flow.may_be_skipped[self.at + 1];
        let whole = Insn::new(&format!("movw r{}, r{}", low.0, low.1));
        (is_pair && is_free).then(|| vec![(self.at, Some(whole)), (self.at + 1, None)])
    }

    /// Replaces a load from the frame by a register that holds the value.
    fn reload(&self) -> Option<Edit> {
        let (first, second) = operands(self.insn);
        let d = register(first)?;
        let held = self.local.held(self.insn.op == "ldd", second)?;
        if held == d {
            return self.gone();
        }
        self.becomes(Insn::new(&format!("mov r{d}, r{held}")))
    }

    /// Copy coalescing: computes a value directly in the register to which it is copied.
    fn origin(&self) -> Option<Edit> {
        let (first, second) = operands(self.insn);
        let (d, s) = (register(first)?, register(second)?);
        let (to, from) = match self.insn.op.as_str() {
            "mov" => (bit(d), bit(s)),
            "movw" => (pair(d), pair(s)),
            _ => return None,
        };
        if self.needed[self.at] & from != 0 || to & from != 0 {
            return None;
        }
        let mut edit = vec![(self.at, None)];
        let mut open = from;
        for at in (0..self.at).rev() {
            let insn = self.insn_at(at)?;
            let effect = &self.flow.effects[at];
            let touched = effect.reads | effect.changes();
            let odd = self.flow.may_be_skipped[at]
                || insn.is_jump()
                || insn.op == "call"
                || effect.spoils != 0;
            if odd || touched & to != 0 || touched & (from & !open) != 0 {
                return None;
            }
            if touched & from == 0 {
                continue;
            }
            edit.push((at, Some(renamed(insn, from, d, s)?)));
            if effect.reads & from == 0 {
                open &= !effect.writes;
            }
            if open == 0 {
                return Some(edit);
            }
        }
        None
    }

    /// Jump threading: replaces a jump to a jump.
    fn thread(&self) -> Option<Edit> {
        if self.insn.op != "rjmp" {
            return None;
        }
        let mut at = *self.flow.labels.get(self.insn.args.as_str())?;
        while let Line::Label(_) = self.flow.lines.get(at)? {
            at += 1;
        }
        let insn = self.insn_at(at)?;
        let goes_on = insn.op == "rjmp" && insn.args != self.insn.args;
        (at != self.at && (goes_on || insn.op == "ret")).then(|| self.becomes(insn.clone()))?
    }
}

/// Whether an instruction only reads its second operand, and accepts any register there.
fn reads_second(op: &str) -> bool {
    matches!(
        op,
        "mov"
            | "add"
            | "adc"
            | "sub"
            | "sbc"
            | "cp"
            | "cpc"
            | "and"
            | "or"
            | "eor"
            | "st"
            | "std"
            | "sts"
            | "out"
            | "mul"
    )
}

/// Returns an instruction with other registers; `None` if it may not have them.
fn renamed(insn: &Insn, from: Set, to: u8, was: u8) -> Option<Insn> {
    let (first, second) = operands(insn);
    let other = |operand: &str| match register(operand) {
        Some(r) if bit(r) & from != 0 => Some(to + (r - was)),
        _ => None,
    };
    let (d, s) = (other(first), other(second));
    let op = insn.op.as_str();
    let upper = matches!(op, "ldi" | "cpi" | "subi" | "sbci" | "andi" | "ori");
    let allowed = match op {
        _ if upper => d.is_some_and(|d| d >= 16),
        "adiw" | "sbiw" => d.is_some_and(|d| d >= 24 && d % 2 == 0),
        "movw" => d.is_none_or(|d| d % 2 == 0) && s.is_none_or(|s| s % 2 == 0),
        "muls" => d.is_none_or(|d| d >= 16) && s.is_none_or(|s| s >= 16),
        "mov" | "add" | "adc" | "sub" | "sbc" | "cp" | "cpc" | "and" | "or" | "eor" | "com"
        | "neg" | "inc" | "dec" | "lsl" | "rol" | "lsr" | "asr" | "ror" | "swap" | "tst"
        | "clr" | "mul" | "lds" | "in" => true,
        // A pointer must not change.
        "ld" | "ldd" => d.is_some() && pointer(second) & from == 0,
        "st" | "std" => s.is_some() && pointer(first) & from == 0,
        "sts" | "out" => true,
        _ => false,
    };
    // A pair can only be renamed as a whole.
    let halves = matches!(op, "adiw" | "sbiw" | "movw") && from.count_ones() == 1;
    if !allowed || halves || (d.is_none() && s.is_none()) {
        return None;
    }
    let name = |new: Option<u8>, old: &str| new.map_or_else(|| old.to_owned(), |r| format!("r{r}"));
    let args = if second.is_empty() {
        name(d, first)
    } else {
        format!("{}, {}", name(d, first), name(s, second))
    };
    Some(Insn { op: op.into(), args })
}

fn pointer(operand: &str) -> Set {
    effect::place(operand).map_or(0, |(base, _)| pair(base))
}
