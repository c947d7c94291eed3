//! The oracle: computes the end position of a job by an independent G-code interpreter.
//!
//! It shares no code with the firmware, and reads only positions, not motion. All arithmetic is in whole numbers. A
//! position is in units of 0.1 um (0.0001 degree), and each axis word is rounded to that. What the rounding leaves is
//! carried over to the next increment (G91). The steps follow from the position by one division, halves away from
//! zero.

mod exact;
mod swings;
mod words;

use std::f64::consts::FRAC_1_SQRT_2;
use std::fmt;

use kerf::boards::MOTORS;

use crate::pauses::Travel;

pub use exact::{Decimal, Exact, divide};
use swings::Swings;
pub use words::{Word, split};

/// Axes, X Y Z A B C.
pub const AXES: usize = 6;
/// Units in a millimetre or a degree.
pub const UNITS: i128 = 10_000;
/// Units in an inch.
const UNITS_PER_INCH: i128 = 254_000;
const FIRST_ROTARY: usize = 3;
/// Coordinate systems, and one that is not used.
const SYSTEMS: usize = 10;
/// How far the firmware may stay away from a corner, whatever P of G64 says, in units.
const CUT: i64 = UNITS as i64 / 10;
const LETTERS: [char; AXES] = ['X', 'Y', 'Z', 'A', 'B', 'C'];

/// A motor's settings.
#[derive(Clone, Copy, Debug)]
pub struct MotorSetup {
    /// The axis that the motor moves (`ma`), counted from 0. X if it drives X and Y together.
    pub axis: usize,
    /// The sign with which the motor also drives Y, as on a CoreXY machine: 1, -1, or 0 for not at all.
    pub besides: i64,
    /// Degrees per full step (`sa`).
    pub step_angle: Decimal,
    /// Travel per turn (`tr`).
    pub travel: Decimal,
    /// Microsteps per full step (`mi`).
    pub microsteps: u32,
    /// Whether the motor turns the other way round (`po`).
    pub inverted: bool,
    /// Whether the motor steps on a falling edge (`sp`).
    pub active_low: bool,
}

impl MotorSetup {
    /// Whether the motor moves this axis.
    pub fn drives(&self, axis: usize) -> bool {
        self.axis == axis || self.besides != 0 && axis == 1
    }

    /// Steps from zero to a position.
    pub fn steps(&self, position: i64) -> i64 {
        let (angle, angle_one) = self.step_angle.ratio();
        let (travel, travel_one) = self.travel.ratio();
        let up = i128::from(position) * 360 * i128::from(self.microsteps) * angle_one * travel_one;
        let down = angle * travel * UNITS;
        if down == 0 { 0 } else { divide(up, down) as i64 }
    }
}

impl MotorSetup {
    /// Returns the motor's position when the axes are at `position`.
    fn place(&self, position: &[i64; AXES]) -> i64 {
        position[self.axis] + self.besides * position[1]
    }

    /// Whether all axes that the motor drives may move.
    fn moves(&self, modes: &[AxisMode; AXES]) -> bool {
        let standard = |axis: usize| modes[axis] == AxisMode::Standard;
        standard(self.axis) && (self.besides == 0 || standard(1))
    }
}

/// Returns what is wrong with a motor (1 is the first) that stands at `steps` after `total` steps in both directions.
pub fn faults(
    motor: usize,
    (steps, expected): (i64, Option<i64>),
    (total, least): (u64, Option<u64>),
) -> impl Iterator<Item = String> {
    let elsewhere = expected
        .filter(|expected| *expected != steps)
        .map(|expected| format!("motor {motor} is at {steps} steps instead of {expected}"));
    let short = least
        .filter(|least| *least > total)
        .map(|least| format!("motor {motor} makes {total} steps of {least}"));
    elsewhere.into_iter().chain(short)
}

impl Setup {
    /// Returns what each motor moves, for the meter of pauses. Two motors that drive X and Y together are treated as
    /// two axes turned by 45 degrees, with lengths multiplied by the root of 2.
    pub fn travels(&self) -> [Travel; MOTORS] {
        std::array::from_fn(|m| {
            let motor = &self.motors[m];
            let per_unit = motor.steps(1_000_000 * UNITS as i64) as f64 / 1e6;
            let step = if per_unit == 0.0 { 0.0 } else { 1.0 / per_unit };
            let (axis, step) = match motor.besides {
                0 => (motor.axis, step),
                besides => (usize::from(besides < 0), step * FRAC_1_SQRT_2),
            };
            Travel { axis, step, rotary: axis >= FIRST_ROTARY }
        })
    }
}

