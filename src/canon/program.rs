//! Reads a program from its first line to its last, or to the first line that is refused.

use core::fmt::{Display, Formatter};
use std::string::String;
use std::vec::Vec;

use super::advice::statuses;
use super::command::Canon;
use super::reader::Reader;
use crate::gcode::setup::Setup;
use crate::protocol::tinyg::{number, status_text};
use crate::status::Status;

/// Returns the text of a status, as the machine reports it.
pub fn text(status: Status) -> String {
    status_text(status).into_iter().flat_map(|text| text.bytes()).map(char::from).collect()
}

/// Returns the status with this number; `None` if there is none.
pub fn by_number(code: u8) -> Option<Status> {
    statuses().find(|status| number(*status) == code)
}

/// Returns the statuses that have this number among the errors of grbl's dialect.
pub fn of_error(code: u8) -> Vec<Status> {
    statuses().filter(|status| in_grbl(*status).0 == code).collect()
}

/// Returns the statuses that have this number among the alarms of grbl's dialect.
pub fn of_alarm(code: u8) -> Vec<Status> {
    statuses().filter(|status| in_grbl(*status).1 == Some(code)).collect()
}

/// Returns the number of the error and of the alarm in grbl's dialect.
#[cfg(feature = "dialect-grbl")]
fn in_grbl(status: Status) -> (u8, Option<u8>) {
    use crate::protocol::grbl::{alarm_number, error_number};
    (error_number(status), alarm_number(status))
}

/// Returns no number: this build lacks the dialect.
#[cfg(not(feature = "dialect-grbl"))]
fn in_grbl(_status: Status) -> (u8, Option<u8>) {
    (0, None)
}

/// A line that is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The number of the line in the program, from 1.
    pub number: usize,
    /// The reason.
    pub status: Status,
    /// The line.
    pub text: String,
}

impl Refusal {
    /// Returns the refusal of a line with `status`.
    pub fn new(number: usize, status: Status, line: &[u8]) -> Self {
        Self { number, status, text: String::from_utf8_lossy(line).trim_end().into() }
    }
}

impl Display for Refusal {
    /// `line: status code text: the line`.
    fn fmt(&self, to: &mut Formatter) -> core::fmt::Result {
        let (code, text) = (number(self.status), text(self.status));
        write!(to, "{}: status {code} {text}: {}", self.number, self.text)
    }
}

impl core::error::Error for Refusal {}

/// Returns the commands of a whole program, or the first line that is refused.
pub fn commands(program: &str, setup: impl Setup) -> Result<Vec<Canon>, Refusal> {
    let mut reader = Reader::new(setup);
    let mut commands = Vec::new();
    for (number, line) in (1..).zip(program.lines()) {
        let line = line.as_bytes();
        reader.read(line).map_err(|status| Refusal::new(number, status, line))?;
        commands.extend(&mut reader);
    }
    Ok(commands)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode::setup::Usual;
    use std::format;
    use std::string::ToString;

    fn printed(program: &str) -> String {
        commands(program, Usual).unwrap().iter().map(|command| format!("{command}\n")).collect()
    }

    #[test]
    fn a_program() {
        let program = "%\n(MSG hello )\nT3 M6 S1000 M3 M8\nG1 X1 F100\nG93 G2 X2 I0.5 F4\nG4 P.5\n\
            M50 P.5 G94\nM2\n%";
        let commands = "MESSAGE(hello)\nSTOP_SPINDLE_TURNING\nCHANGE_TOOL(3)\n\
            START_SPINDLE_CLOCKWISE(1000)\nFLOOD_ON\nSET_FEED_RATE(100)\n\
            STRAIGHT_FEED(1.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)\nSET_FEED_TIME(0.25)\n\
            ARC_FEED(XY, 2.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 1.5000, 0.0000, -1)\n\
            DWELL(0.500)\nSET_OVERRIDES(0.5, 1, 1)\nSTOP_SPINDLE_TURNING\nFLOOD_OFF\n\
            SET_OVERRIDES(1, 1, 1)\nPROGRAM_END\n";
        assert_eq!(printed(program), commands);
    }

    #[test]
    fn modes_are_told_where_they_change() {
        let program = "G61.1\nF9 G1 X1\nX2\nG64 F8\nX3\nG28.3 X0\nG28.2 Z0 X0";
        let names: Vec<_> = printed(program)
            .lines()
            .map(|line| line.split('(').next().unwrap().to_string())
            .collect();
        let mode = "SET_MOTION_CONTROL_MODE";
        let feed = "STRAIGHT_FEED";
        let rate = "SET_FEED_RATE";
        let all = [mode, rate, feed, feed, mode, rate, feed, "SET_POSITION", "HOME"];
        assert_eq!(names, all);
    }

    #[test]
    fn a_refused_line_ends_it() {
        let refusal = commands("G0 X1\nG1 X2\nG0 X3", Usual).unwrap_err();
        assert_eq!(refusal.to_string(), "2: status 142 Feedrate not specified: G1 X2");
    }
}
