//! Global copy analysis: finds registers with equal values on every path.

use super::super::text::{Insn, Line};
use super::effect::{Effect, Set, bit, operands, pair, register};
use super::flow::Flow;

/// For each register: the register that represents all registers with the same value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Copies {
    roots: [u8; 32],
}

impl Default for Copies {
    /// No two registers are known to hold the same value.
    fn default() -> Copies {
        Copies { roots: std::array::from_fn(|register| register as u8) }
    }
}

impl Copies {
    /// Returns the facts that hold before each line on every path to it.
    pub fn of(flow: &Flow) -> Vec<Copies> {
        let mut before: Vec<Option<Copies>> = vec![None; flow.lines.len()];
        let mut open = Vec::new();
        if let Some(first) = before.first_mut() {
            *first = Some(Copies::default());
            open.push(0);
        }
        while let Some(at) = open.pop() {
            let Some(copies) = before[at] else { continue };
            let mut behind = copies.behind(flow.lines[at], flow.insn(at), &flow.effects[at]);
            if flow.may_be_skipped[at] {
                behind = behind.and(&copies);
            }
            for to in &flow.next[at] {
                let joined = before[*to].map_or(behind, |old| old.and(&behind));
                if before[*to] != Some(joined) {
                    before[*to] = Some(joined);
                    open.push(*to);
                }
            }
        }
        before.into_iter().map(Option::unwrap_or_default).collect()
    }

    /// Returns the register that represents all registers with the same value as this one.
    pub fn root(&self, register: u8) -> u8 {
        self.roots[usize::from(register)]
    }

    /// Returns the facts that hold in both (the meet of the analysis).
    fn and(&self, other: &Copies) -> Copies {
        let mut both = Copies::default();
        for register in 0..32 {
            let same = |first: &u8| {
                self.root(*first) == self.root(register)
                    && other.root(*first) == other.root(register)
            };
            both.roots[usize::from(register)] = (0..register).find(same).unwrap_or(register);
        }
        both
    }

    fn behind(&self, line: &Line, insn: Option<&Insn>, effect: &Effect) -> Copies {
        let mut behind = *self;
        if insn.is_none() && matches!(line, Line::Fixed(_)) {
            return Copies::default();
        }
        let Some((insn, changes)) = insn.map(|insn| (insn, effect.changes())) else {
            return behind;
        };
        (0..32).filter(|register| changes & bit(*register) != 0).for_each(|r| behind.forget(r));
        let (first, second) = operands(insn);
        let (Some(d), Some(s)) = (register(first), register(second)) else { return behind };
        let copied: &[(u8, u8)] = match insn.op.as_str() {
            "mov" => &[(d, s)],
            "movw" => &[(d, s), (d + 1, s + 1)],
            _ => return behind,
        };
        let written: Set = if copied.len() == 1 { bit(d) } else { pair(d) };
        for (d, s) in copied.iter().filter(|(_, s)| written & bit(*s) == 0) {
            behind.roots[usize::from(*d)] = behind.root(*s);
        }
        behind
    }

    /// Records that a register gets another value. One of the other registers now represents the group that it
    /// represented.
    fn forget(&mut self, register: u8) {
        self.roots[usize::from(register)] = register;
        let next =
            (0..32).find(|other| *other != register && self.roots[usize::from(*other)] == register);
        let Some(next) = next else { return };
        for (other, root) in self.roots.iter_mut().enumerate() {
            if *root == register && other != usize::from(register) {
                *root = next;
            }
        }
    }
}
