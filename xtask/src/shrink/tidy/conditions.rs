//! Rules for conditions: redundant comparisons, and branches on a 0 or 1 that was made from a condition.

use super::super::text::Insn;
use super::super::text::Line;
use super::effect::{self, Set, bit, operands, register};
use super::flow::immediate;
use super::rules::{Edit, Place};

impl Place<'_> {
    /// Removes a comparison of a register with 0 if computing its value has set the same flags.
    pub(super) fn compare(&self) -> Option<Edit> {
        let d = self.tested()?;
        let needed = self.needed[self.at] & effect::FLAGS;
        for before in (0..self.at).rev() {
            let insn = self.insn_at(before)?;
            let effect = &self.flow.effects[before];
            if self.flow.may_be_skipped[before] || insn.is_jump() {
                return None;
            }
            if effect.changes() & (bit(d) | effect::FLAGS) == 0 {
                continue;
            }
            let alike = match insn.op.as_str() {
                "and" | "andi" | "or" | "ori" | "eor" => {
                    effect::Z | effect::N | effect::V | effect::S
                }
                "add" | "adc" | "sub" | "subi" | "neg" | "inc" | "dec" | "lsl" | "rol" | "lsr"
                | "asr" | "ror" | "com" => effect::Z | effect::N,
                _ => return None,
            };
            let is_result = register(operands(insn).0) == Some(d);
            return (is_result && needed & !alike == 0).then(|| self.gone())?;
        }
        None
    }

    /// Returns the register that is compared with 0 here.
    pub(super) fn tested(&self) -> Option<u8> {
        let (first, second) = operands(self.insn);
        let is_test = match self.insn.op.as_str() {
            "cpi" => second == "0",
            "cp" => second == "r1" && self.known().value(1) == Some(0),
            "tst" => true,
            "and" => first == second,
            _ => false,
        };
        is_test.then(|| register(first))?
    }

    /// Compares a pair with 0 in one instruction instead of byte by byte.
    pub(super) fn word(&self) -> Option<Edit> {
        let high = self.insn_at(self.at + 1)?;
        let of = |insn: &Insn, op: &str| {
            let (first, second) = operands(insn);
            register(first).filter(|_| insn.op == op && second == "r1")
        };
        let (low, high) = (of(self.insn, "cp")?, of(high, "cpc")?);
        let is_zero = self.known().value(1) == Some(0);
        if !is_zero || low == 1 || high == 1 || self.flow.may_be_skipped[self.at + 1] {
            return None;
        }
        let needed = self.needed[self.at + 1];
        let only_zero = needed & effect::FLAGS & !effect::Z == 0;
        let insn = if only_zero && needed & bit(low) == 0 {
            format!("or r{low}, r{high}")
        } else if only_zero && needed & bit(high) == 0 {
            format!("or r{high}, r{low}")
        } else if needed & effect::H == 0 && low >= 24 && low % 2 == 0 && high == low + 1 {
            format!("sbiw r{low}, 0")
        } else {
            return None;
        };
        Some(vec![(self.at, Some(Insn::new(&insn))), (self.at + 1, None)])
    }

    /// Branches directly on a condition, instead of on a 0 or 1 that is made from it.
    ///
    /// ```text
    ///   ldi  r24, 1
    ///   brlt .L1
    ///   mov  r24, r1     becomes  brge .L2
    /// .L1:
    ///   andi r24, 1
    ///   breq .L2
    /// ```
    pub(super) fn truth(&self) -> Option<Edit> {
        effect::branch(&self.insn.op)?;
        let set = self.insn_at(self.at + 1)?;
        let (first, second) = operands(set);
        let x = register(first)?;
        let if_not = match set.op.as_str() {
            "mov" => self.known[self.at + 1].value(register(second)?)?,
            "ldi" => immediate(second)?,
            _ => return None,
        };
        let if_so = self.known().value(x)?;
        let mut edit = vec![(self.at, None), (self.at + 1, None)];
        let mut at = self.at + 2;
        let mut seen = false;
        while let Line::Label(label) = self.flow.lines.get(at)? {
            seen |= *label == self.insn.args;
            if (self.calls)(label) != usize::from(*label == self.insn.args) {
                return None;
            }
            edit.push((at, None));
            at += 1;
        }
        let mut mask = u8::MAX;
        let mut tests = false;
        loop {
            let insn = self.insn_at(at)?;
            let effect = &self.flow.effects[at];
            let (first, second) = operands(insn);
            match insn.op.as_str() {
                "andi" if register(first) == Some(x) => {
                    mask &= immediate(second)?;
                    tests = true;
                    edit.push((at, None));
                }
                "cpi" if register(first) == Some(x) && second == "0" => {
                    tests = true;
                    edit.push((at, None));
                }
                "tst" if register(first) == Some(x) => {
                    tests = true;
                    edit.push((at, None));
                }
                "breq" | "brne" => break,
                _ if insn.is_jump()
                    || (effect.reads | effect.changes()) & (bit(x) | effect::FLAGS) != 0 =>
                {
                    return None;
                }
                _ => {}
            }
            at += 1;
        }
        let branch = self.insn_at(at)?;
        let is_masked = if_so & mask != if_so;
        let (if_so, if_not) = (if_so & mask != 0, if_not & mask != 0);
        let on_so = (branch.op == "brne") == if_so;
        let (there, here) =
            (*self.flow.labels.get(branch.args.as_str())?, self.flow.skip_labels(at + 1));
        let (so, not) = if on_so { (there, here) } else { (here, there) };
        let is_needed = |at: usize, what: Set| self.flow.needed_before(at, self.needed) & what != 0;
        // Where the condition is true the register already holds the right value.
        let is_free = self.needed[at] & effect::FLAGS == 0
            && !is_needed(not, bit(x))
            && !(is_masked && is_needed(so, bit(x)));
        if !seen || !tests || !is_free || if_so == if_not {
            return None;
        }
        let op = if on_so {
            self.insn.op.as_str()
        } else {
            super::super::branch::inverse(&self.insn.op)?
        };
        edit.push((at, Some(Insn { op: op.into(), args: branch.args.clone() })));
        Some(edit)
    }
}