/// How an axis treats its words (`am`).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum AxisMode {
    /// Its words are ignored.
    Disabled,
    /// The axis moves as its words say.
    #[default]
    Standard,
    /// The axis is planned, but its motors stand still.
    Inhibited,
    /// Words of the axis are lengths along a circumference. A job that uses it is [`Unclear`], because the angle is
    /// no decimal number.
    Radius,
}

/// The machine a job runs on.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Its motors, motor 1 first.
    pub motors: Vec<MotorSetup>,
    /// Its axes.
    pub modes: [AxisMode; AXES],
}

/// Where a job ends.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Outcome {
    /// Machine position of each axis, in units.
    pub position: [i64; AXES],
    /// Steps up minus steps down of each motor.
    pub steps: Vec<i64>,
    /// The least steps of each motor in both directions together.
    pub least: Vec<u64>,
    /// Longest dwell, in milliseconds.
    pub longest_dwell_ms: u64,
}

/// A line whose end position this oracle cannot tell.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Unclear {
    /// Line number in the job, from 1.
    pub line: usize,
    /// The code that makes it unclear.
    pub what: String,
}

impl fmt::Display for Unclear {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: the oracle does not know {}", self.line, self.what)
    }
}

impl std::error::Error for Unclear {}

/// Reads a whole job.
pub fn run<'a>(
    lines: impl IntoIterator<Item = (usize, &'a str)>,
    setup: &Setup,
) -> Result<Outcome, Unclear> {
    let mut reader = Reader::new(setup);
    for (line, text) in lines {
        reader.line(text).map_err(|what| Unclear { line, what })?;
    }
    Ok(reader.finish())
}

/// Returns for each line its number and the steps of each motor that [`run`] would return if the job ended there. The
/// list ends before the first line that is unclear.
pub fn ends<'a>(
    lines: impl IntoIterator<Item = (usize, &'a str)>,
    setup: &Setup,
) -> Vec<(usize, Vec<i64>)> {
    let mut reader = Reader::new(setup);
    let clear = lines.into_iter().take_while(|(_, text)| reader.line(text).is_ok());
    let numbers: Vec<_> = clear.map(|(line, _)| line).collect();
    numbers.into_iter().zip(reader.places).collect()
}

/// Returns the longest dwell of a job, in milliseconds. Lines that cannot be read are skipped.
pub fn longest_dwell_ms<'a>(
    lines: impl IntoIterator<Item = (usize, &'a str)>,
    setup: &Setup,
) -> u64 {
    let mut reader = Reader::new(setup);
    for (_, text) in lines {
        // Errors are ignored here.
        let _ = reader.line(text);
    }
    reader.longest_dwell_ms
}

/// Non-modal actions of a line, named by the G code times ten.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Once {
    Dwell,
    Tap,
    Offsets,
    SetPosition,
    SetZero(i64),
}

struct Reader<'a> {
    setup: &'a Setup,
    position: [i64; AXES],
    /// What rounding has left of the position.
    rests: [i64; AXES],
    /// The position from which steps count; G28.3 moves it.
    origin: [i64; AXES],
    steps: Vec<i64>,
    /// The steps at the end of each line.
    places: Vec<Vec<i64>>,
    /// The greatest P of G64, in units; [`CUT`] at least.
    cut: i64,
    moving: bool,
    inches: bool,
    diameters: bool,
    incremental: bool,
    system: usize,
    systems: [[i64; AXES]; SYSTEMS],
    zero: [i64; AXES],
    zero_on: bool,
    longest_dwell_ms: u64,
}

impl<'a> Reader<'a> {
    fn new(setup: &'a Setup) -> Self {
        Reader {
            setup,
            position: [0; AXES],
            rests: [0; AXES],
            origin: [0; AXES],
            steps: vec![0; setup.motors.len()],
            places: Vec::new(),
            cut: CUT,
            moving: true,
            inches: false,
            diameters: false,
            incremental: false,
            system: 1,
            systems: [[0; AXES]; SYSTEMS],
            zero: [0; AXES],
            zero_on: false,
            longest_dwell_ms: 0,
        }
    }

