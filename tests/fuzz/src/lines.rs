//! Target `lines`: an input is lines, parted by line feeds, for one interpreter.
//!
//! After each line: a refused one has left the interpreter as it was and asks for nothing; the fast path
//! for plain lines has either done nothing, or what the slow path does; the chords of an arc stay on
//! their circle and end at its end; the steps of a line lead to where the interpreter is. A second interpreter gets the same lines for a machine of odd axes.

mod chords;

use kerf::gcode::command::{Commands, Motion};
use kerf::gcode::fast_path::Writer;
use kerf::gcode::setup::{AxisMode, Setup, Usual};
use kerf::gcode::steps::{Step, Steps};
use kerf::gcode::{Info, Interpreter};
use kerf::status::Status;
use kerf::units::Length;

/// Interprets the lines of an input; panics where something does not hold.
pub fn check(input: &[u8]) {
    let (mut usual, mut odd) = (Interpreter::new(), Interpreter::new());
    for line in input.split(|byte| *byte == b'\n') {
        let before = usual;
        let outcome = Outcome::of(&mut usual, line, &Usual);
        fast_path(&before, line, &usual, &outcome);
        arc(&before, &outcome.out);
        steps(&before, &usual, &outcome.out);
        Outcome::of(&mut odd, line, &Odd);
    }
}

/// What a line came to.
#[derive(PartialEq, Debug)]
struct Outcome {
    result: Result<Info, Status>,
    out: Commands,
}

impl Outcome {
    /// Interprets a line and checks what holds for any.
    fn of(interpreter: &mut Interpreter, line: &[u8], axes: &impl Setup) -> Self {
        let before = *interpreter;
        let mut out = Commands::default();
        let result = interpreter.interpret(line, axes, &mut out);
        match result {
            Ok(Info { message: Some((start, end)), .. }) => {
                assert!(
                    line.get(start.into()..end.into()).is_some(),
                    "a message of {start}..{end}"
                );
            }
            Ok(_) => {}
            Err(status) => {
                assert_eq!(*interpreter, before, "refused with {status:?}, changed all the same");
                assert_eq!(out, Commands::default(), "refused with {status:?}");
            }
        }
        Self { result, out }
    }
}

/// The fast path alone, from `before` on, and the slow one alone, against what both together did.
fn fast_path(before: &Interpreter, line: &[u8], after: &Interpreter, outcome: &Outcome) {
    for writer in [Writer::Plain, Writer::Numbers] {
        let (mut fast, mut out) = (*before, Commands::default());
        if !fast.fast_path(line, writer, &Usual, &mut out) {
            assert_eq!(fast, *before, "declined, changed all the same");
            // The motion is whatever the slow path makes of it, which begins anew.
            out.motion = Motion::None;
            assert_eq!(out, Commands::default(), "declined");
            continue;
        }
        assert_eq!(fast, *after, "{writer:?}");
        assert_eq!(Outcome { result: Ok(Info::default()), out }, *outcome);
        let mut slow = *before;
        assert_eq!(Outcome::of(&mut slow, line, &Endless), *outcome, "the slow path");
        assert_eq!(slow, *after, "the slow path");
    }
}

fn arc(before: &Interpreter, out: &Commands) {
    if let Motion::Arc { target, arc, .. } = &out.motion {
        for tolerance in [0.01, 0.5] {
            chords::check(before.position(), target, arc, tolerance);
        }
    }
}

/// Carries a line out. Some holes are drilled in a million pecks: those are not followed to the end.
fn steps(before: &Interpreter, after: &Interpreter, out: &Commands) {
    let (mut steps, mut at) = (Steps::default(), *before.position());
    for _ in 0..2_000 {
        match (steps.next(out, &at), &out.motion) {
            (None, Motion::Home { .. }) => return,
            (None, _) => return assert_eq!(at, *after.position(), "where the steps lead"),
            (Some(Step::Line(target, _) | Step::SetPosition(target)), _) => at = target,
            (Some(Step::Thread), motion) => at = steps.end_of_pass(motion, &at),
            (Some(Step::Arc), Motion::Arc { target, .. })
            | (Some(Step::Probe), Motion::Probe { target, .. }) => at = *target,
            _ => {}
        }
    }
}

/// As usual, but with limits, which nothing can be beyond: the fast path leaves such axes alone.
struct Endless;

impl Setup for Endless {
    fn mode(&self, axis: u8) -> AxisMode {
        Usual.mode(axis)
    }
    fn radius(&self, axis: u8) -> u32 {
        Usual.radius(axis)
    }
    fn travel(&self, _axis: u8) -> Option<(Length, Length)> {
        Some((Length(i32::MIN), Length(i32::MAX)))
    }
}

/// X has limits, Y is inhibited, Z disabled; A turns by a radius of 1 mm, B of 10 m.
struct Odd;

impl Setup for Odd {
    fn mode(&self, axis: u8) -> AxisMode {
        match axis {
            1 => AxisMode::Inhibited,
            2 => AxisMode::Disabled,
            3 | 4 => AxisMode::Radius,
            _ => AxisMode::Standard,
        }
    }
    fn radius(&self, axis: u8) -> u32 {
        if axis == 3 { 1_000_000 } else { u32::MAX }
    }
    fn travel(&self, axis: u8) -> Option<(Length, Length)> {
        (axis == 0).then_some((Length(-1_000_000), Length(2_000_000)))
    }
}
