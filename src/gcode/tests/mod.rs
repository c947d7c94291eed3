//! Whole lines through the interpreter.

mod arcs;
mod cycles;
mod fast_path;
mod lines;
mod tables;
mod threads;

use super::command::{Commands, Feed, Motion};
use super::interpreter::Interpreter;
use super::setup::Usual;
use crate::status::Status;

/// Returns an interpreter that has read these lines, and the commands of the last line.
fn run(lines: &[&str]) -> (Interpreter, Commands) {
    let mut interpreter = Interpreter::new();
    let mut out = Commands::default();
    for line in lines {
        interpreter.interpret(line.as_bytes(), &Usual, &mut out).expect(line);
    }
    (interpreter, out)
}

/// Returns the status with which the last of these lines is refused. Checks that this line changes nothing.
fn refusal(lines: &[&str]) -> Status {
    let (last, before) = lines.split_last().unwrap();
    let (mut interpreter, mut out) = run(before);
    let state = interpreter;
    let status = interpreter.interpret(last.as_bytes(), &Usual, &mut out).expect_err(last);
    assert_eq!(interpreter, state, "{last}");
    assert_eq!(out, Commands::default(), "{last}");
    status
}

/// Returns the position after these lines, in units.
fn position(lines: &[&str]) -> [i32; 6] {
    run(lines).0.position().map(|length| length.0)
}

/// Returns the feed of the last line.
fn feed(lines: &[&str]) -> Feed {
    match run(lines).1.motion {
        Motion::Feed { feed, .. } | Motion::Arc { feed, .. } => feed,
        other => panic!("{other:?}"),
    }
}
