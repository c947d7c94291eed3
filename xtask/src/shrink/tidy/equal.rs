//! Checks that two versions of a function are equivalent, by running both with random values.
//!
//! Both run from each common label to the next, from registers with random values. They must make equal memory accesses
//! and calls, and arrive at one label with equal values in all live registers. This also tests the results of
//! [`super::flow`]: registers that it finds dead get different values in the two, and the values on arrival must match
//! its facts.

use std::collections::HashMap;

use anyhow::{Context, Result, bail, ensure};

use super::super::text::{Function, Line};
use super::copies::Copies;
use super::effect::{self, Set, bit};
use super::flow::{Flow, Known};
use super::needs::Needs;
use super::run::{End, Run};

/// How often each piece is run.
const TRIALS: u64 = 12;

/// Fails if the last of several versions of a function is not equivalent to the first.
///
/// A fact about a version may follow from an earlier change. So where the last version does not match the first, the
/// versions between them are compared, too.
pub fn check(versions: &[Function], needs: &Needs) -> Result<()> {
    let [first, .., last] = versions else { return Ok(()) };
    let refused = match function(first, last, needs) {
        Ok(()) => return Ok(()),
        Err(refused) => refused.context(format!("in {}", first.name)),
    };
    if versions.len() == 2 {
        return Err(refused);
    }
    let middle = versions.len() / 2;
    check(&versions[..=middle], needs)?;
    check(&versions[middle..], needs)
}

fn function(old: &Function, new: &Function, needs: &Needs) -> Result<()> {
    let (Some(old), Some(new)) = (Flow::of(old, needs), Flow::of(new, needs)) else {
        bail!("it goes where nobody knows");
    };
    let pieces = Pieces {
        stops: stops(&new),
        needed: new.needed(),
        known: old.known(),
        copies: Copies::of(&old),
        old,
        new,
    };
    pieces.piece(None)?;
    for label in pieces.new.labels.keys() {
        pieces.piece(Some(label)).with_context(|| format!("from {label}"))?;
    }
    Ok(())
}

/// Returns the labels where a piece ends: those that do not lead straight on.
fn stops<'a>(flow: &Flow<'a>) -> HashMap<&'a str, ()> {
    let leads_on = |at: usize| {
        let insn = flow.lines[at..].iter().find(|line| !matches!(line, Line::Label(_)));
        matches!(insn, Some(Line::Insn(insn)) if insn.op == "rjmp" || insn.op == "ret")
    };
    flow.labels.iter().filter(|(_, at)| !leads_on(**at)).map(|(label, _)| (*label, ())).collect()
}

struct Pieces<'a> {
    old: Flow<'a>,
    new: Flow<'a>,
    stops: HashMap<&'a str, ()>,
    /// For each line of the new function: the registers and flags that are live after it.
    needed: Vec<Set>,
    /// For each line of the old function: the known bits before it.
    known: Vec<Known>,
    /// For each line of the old function: which registers hold the same value before it.
    copies: Vec<Copies>,
}

impl Pieces<'_> {
    fn piece(&self, label: Option<&str>) -> Result<()> {
        let place = |flow: &Flow| label.map_or(Some(0), |label| flow.labels.get(label).copied());
        let (from, to) = (
            place(&self.old).context("a label is new")?,
            place(&self.new).context("a label is lost")?,
        );
        let needed = label.map_or(effect::ALL, |_| self.needed[to]);
        for trial in 0..TRIALS {
            let facts = (&self.known[from], &self.copies[from]);
            let mut first = Run::new(trial, trial, facts);
            let mut second = Run::new(trial, trial + 1_000, facts);
            second.take(&first, needed);
            let ends =
                (first.run(&self.old, from, &self.stops), second.run(&self.new, to, &self.stops));
            self.compare(&first, &second, ends)?;
        }
        Ok(())
    }

    fn compare(&self, first: &Run, second: &Run, ends: (End, End)) -> Result<()> {
        for (a, b) in first.log.iter().zip(&second.log) {
            ensure!(a == b, "{a:?} became {b:?}");
        }
        let (all, made) = (first.log.len(), second.log.len());
        ensure!(all == made, "{made} things are done instead of {all}, {:?}", first.log.last());
        let at = match ends {
            (End::At(a), End::At(b)) => {
                // Two labels may stand at one place, or one may lead to the other.
                let place = |label: &str| self.old.destination(label);
                ensure!(place(&a) == place(&b), "it goes to {b} instead of {a}");
                (self.old.labels[a.as_str()], self.new.labels[a.as_str()])
            }
            (End::Left, End::Left) | (End::Endless, End::Endless) => return Ok(()),
            (a, b) => bail!("it ends with {b:?} instead of {a:?}"),
        };
        for part in (0..39).filter(|part| self.needed[at.1] & 1 << part != 0) {
            ensure!(first.part(part) == second.part(part), "{} is another", name(part));
        }
        for register in 0..32 {
            let (value, bits) = (first.part(register), self.known[at.0].bits(register));
            ensure!(
                value & bits.zeros == 0 && value & bits.ones == bits.ones,
                "r{register} is not as it should be"
            );
            let root = self.copies[at.0].root(register);
            ensure!(value == first.part(root), "r{register} is no copy of r{root}");
        }
        Ok(())
    }
}