    fn line(&mut self, text: &str) -> Result<(), String> {
        let words = split(text)?;
        let mut once = None;
        let mut machine_coordinates = false;
        let mut end = false;
        for word in &words {
            match word.letter {
                'G' => self.g_code(word.value.tenths(), &mut once, &mut machine_coordinates)?,
                'P' if words.iter().any(Word::is_path_mode) => {
                    let unit = if self.inches { UNITS_PER_INCH } else { UNITS };
                    self.cut = self.cut.max(word.value.scaled(unit));
                }
                'M' => end |= self.m_code(word.value.tenths())?,
                c if self.is_on_a_radius(c) => return Err(format!("{c} in radius mode")),
                c if LETTERS.contains(&c) || "DEFHIJKLNOPQRST".contains(c) => {}
                c => return Err(format!("the letter {c}")),
            }
        }
        match once {
            Some(Once::Dwell) => self.dwell(&words),
            Some(Once::Tap) => self.moving = false,
            Some(Once::Offsets) => self.offsets(&words)?,
            Some(Once::SetPosition) => self.set_position(&words),
            Some(Once::SetZero(code)) => self.set_zero(code, &words),
            None if self.moving => self.travel(&words, machine_coordinates),
            None => {}
        }
        if end {
            self.program_end();
        }
        self.places.push(self.steps_here());
        Ok(())
    }

    fn g_code(
        &mut self,
        tenths: i64,
        once: &mut Option<Once>,
        machine: &mut bool,
    ) -> Result<(), String> {
        match tenths {
            0 | 10 | 20 | 30 | 320 | 330 | 760 => self.moving = true,
            // A tap ends where it begins.
            331 => *once = Some(Once::Tap),
            800 => self.moving = false,
            40 => *once = Some(Once::Dwell),
            100 => *once = Some(Once::Offsets),
            283 => *once = Some(Once::SetPosition),
            920..=923 => *once = Some(Once::SetZero(tenths)),
            70 => self.diameters = true,
            80 => self.diameters = false,
            200 => self.inches = true,
            210 => self.inches = false,
            900 => self.incremental = false,
            910 => self.incremental = true,
            530 => *machine = true,
            540 | 550 | 560 | 570 | 580 | 590 => self.system = (tenths / 10 - 53) as usize,
            591..=593 => self.system = (tenths - 584) as usize,
            // Codes without effect on the end position: planes, feed modes, path modes, arc distance, cutter
            // compensation and tool length off, retract modes.
            170 | 180 | 190 | 930 | 940 | 950 | 610 | 611 | 640 | 901 | 911 | 400 | 490 | 980
            | 990 => {}
            // The meaning of S.
            960 | 970 => {}
            _ => return Err(format!("G{}", tenths as f64 / 10.0)),
        }
        Ok(())
    }

    /// Executes an M code. Returns true when the program ends.
    fn m_code(&mut self, tenths: i64) -> Result<bool, String> {
        match tenths {
            20 | 300 => Ok(true),
            0 | 10 | 600 | 30 | 40 | 50 | 60 | 70 | 80 | 90 => Ok(false),
            480 | 490 | 500 | 510 => Ok(false),
            _ => Err(format!("M{}", tenths as f64 / 10.0)),
        }
    }

    fn is_on_a_radius(&self, letter: char) -> bool {
        let axis = LETTERS.iter().position(|l| *l == letter);
        axis.is_some_and(|axis| self.setup.modes[axis] == AxisMode::Radius)
    }

    /// The axis words of a line, in units.
    fn axis_words(&self, words: &[Word]) -> [Option<Exact>; AXES] {
        let mut values = [None; AXES];
        for word in words {
            let Some(axis) = LETTERS.iter().position(|l| *l == word.letter) else { continue };
            if self.setup.modes[axis] == AxisMode::Disabled {
                continue;
            }
            let inches = self.inches && axis < FIRST_ROTARY;
            let unit = if inches { UNITS_PER_INCH } else { UNITS };
            // In diameter mode an X word is twice the distance.
            values[axis] = Some(word.value.exact(unit, self.diameters && axis == 0));
        }
        values
    }

    fn offset(&self, axis: usize) -> i64 {
        let zero = if self.zero_on { self.zero[axis] } else { 0 };
        self.systems[self.system][axis] + zero
    }

