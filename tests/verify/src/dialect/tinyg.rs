//! TinyG's dialect.

use super::{Dialect, Each, ForJob, Question, Stored, between, number};
use crate::random::Random;

/// The end of a value in JSON.
const END: &[char] = &[',', '}'];
/// The state of a machine that moves or dwells.
const RUNS: &str = "5";

macro_rules! word {
    ($name:literal) => {
        Stored {
            read: concat!("{", $name, ":n}"),
            find: |lines| value(lines, $name).map(|text| text.trim_matches('"').to_owned()),
            store: |text| vec![format!(concat!("{{", $name, ":\"{}\"}}"), text)],
            other,
        }
    };
}

macro_rules! setting {
    ($name:literal) => {
        Stored {
            read: concat!("{", $name, ":n}"),
            find: |lines| value(lines, $name),
            store: |text| vec![format!(concat!("{{", $name, ":{}}}"), text)],
            other,
        }
    };
}

macro_rules! unpowered {
    ($name:literal) => {
        ForJob { value: setting!($name), needed: "0" }
    };
}

/// The settings that the check with a jumper changes: switches, the direction of X, and the power of the motors.
pub(crate) static SWITCHES: [Stored; 12] = [
    setting!("xsn"),
    setting!("xsx"),
    setting!("ysn"),
    setting!("ysx"),
    setting!("zsn"),
    setting!("zsx"),
    setting!("st"),
    setting!("1po"),
    setting!("1pm"),
    setting!("2pm"),
    setting!("3pm"),
    setting!("4pm"),
];

/// TinyG's dialect.
pub static TINYG: Dialect = Dialect {
    name: "tinyg",
    is_greeting: |line| line.contains("SYSTEM READY"),
    answer,
    version: Question {
        request: "{kerf:n}",
        find: |lines| value(lines, "kerf").map(|text| text.trim_matches('"').into()),
    },
    opening: Some("{}"),
    stored: &[word!("uda0"), word!("uda1"), word!("udb0"), word!("udd3")],
    check_mode: Some(["{chk:1}", "{chk:0}"]),
    dwell: |ms| format!("g4 p{}", f64::from(ms) / 1_000.0),
    rest: Question {
        request: "{stat:n}",
        find: |lines| value(lines, "stat").map(|stat| stat != RUNS),
    },
    drivers: "the motors have no power",
    for_job: &[unpowered!("1pm"), unpowered!("2pm"), unpowered!("3pm"), unpowered!("4pm")],
    before_job: &["{md:n}", "g21", "g94", "g91"],
    scale_requests: &["{1:n}", "{2:n}", "{3:n}", "{4:n}"],
    scale,
    steps_request: "{_ps:n}",
    steps,
    late: Some(Question { request: "{stv:n}", find: |lines| value(lines, "stv") }),
};

fn answer(line: &str) -> Option<Result<(), String>> {
    let footer = is_answer(line).then(|| line.rsplit_once("\"f\":["))??.1;
    let status = footer.split(',').nth(1)?.trim();
    Some(if status == "0" { Ok(()) } else { Err(line.to_owned()) })
}

fn is_answer(line: &str) -> bool {
    line.starts_with("{\"r\":")
}

/// Returns the value of a name in an answer. Reports that come unasked have values of the same names.
pub(crate) fn value(lines: &[String], name: &str) -> Option<String> {
    let answers: Vec<String> = lines.iter().filter(|line| is_answer(line)).cloned().collect();
    between(&answers, &format!("{{\"{name}\":"), END)
}

fn other(random: &mut Random) -> String {
    format!("{:#x}", random.number())
}

/// The axis of a motor, and its steps/mm, from the answer about it.
fn motor(line: &str) -> Option<(usize, f64)> {
    let lines = [line.to_owned()];
    let of = |name: &str| number(&lines, &format!("\"{name}\":"), END);
    let axis = of("ma")?;
    Some((axis as usize, 360.0 / of("sa")? / of("tr")? * of("mi")?))
}

/// The first motor of each axis: their number, and their steps/mm. An answer may have a setting of the same name in
/// another group; those of motors are the only ones with all four.
fn scale(lines: &[String]) -> Option<Each> {
    let motors: Vec<_> = lines.iter().filter_map(|line| motor(line)).collect();
    let of = |axis| motors.iter().find(|(of, _)| *of == axis).map(|(_, scale)| *scale);
    Some([of(0)?, of(1)?, of(2)?])
}

/// The steps of motors 1 to 3, which are those of X, Y and Z in all profiles but with CoreXY.
fn steps(lines: &[String], _: &Each) -> Option<Each> {
    let of = |motor: usize| number(lines, &format!("\"{motor}\":"), END);
    Some([of(1)?, of(2)?, of(3)?])
}
