//! Rules for addresses: pointers that are near each other, and places far away in the frame.

use super::super::text::{Insn, Line};
use super::effect::{self, bit, operands, pair, register};
use super::flow::immediate;
use super::offsets::subtracted;
use super::rules::{Edit, Place};

impl Place<'_> {
    /// Removes a save and restore of flags that are dead.
    pub(super) fn kept(&self) -> Option<Edit> {
        let out = self.flow.restores[self.at]?;
        let kept = register(operands(self.insn).0)?;
        let is_quiet = |line: &&Line| matches!(line, Line::Insn(insn) if !matches!(insn.op.as_str(), "cli" | "sei"));
        let is_needed = self.needed[out] & (effect::FLAGS | bit(kept)) != 0;
        let is_ours = self.flow.lines[self.at..=out].iter().all(is_quiet);
        (is_ours && !is_needed).then(|| vec![(self.at, None), (out, None)])
    }

    /// Joins two successive additions to a pair, forth or back, into one.
    pub(super) fn moved(&self) -> Option<Edit> {
        let next = self.insn_at(self.at + 1)?;
        let way = |insn: &Insn| {
            let (first, second) = operands(insn);
            let number = i32::from(immediate(second)?);
            match insn.op.as_str() {
                "adiw" => Some((first.to_owned(), number)),
                "sbiw" => Some((first.to_owned(), -number)),
                _ => None,
            }
        };
        let ((pair, first), (other, second)) = (way(self.insn)?, way(next)?);
        let sum = first + second;
        let is_free = self.needed[self.at + 1] & effect::FLAGS == 0
            && !self.flow.may_be_skipped[self.at]
            && !self.flow.may_be_skipped[self.at + 1];
        if pair != other || !is_free || sum.abs() > 63 {
            return None;
        }
        Some(vec![(self.at, moving(&pair, sum)), (self.at + 1, None)])
    }

    /// Computes an address from another pair that is near it.
    ///
    /// ```text
    ///   movw r30, r24
    ///   subi r30, 80      becomes    adiw r30, 6
    ///   sbci r31, 255
    /// ```
    pub(super) fn near(&self) -> Option<Edit> {
        let (first, second) = operands(self.insn);
        let (d, s) = (register(first)?, register(second)?);
        let (low, high) = (self.insn_at(self.at + 1)?, self.insn_at(self.at + 2)?);
        let is_ours = self.insn.op == "movw" && register(operands(low).0) == Some(d);
        let free = |at: usize| !self.flow.may_be_skipped[at];
        let (number, last) = match low.op.as_str() {
            "subi" => (subtracted(low, high)?.wrapping_neg(), self.at + 2),
            "adiw" => (immediate(operands(low).1)?.into(), self.at + 1),
            _ => return None,
        };
        if !is_ours || !(self.at..=last).all(free) || self.needed[last] & effect::FLAGS != 0 {
            return None;
        }
        let wanted = self.local.offsets.of(s).plus(number);
        let gone = |from: usize| (from..=last).map(|at| (at, None));
        let step = |way: i16| moving(&format!("r{d}"), way.into());
        let way = |pair: u8| wanted.beyond(self.local.offsets.of(pair));
        let is_near = |way: &i16| *way == 0 || d >= 24 && way.abs() <= 63;
        if let Some(way) = way(d).filter(is_near) {
            return Some([(self.at, step(way))].into_iter().chain(gone(self.at + 1)).collect());
        }
        let others = (0..32).step_by(2).filter(|pair| *pair != d && *pair != s);
        // Two instructions replace three.
        let most = if last == self.at + 2 { 63 } else { 0 };
        let (pair, way) = others
            .filter_map(|pair| Some((pair, way(pair).filter(is_near)?)))
            .filter(|(_, way)| way.abs() <= most)
            .min_by_key(|(_, way)| way.abs())?;
        let copy = Insn::new(&format!("movw r{d}, r{pair}"));
        let edit = [(self.at, Some(copy)), (self.at + 1, step(way))];
        Some(edit.into_iter().chain(gone(self.at + 2)).collect())
    }

    /// Folds an addition to a pointer into the accesses through it.
    ///
    /// ```text
    ///   adiw r30, 6
    ///   ld   r24, Z       becomes    ldd r24, Z+6
    /// ```
    pub(super) fn fold(&self) -> Option<Edit> {
        let (first, second) = operands(self.insn);
        let d = register(first).filter(|d| *d == 30 && self.insn.op == "adiw")?;
        let number = i32::from(immediate(second)?);
        if self.needed[self.at] & effect::FLAGS != 0 || self.flow.may_be_skipped[self.at] {
            return None;
        }
        let mut edit = vec![(self.at, None)];
        for at in self.at + 1.. {
            let insn = self.insn_at(at)?;
            let effect = &self.flow.effects[at];
            if insn.is_jump() || insn.op.ends_with("call") || self.flow.may_be_skipped[at] {
                return None;
            }
            if (effect.reads | effect.changes()) & pair(d) != 0 {
                edit.push((at, Some(further(insn, number)?)));
            }
            if self.needed[at] & pair(d) == 0 {
                return Some(edit);
            }
            if effect.changes() & pair(d) != 0 {
                return None;
            }
        }
        None
    }
}

/// Returns an access by Z to a place further away; `None` if there is none.
fn further(insn: &Insn, number: i32) -> Option<Insn> {
    let (first, second) = operands(insn);
    let displaced = |operand: &str| {
        let offset = operand.strip_prefix("Z").filter(|offset| *offset != "+")?;
        let offset: i32 = if offset.is_empty() { 0 } else { offset.parse().ok()? };
        (0..=63).contains(&(offset + number)).then(|| format!("Z+{}", offset + number))
    };
    match insn.op.as_str() {
        "ld" | "ldd" => Some(Insn::new(&format!("ldd {first}, {}", displaced(second)?))),
        "st" | "std" if pointer_free(second) => {
            Some(Insn::new(&format!("std {}, {second}", displaced(first)?)))
        }
        _ => None,
    }
}

/// Whether an operand is a register that is no half of Z.
fn pointer_free(operand: &str) -> bool {
    register(operand).is_some_and(|register| register < 30)
}

/// Returns the instruction that moves a pair by a distance, at most 63 either way; `None` for 0.
fn moving(pair: &str, way: i32) -> Option<Insn> {
    let op = if way < 0 { "sbiw" } else { "adiw" };
    (way != 0).then(|| Insn::new(&format!("{op} {pair}, {}", way.abs())))
}