    fn travel(&mut self, words: &[Word], machine_coordinates: bool) {
        for (axis, value) in self.axis_words(words).into_iter().enumerate() {
            let Some(value) = value else { continue };
            let (from, value) = if machine_coordinates {
                (0, value)
            } else if self.incremental {
                (self.position[axis], value.with(self.rests[axis]))
            } else {
                (self.offset(axis), value)
            };
            (self.position[axis], self.rests[axis]) = (from + value.units, value.rest);
        }
    }

    fn dwell(&mut self, words: &[Word]) {
        let seconds = words.iter().rev().find(|w| w.letter == 'P');
        let ms = seconds.map_or(0, |w| w.value.scaled(1000)).max(0) as u64;
        self.longest_dwell_ms = self.longest_dwell_ms.max(ms);
    }

    fn offsets(&mut self, words: &[Word]) -> Result<(), String> {
        let number = |letter| {
            let word = words.iter().rev().find(|w| w.letter == letter);
            word.and_then(|w| w.value.as_whole())
        };
        let (form, system) = (number('L'), number('P'));
        let system = match (form, system) {
            // The table of tools, which moves nothing.
            (Some(1 | 10), _) => return Ok(()),
            (_, Some(0)) => self.system,
            (_, Some(system @ 1..=9)) => system as usize,
            _ => return Err("G10 without P0 to P9".into()),
        };
        for (axis, value) in self.axis_words(words).into_iter().enumerate() {
            let Some(value) = value else { continue };
            // L20 counts from the offset that is in force.
            let zero = if self.zero_on { self.zero[axis] } else { 0 };
            self.systems[system][axis] = match form {
                Some(2) | None => value.units,
                Some(20) => self.position[axis] - zero - value.units,
                Some(other) => return Err(format!("G10 L{other}")),
            };
        }
        Ok(())
    }

    fn set_position(&mut self, words: &[Word]) {
        self.count_steps();
        for (axis, value) in self.axis_words(words).into_iter().enumerate() {
            let Some(value) = value else { continue };
            (self.position[axis], self.rests[axis]) = (value.units, value.rest);
        }
        self.origin = self.position;
    }

    fn set_zero(&mut self, code: i64, words: &[Word]) {
        match code {
            921 => (self.zero, self.zero_on) = ([0; AXES], false),
            922 => self.zero_on = false,
            923 => self.zero_on = true,
            _ => {
                self.zero_on = true;
                for (axis, value) in self.axis_words(words).into_iter().enumerate() {
                    let Some(value) = value else { continue };
                    let system = self.systems[self.system][axis];
                    self.zero[axis] = self.position[axis] - system - value.units;
                    self.rests[axis] = value.rest;
                }
            }
        }
    }

    fn program_end(&mut self) {
        (self.zero, self.zero_on) = ([0; AXES], false);
        self.system = 1;
        self.incremental = false;
        self.moving = false;
    }

    /// Adds the steps from `origin` to the position to the count.
    fn count_steps(&mut self) {
        self.steps = self.steps_here();
    }

    /// Returns the steps so far, including the steps from `origin` to the position.
    fn steps_here(&self) -> Vec<i64> {
        let counted = self.setup.motors.iter().zip(&self.steps);
        let here = counted.map(|(motor, steps)| {
            if !motor.moves(&self.setup.modes) {
                return *steps;
            }
            let (from, to) = (motor.place(&self.origin), motor.place(&self.position));
            *steps + motor.steps(to) - motor.steps(from)
        });
        here.collect()
    }

    /// Returns the least steps of each motor.
    fn least(&self) -> Vec<u64> {
        let of = |(m, motor): (usize, &MotorSetup)| {
            // A motor that drives two axes is cut short on both.
            let axes = 1 + motor.besides.abs();
            let cut = motor.steps(self.cut * axes).unsigned_abs() + 1;
            let mut swings = Swings::default();
            self.places.iter().for_each(|places| swings.go_to(places[m], cut));
            swings.least(cut)
        };
        self.setup.motors.iter().enumerate().map(of).collect()
    }

    fn finish(mut self) -> Outcome {
        self.count_steps();
        Outcome {
            position: self.position,
            least: self.least(),
            steps: self.steps,
            longest_dwell_ms: self.longest_dwell_ms,
        }
    }
}

#[cfg(test)]
mod tests;
