//! Documentation of every code, for people. `docs/gcode.md` is generated from it. Tests check that every row of the
//! tables has an entry, and that every example is refused as documented.

mod bores;
mod cycles;
mod heating;
#[cfg(feature = "language")]
mod language;
mod lines;
mod machine;
mod markdown;
mod modes;
mod motion;
mod offsets;
mod stored;
#[cfg(test)]
mod tests;

pub use markdown::markdown;

use super::super::command::Commands;
use super::super::interpreter::Interpreter;
use super::super::setup::{AxisMode, Setup};
use super::super::tables::{Edit, Ram, TableRow, Tables};
use super::Code;
use crate::status::Status;
use crate::units::{Length, PerAxis};

/// A section: codes that belong together.
pub struct Section {
    /// The heading of the section.
    pub title: &'static str,
    /// A text that applies to the whole section. May be empty.
    pub intro: &'static str,
    /// The codes of the section.
    pub docs: &'static [Doc],
}

/// The documentation of one code.
pub struct Doc {
    /// `G` or `M`.
    pub letter: char,
    /// The number of the code in tenths.
    pub number: u16,
    /// The title of the code.
    pub title: &'static str,
    /// The description of the code.
    pub text: &'static str,
    /// The reasons for which a line with the code is refused, in addition to those that apply to any line.
    pub refusals: &'static [Refusal],
}

/// The documentation of something that may stand on any line.
pub struct Rule {
    /// The title of the rule.
    pub title: &'static str,
    /// The description of the rule.
    pub text: &'static str,
    /// The reasons for which a line is refused.
    pub refusals: &'static [Refusal],
}

/// A reason for which a line is refused.
pub struct Refusal {
    /// The status with which the line is refused.
    pub status: Status,
    /// An example. On a machine that has just been started, the last of these lines is refused.
    pub lines: &'static [&'static str],
    /// The machine of the example.
    pub on: On,
}

/// The machine of an example.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum On {
    /// A machine that has everything, all axes standard.
    Usual,
    /// A machine that has neither switches nor a probe nor an encoder.
    NoSwitches,
    /// The machine of `Usual` whose encoder has no sync sensor.
    IndexAlone,
    /// The machine of `Usual` with X disabled.
    DisabledX,
    /// The machine of `Usual` with soft limits, X from 0 to 150.
    SoftLimits,
}

impl Setup for On {
    fn mode(&self, axis: u8) -> AxisMode {
        match self {
            On::DisabledX if axis == 0 => AxisMode::Disabled,
            _ => AxisMode::Standard,
        }
    }

    fn radius(&self, _axis: u8) -> u32 {
        1
    }

    fn travel(&self, axis: u8) -> Option<(Length, Length)> {
        let limited = *self == On::SoftLimits && axis == 0;
        limited.then_some((Length::ZERO, Length(1_500_000)))
    }

    fn has_probe(&self) -> bool {
        *self != On::NoSwitches
    }

    fn encoder(&self, has_sync: bool) -> Result<(), Status> {
        match self {
            On::NoSwitches => Err(Status::NoEncoder),
            On::IndexAlone if has_sync => Err(Status::NoSync),
            _ => Ok(()),
        }
    }

    fn homing(&self, _axis: u8) -> Result<(), Status> {
        match self {
            On::NoSwitches => Err(Status::HomingSwitches),
            _ => Ok(()),
        }
    }
}

/// Tables of a machine on which no position was ever stored.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Fresh(Ram);

impl Fresh {
    /// A machine that has just been started.
    fn machine() -> Interpreter<Fresh> {
        Interpreter::with(Fresh(Ram::new()))
    }
}

impl Tables for Fresh {
    fn row(&self, row: TableRow) -> PerAxis<Length> {
        self.0.row(row)
    }

    fn is_stored(&self, _row: TableRow) -> bool {
        false
    }

    fn takes(&self, row: TableRow) -> bool {
        self.0.takes(row)
    }

    fn apply(&mut self, edit: &Edit) {
        self.0.apply(edit);
    }
}

impl Refusal {
    /// Runs the example on a machine. Returns the status with which the last line is refused, `None` if it is accepted.
    pub fn on(&self, setup: &impl Setup) -> Option<Status> {
        let (mut interpreter, mut out) = (Fresh::machine(), Commands::default());
        let mut last = None;
        for line in self.lines {
            last = interpreter.interpret(line.as_bytes(), setup, &mut out).err();
        }
        last
    }
}

impl Doc {
    /// Returns the name of the code: `G28.3`.
    pub fn name(&self) -> std::string::String {
        match (self.number / 10, self.number % 10) {
            (whole, 0) => std::format!("{}{whole}", self.letter),
            (whole, tenth) => std::format!("{}{whole}.{tenth}", self.letter),
        }
    }

    /// Returns the row of the code in the tables.
    pub fn row(&self) -> Option<Code> {
        let (whole, tenth) = (self.number / 10, (self.number % 10) as u8);
        if self.letter == 'G' { super::g(whole, tenth) } else { super::m(whole, tenth) }
    }
}

/// The documentation of all codes.
pub const SECTIONS: &[Section] = &[
    motion::MOVES,
    motion::PROBES,
    cycles::CYCLES,
    bores::BORES,
    modes::MODES,
    modes::FEEDS,
    offsets::SYSTEMS,
    offsets::TOOLS,
    stored::PLACES,
    machine::PROGRAM,
    machine::SPINDLE,
    machine::OVERRIDES,
    heating::HEATING,
];

/// The documentation of everything that may stand on any line.
pub const RULES: &[Rule] = lines::RULES;

/// Returns the documentation of all codes, code by code.
pub fn docs() -> impl Iterator<Item = &'static Doc> {
    SECTIONS.iter().flat_map(|section| section.docs)
}

const fn g(
    number: u16,
    title: &'static str,
    text: &'static str,
    refusals: &'static [Refusal],
) -> Doc {
    Doc { letter: 'G', number, title, text, refusals }
}

const fn m(
    number: u16,
    title: &'static str,
    text: &'static str,
    refusals: &'static [Refusal],
) -> Doc {
    Doc { letter: 'M', number, title, text, refusals }
}

/// Returns a refusal whose example uses the usual machine.
const fn no(status: Status, lines: &'static [&'static str]) -> Refusal {
    Refusal { status, lines, on: On::Usual }
}

/// Returns a refusal whose example uses the machine `on`.
const fn no_on(on: On, status: Status, lines: &'static [&'static str]) -> Refusal {
    Refusal { status, lines, on }
}
