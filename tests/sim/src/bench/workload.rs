//! The firmware on its board, set up as the others were, and jobs for it.

use std::fmt::Write;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use kerf::boards::Board;

use crate::host::{Host, LINES_IN_FLIGHT};
use crate::image::Image;
use crate::job::{self, Options};
use crate::machine::Machine;
use crate::report::Report;
use crate::stopwatch::Stopwatch;

/// Steps per millimetre of X, Y and, in degrees, A.
pub const PER_MM: f64 = 80.0;
/// Steps per millimetre of Z.
pub const PER_MM_Z: f64 = 400.0;
/// Acceleration, mm/s2.
pub const ACCELERATION: f64 = 500.0;
/// The usual speed of the line, and a fast one.
pub const USUAL_BAUD: u32 = 115_200;
/// See [`USUAL_BAUD`].
pub const FAST_BAUD: u32 = 500_000;

/// Lines in flight: as many as the firmware keeps, so that the line is never idle.
const IN_FLIGHT: usize = 2 * LINES_IN_FLIGHT;

/// 80 and 400 steps/mm; velocity and jerk limits out of the way.
const SETTINGS: [&str; 8] = [
    "{1:{tr:20}}",
    "{2:{tr:20}}",
    "{3:{tr:4}}",
    "{4:{ma:3,tr:20}}",
    "{x:{vm:2000000,fr:2000000,jd:0.01}}",
    "{y:{vm:2000000,fr:2000000,jd:0.01}}",
    "{z:{vm:2000000,fr:2000000,jd:0.01}}",
    "{a:{am:1,vm:2000000,fr:2000000,jd:0.01}}",
];
/// TinyG's jerk limit: it takes all of the queue to stop.
const LOW_JERK_LIMIT: [&str; 4] = ["{xjm:20}", "{yjm:20}", "{zjm:20}", "{ajm:20}"];
/// 500 mm/s2 towards the centre of a corner; reports off.
const MORE: [&str; 2] = ["{ja:1800000}", "{sv:0,qv:0}"];
/// So much jerk that ramps are trapezoids.
const NO_JERK_LIMIT: [&str; 4] =
    ["{xjm:1000000}", "{yjm:1000000}", "{zjm:1000000}", "{ajm:1000000}"];

/// The firmware and the board under it.
pub struct Bed {
    image: Image,
    board: &'static Board,
    /// Whether there is an acceleration limit to be set.
    has_acceleration: bool,
}

/// How a job differs from the others.
#[derive(Clone, Copy)]
pub struct How {
    /// Speed of the line.
    pub baud: u32,
    /// Acceleration, mm/s2.
    pub acceleration: f64,
    /// There is a low jerk limit, 20 millions of mm/min3.
    pub jerk: bool,
    /// Every step is kept.
    pub log: bool,
}

impl Default for How {
    fn default() -> Self {
        How { baud: USUAL_BAUD, acceleration: ACCELERATION, jerk: false, log: false }
    }
}

impl Bed {
    /// A bed for the ELF file at `path`.
    pub fn new(path: &Path, board: &'static Board) -> Result<Self> {
        let mut bed = Bed { image: Image::read(path)?, board, has_acceleration: true };
        let mut machine = bed.machine()?;
        let mut host = Host::new(LINES_IN_FLIGHT);
        host.boot(&mut machine, 1_000)?;
        bed.has_acceleration = host.ask(&mut machine, "{xac:n}", 1_000)?.status == 0;
        Ok(bed)
    }

    /// A machine as it leaves the factory.
    pub fn machine(&self) -> Result<Machine> {
        Machine::new(self.image.clone(), self.board)
    }

    /// What makes the firmware comparable.
    pub fn settings(&self, how: How) -> Vec<String> {
        let mut all: Vec<String> = SETTINGS.iter().chain(&MORE).map(|s| s.to_string()).collect();
        let jerk = if how.jerk { LOW_JERK_LIMIT } else { NO_JERK_LIMIT };
        all.extend(jerk.map(str::to_string));
        if self.has_acceleration {
            let limit = |axis| format!("{{{axis}ac:{}}}", how.acceleration);
            all.extend(["x", "y", "z", "a"].map(limit));
        }
        all
    }

    /// A stopwatch for the calls of a function.
    pub fn calls(&self, function: &str) -> Result<Stopwatch> {
        Ok(Stopwatch::calls(self.entry(function)?))
    }

    /// A stopwatch for the laps of an interrupt.
    pub fn laps(&self, vector: u8, function: &str) -> Result<Stopwatch> {
        Ok(Stopwatch::laps(vector, self.entry(function)?))
    }

    fn entry(&self, name: &str) -> Result<u32> {
        self.image.function(name).with_context(|| format!("the image has no function {name}"))
    }

    /// Runs a job that must go well.
    pub fn run(&self, job: &str, how: How) -> Result<(Machine, Report)> {
        let (machine, report) = self.try_run(job, how, Vec::new())?;
        ensure!(report.ok, "{}", report.problems.join("; "));
        Ok((machine, report))
    }

    /// Runs a job under stopwatches, however it goes.
    pub fn try_run(
        &self,
        job: &str,
        how: How,
        stopwatches: Vec<Stopwatch>,
    ) -> Result<(Machine, Report)> {
        let mut machine = self.machine()?;
        if how.log {
            machine.recorder_mut().keep_log();
        }
        stopwatches.into_iter().for_each(|s| machine.add_stopwatch(s));
        let baud = (how.baud != USUAL_BAUD).then_some(how.baud);
        let settings = self.settings(how);
        let options = Options { baud, settings, in_flight: IN_FLIGHT, vcd: None };
        let report = job::run(&mut machine, &job::lines_of(job), &options, |_| {})?;
        Ok((machine, report))
    }
}

/// A straight way of `mm` in `count` equal moves at `feed` mm/min.
pub fn straight(count: u32, mm: f64, feed: f64) -> String {
    let mut job = format!("G1 F{feed}\n");
    for n in 1..=count {
        let _ = writeln!(job, "G1X{:.2}", f64::from(n) * mm);
    }
    job
}

/// Lines that ask for nothing, to keep the line busy, long and short.
pub fn chatter(lines: u32) -> String {
    let line = |n| match n % 3 {
        0 => format!("N{n} G21 G90 (of no consequence)\n"),
        1 => format!("N{n}\n"),
        _ => format!("N{n} G17\n"),
    };
    (1..=lines).map(line).collect()
}
