//! Finds pairs of registers that differ by a constant: one address plus an offset.

use super::super::text::Insn;
use super::effect::{Set, operands, pair, register};
use super::flow::immediate;

/// A former value of a pair, plus a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sum {
    /// The pair, and the number of its values up to then.
    origin: (u8, u32),
    offset: u16,
}

impl Sum {
    /// Returns the sum plus a number.
    pub fn plus(self, number: u16) -> Sum {
        Sum { offset: self.offset.wrapping_add(number), ..self }
    }

    /// Returns the difference between two sums; `None` unless both are based on the same value.
    pub fn beyond(self, other: Sum) -> Option<i16> {
        (self.origin == other.origin).then(|| self.offset.wrapping_sub(other.offset).cast_signed())
    }
}

/// The sum that each pair holds.
#[derive(Clone, Debug)]
pub struct Offsets {
    sums: [Sum; 16],
    values: [u32; 16],
    /// The pair of which only one half has been added to so far.
    half: Option<u8>,
}

impl Default for Offsets {
    fn default() -> Offsets {
        let origin = |number| Sum { origin: (number as u8 * 2, 0), offset: 0 };
        Offsets { sums: std::array::from_fn(origin), values: [0; 16], half: None }
    }
}

impl Offsets {
    /// Returns the sum that a pair holds, by the number of its lower register.
    pub fn of(&self, low: u8) -> Sum {
        self.sums[usize::from(low / 2)]
    }

    /// Drops all facts.
    pub fn clear(&mut self) {
        (0..16).for_each(|at| self.renew(at));
    }

    /// Moves past an instruction that changes these registers; `then` is the instruction that runs next.
    pub fn pass(&mut self, insn: Option<&Insn>, then: Option<&Insn>, changes: Set) {
        if let Some(low) = self.half.take() {
            let ends =
                |insn: &Insn| insn.op == "sbci" && register(operands(insn).0) == Some(low + 1);
            if insn.is_some_and(ends) {
                return;
            }
            self.renew(usize::from(low / 2));
        }
        let known = insn.and_then(|insn| self.result(insn, then));
        for at in (0..16).filter(|at| changes & pair(*at as u8 * 2) != 0) {
            self.renew(at);
        }
        if let Some((low, sum)) = known {
            self.sums[usize::from(low / 2)] = sum;
            self.half = insn.filter(|insn| insn.op == "subi").map(|_| low);
        }
    }

    fn renew(&mut self, at: usize) {
        self.values[at] += 1;
        self.sums[at] = Sum { origin: (at as u8 * 2, self.values[at]), offset: 0 };
    }

    /// Returns the pair that gets a sum, and the sum. If two instructions add to a pair, it has the sum from the
    /// first one on.
    fn result(&self, insn: &Insn, then: Option<&Insn>) -> Option<(u8, Sum)> {
        let (first, second) = operands(insn);
        let d = register(first)?;
        match insn.op.as_str() {
            "movw" => Some((d, self.of(register(second)?))),
            "adiw" => Some((d, self.of(d).plus(immediate(second)?.into()))),
            "sbiw" => Some((d, self.of(d).plus(u16::from(immediate(second)?).wrapping_neg()))),
            "subi" => Some((d, self.of(d).plus(subtracted(insn, then?)?.wrapping_neg()))),
            _ => None,
        }
    }
}

/// Returns the number that two instructions subtract from a pair.
pub fn subtracted(low: &Insn, high: &Insn) -> Option<u16> {
    let ((a, number), (b, rest)) = (operands(low), operands(high));
    let (a, b) = (register(a)?, register(b)?);
    let is_pair = low.op == "subi" && high.op == "sbci" && a % 2 == 0 && b == a + 1;
    is_pair.then_some(())?;
    Some(u16::from_le_bytes([immediate(number)?, immediate(rest)?]))
}

#[cfg(test)]
mod tests {
    use super::super::effect;
    use super::*;

    fn after(code: &str) -> Offsets {
        let insns: Vec<Insn> = code.lines().map(Insn::new).collect();
        let mut offsets = Offsets::default();
        for (at, insn) in insns.iter().enumerate() {
            let changes = effect::of(insn).unwrap().changes();
            offsets.pass(Some(insn), insns.get(at + 1), changes);
        }
        offsets
    }

    #[test]
    fn an_offset_is_what_was_added() {
        for (code, beyond) in [
            ("movw r30, r24", Some(0)),
            ("movw r30, r24\nadiw r30, 5", Some(5)),
            ("movw r30, r24\nsubi r30, 80\nsbci r31, 255", Some(176)),
            ("movw r30, r24\nadiw r30, 5\nsbiw r30, 6", Some(-1)),
            ("movw r30, r24\nsubi r30, 80\nwdr", None),
            ("movw r30, r24\ninc r31", None),
            ("movw r30, r24\nadiw r24, 1", Some(-1)),
            ("movw r30, r24\nsubi r22, 1\nsbci r23, 0\nsbci r30, 0\nsbci r31, 0", None),
            ("wdr", None),
        ] {
            let offsets = after(code);
            assert_eq!(offsets.of(30).beyond(offsets.of(24)), beyond, "{code}");
        }
    }
}
