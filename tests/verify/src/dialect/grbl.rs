//! grbl's dialect.

use super::{AXES, Dialect, Each, ForJob, Question, Stored, between, number};
use crate::random::Random;

macro_rules! setting {
    ($number:literal) => {
        Stored {
            read: "$$",
            find: |lines| between(lines, concat!("$", $number, "="), &[]),
            store: |text| vec![format!(concat!("$", $number, "={}"), text)],
            other,
        }
    };
}

macro_rules! hundred {
    ($number:literal) => {
        ForJob { value: setting!($number), needed: "100.000" }
    };
}

/// grbl's dialect. Positions are in mm with three decimals, so the job runs at 100 steps/mm, where they tell each
/// step.
pub static GRBL: Dialect = Dialect {
    name: "grbl",
    is_greeting: |line| line.starts_with("Grbl "),
    answer,
    version: Question { request: "$I", find: |lines| between(lines, ":Kerf ", &[']']) },
    opening: None,
    stored: &[setting!("120"), setting!("121"), setting!("122")],
    check_mode: Some(["$C", "$C"]),
    dwell: |ms| format!("G4P{}", f64::from(ms) / 1_000.0),
    rest: Question {
        request: "?",
        find: |lines| Some(lines.iter().any(|line| line.starts_with("<Idle"))),
    },
    drivers: "the dialect cannot switch the drivers off",
    for_job: &[hundred!("100"), hundred!("101"), hundred!("102")],
    before_job: &["G21", "G94", "G91"],
    scale_requests: &["$$"],
    scale,
    steps_request: "?",
    steps,
    late: None,
};

fn answer(line: &str) -> Option<Result<(), String>> {
    match line {
        "ok" => Some(Ok(())),
        _ => line.starts_with("error:").then(|| Err(line.to_owned())),
    }
}

fn other(random: &mut Random) -> String {
    format!("{}.000", 100 + random.below(100))
}

fn scale(lines: &[String]) -> Option<Each> {
    let of = |setting: &str| number(lines, setting, &[]);
    Some([of("$100=")?, of("$101=")?, of("$102=")?])
}

fn steps(lines: &[String], scale: &Each) -> Option<Each> {
    let text = between(lines, "MPos:", &['|', '>'])?;
    let mut numbers = text.split(',').map(|number| number.parse::<f64>().ok());
    let mut steps = [0.0; AXES];
    for (steps, scale) in steps.iter_mut().zip(scale) {
        *steps = (numbers.next()?? * scale).round();
    }
    Some(steps)
}
