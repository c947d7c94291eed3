//! Target `lines`: an input is a sequence of lines, separated by line feeds, for one interpreter.
//!
//! Checks after each line: a refused line has changed nothing in the interpreter and makes no commands; the fast path
//! for plain lines has either done nothing or has done what the slow path does; the chords of an arc stay on their
//! circle and end at its end; the steps of a line lead to the interpreter's position. A second interpreter gets the
//! same lines for a machine with unusual axes.

mod chords;

use kerf::gcode::command::{Commands, Motion};
use kerf::gcode::fast_path::Writer;
use kerf::gcode::setup::{AxisMode, Setup, Usual};
use kerf::gcode::steps::{Step, Steps};
use kerf::gcode::{Info, Interpreter};
use kerf::status::Status;
use kerf::units::Length;

/// Interprets the lines of an input; panics where a check fails.
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

/// The result of a line.
#[derive(PartialEq, Debug)]
struct Outcome {
    result: Result<Info, Status>,
    out: Commands,
}

impl Outcome {
    /// Interprets a line and checks what must hold for any line.
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

/// Runs the fast path alone and the slow path alone, from `before` on, and compares them with the result of both
/// together.
fn fast_path(before: &Interpreter, line: &[u8], after: &Interpreter, outcome: &Outcome) {
    for writer in [Writer::Plain, Writer::Numbers] {
        let (mut fast, mut out) = (*before, Commands::default());
        if !fast.fast_path(line, writer, &Usual, &mut out) {
            assert_eq!(fast, *before, "declined, changed all the same");
            // The slow path sets the motion itself, so the motion is not compared here.
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

/// Executes the steps of a line. A drilling cycle with a million pecks is not executed to its end.
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

/// Normal axes with limits beyond all positions, because the fast path does not handle axes with limits.
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

/// X has limits, Y is inhibited, Z disabled; A turns with a radius of 1 mm, B with 10 m.
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
