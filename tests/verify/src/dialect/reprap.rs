//! The dialect of printing hosts.

use super::{Dialect, Each, Question, Stored, between, number};
use crate::random::Random;

macro_rules! offset {
    ($axis:literal) => {
        Stored {
            read: "M206",
            find: |lines| between(lines, concat!(" ", $axis), &[' ']),
            store: |text| vec![format!(concat!("M206 ", $axis, "{}"), text), "M500".into()],
            other,
        }
    };
}

/// The dialect of printing hosts.
pub static REPRAP: Dialect = Dialect {
    name: "reprap",
    is_greeting: |line| line == "start",
    answer,
    version: Question {
        request: "M115",
        find: |lines| between(lines, "FIRMWARE_NAME:Kerf ", &[' ']),
    },
    opening: None,
    stored: &[offset!("X"), offset!("Y"), offset!("Z")],
    check_mode: None,
    dwell: |ms| format!("G4 P{ms}"),
    rest: Question { request: "M400", find: |_| Some(true) },
    drivers: "the dialect cannot switch the drivers off",
    for_job: &[],
    before_job: &["G21", "G91"],
    scale_requests: &["M92"],
    scale,
    steps_request: "M114",
    steps,
    late: None,
};

fn answer(line: &str) -> Option<Result<(), String>> {
    if line.starts_with("Error:") || line.starts_with("echo:Unknown") {
        return Some(Err(line.to_owned()));
    }
    line.starts_with("ok").then_some(Ok(()))
}

fn other(random: &mut Random) -> String {
    format!("{}.{:03}", random.below(5), random.below(1_000))
}

fn scale(lines: &[String]) -> Option<Each> {
    let of = |axis: &str| number(lines, axis, &[' ']);
    Some([of(" X")?, of(" Y")?, of(" Z")?])
}

fn steps(lines: &[String], _: &Each) -> Option<Each> {
    let text = between(lines, "Count", &[])?;
    let lines = [text];
    let of = |axis: &str| number(&lines, axis, &[' ']);
    Some([of("X:")?, of("Y:")?, of("Z:")?])
}