fn name(part: u8) -> String {
    if bit(part) & effect::REGISTERS != 0 {
        format!("r{part}")
    } else {
        format!("flag {}", part - 32)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::text::tests::program;
    use super::*;

    fn refused(before: &str, after: &str) -> Option<String> {
        let versions = [before, after].map(|code| program(&[("f", code)]).functions.remove(0));
        check(&versions, &Needs::default()).err().map(|error| format!("{error:#}"))
    }

    #[test]
    fn what_does_alike_is_equal() {
        for (before, after) in [
            ("ldi r24, 1\nret", "ldi r24, 1\nret"),
            ("ldi r26, 1\nmov r24, r26\nret", "ldi r24, 1\nret"),
            ("movw r18, r22\nmovw r24, r18\nret", "movw r24, r22\nmovw r18, r22\nret"),
            ("mov r24, r1\nret", "ldi r24, 0\nret"),
            (
                "mov r26, r22\ncpi r24, 0\nbreq .LBB0_1\nwdr\n.LBB0_1:\nmov r24, r26\nret",
                "cpi r24, 0\nbreq .LBB0_1\nwdr\n.LBB0_1:\nmov r24, r22\nret",
            ),
            (
                "add r24, r22\ncpi r24, 0\nbreq .LBB0_1\ninc r24\n.LBB0_1:\nret",
                "add r24, r22\nbreq .LBB0_1\ninc r24\n.LBB0_1:\nret",
            ),
            (
                "rjmp .LBB0_1\n.LBB0_1:\nrjmp .LBB0_2\n.LBB0_2:\nret",
                "rjmp .LBB0_2\n.LBB0_1:\nrjmp .LBB0_2\n.LBB0_2:\nret",
            ),
        ] {
            assert_eq!(refused(before, after), None, "{before} and {after}");
        }
    }

    #[test]
    fn what_does_not_is_refused() {
        for (before, after) in [
            ("ldi r24, 1\nret", "ldi r24, 2\nret"),
            ("mov r2, r24\nret", "ret"),
            ("std Z+1, r24\nret", "std Z+2, r24\nret"),
            ("sts 500, r24\nret", "ret"),
            ("push r24\nret", "push r22\nret"),
            ("call f\nmov r24, r26\nret", "call f\nret"),
            ("call f\nret", "call g\nret"),
            (
                "cp r24, r22\nbrlo .LBB0_1\ninc r24\n.LBB0_1:\nret",
                "cp r24, r22\nbrlt .LBB0_1\ninc r24\n.LBB0_1:\nret",
            ),
            (
                "add r24, r22\ncpi r24, 0\nbrlo .LBB0_1\ninc r24\n.LBB0_1:\nret",
                "add r24, r22\nbrlo .LBB0_1\ninc r24\n.LBB0_1:\nret",
            ),
            (
                "sub r24, r22\nsbc r25, r23\ncpi r25, 0\nbreq .LBB0_1\ninc r24\n.LBB0_1:\nret",
                "sub r24, r22\nsbc r25, r23\nbreq .LBB0_1\ninc r24\n.LBB0_1:\nret",
            ),
            (
                "ldi r24, 3\n.LBB0_1:\ndec r24\nbrne .LBB0_1\nret",
                "ldi r24, 3\n.LBB0_1:\ndec r24\nbreq .LBB0_1\nret",
            ),
            ("ldd r24, Z+1\nldd r24, Z+2\nret", "ldd r24, Z+2\nret"),
            ("ldi r26, 1\n.LBB0_1:\nmov r24, r26\nret", ".LBB0_1:\nldi r24, 2\nret"),
            (
                "cpi r24, 0\nbreq .LBB0_1\nmov r26, r22\n.LBB0_1:\nmov r24, r26\nret",
                "cpi r24, 0\nbreq .LBB0_1\nmov r26, r22\n.LBB0_1:\nmov r24, r22\nret",
            ),
        ] {
            assert!(refused(before, after).is_some(), "{before} and {after}");
        }
    }
}
