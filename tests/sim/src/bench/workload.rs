//! The firmware on its board with the settings of the other firmwares, and jobs for it.

use std::cell::OnceCell;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use kerf::boards::Board;

use super::axes::Measured;
use crate::host::{Host, LINES_IN_FLIGHT};
use crate::image::Image;
use crate::job::{self, Options};
use crate::machine::Machine;
use crate::mechanics::Random;
use crate::report::Report;
use crate::stopwatch::Stopwatch;

/// Steps per millimetre of X, Y and, in degrees, A.
pub const PER_MM: f64 = 80.0;
/// Steps per millimetre of Z.
pub const PER_MM_Z: f64 = 400.0;
/// Acceleration, mm/s2.
pub const ACCELERATION: f64 = 500.0;
/// An acceleration that does not limit short moves, mm/s2. Above it there would be a jerk limit.
pub const NO_LIMIT: f64 = 4_500.0;
/// The usual speed of the serial line, and a fast one, baud.
pub const USUAL_BAUD: u32 = 115_200;
/// See [`USUAL_BAUD`].
pub const FAST_BAUD: u32 = 500_000;

/// Time during which holds and overrides come, ms. After that the job runs undisturbed.
const DISTURBED_MS: u64 = 120_000;

/// Most lines in flight: as many as the firmware stores, so that the line is never idle.
const IN_FLIGHT: usize = 2 * LINES_IN_FLIGHT;

/// Bytes that the firmware's receive ring holds. More bytes might be lost while the planner is busy.
const RING: usize = 254;

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
/// Two jerk limits, millions of mm/min3: that of TinyG, under which the whole queue is needed to stop, and a usual
/// one.
pub const LOW_JERK: f64 = 20.0;
/// See [`LOW_JERK`].
pub const USUAL_JERK: f64 = 5_000.0;
/// mm/s3 in a million mm/min3.
pub const PER_JERK: f64 = 1e6 / 216e3;
/// Centripetal acceleration of 500 mm/s2 in corners; reports off.
const MORE: [&str; 2] = ["{ja:1800000}", "{sv:0,qv:0}"];
/// A jerk limit so high that ramps are trapezoids, millions of mm/min3.
const NO_JERK_LIMIT: f64 = 1_000_000.0;

/// The firmware and the board under it.
pub struct Bed {
    path: PathBuf,
    image: Image,
    board: &'static Board,
    /// Whether the firmware has a setting for acceleration.
    has_acceleration: bool,
    /// What was measured in the corpus of jobs. Several rows share it, because it takes a while.
    corpus: OnceCell<Vec<Measured>>,
}

/// Parameters of a job.
#[derive(Clone, Copy)]
pub struct How {
    /// Speed of the serial line, baud.
    pub baud: u32,
    /// Acceleration, mm/s2.
    pub acceleration: f64,
    /// Jerk limit, millions of mm/min3.
    pub jerk: Option<f64>,
    /// Whether the times of all steps are logged.
    pub log: bool,
    /// More settings, sent after the usual ones.
    pub more: &'static [&'static str],
    /// Seed of the holds and overrides that come during the job; `None` for none.
    pub disturbed: Option<u64>,
}

impl Default for How {
    fn default() -> Self {
        How {
            baud: USUAL_BAUD,
            acceleration: ACCELERATION,
            jerk: None,
            log: false,
            more: &[],
            disturbed: None,
        }
    }
}

impl Bed {
    /// A bed for the ELF file at `path`.
    pub fn new(path: &Path, board: &'static Board) -> Result<Self> {
        let image = Image::read(path)?;
        let (path, corpus) = (path.to_path_buf(), OnceCell::new());
        let mut bed = Bed { path, image, board, has_acceleration: true, corpus };
        if !board.features.contains(&"dialect-tinyg") {
            return Ok(bed);
        }
        let mut machine = bed.machine()?;
        let mut host = Host::new(LINES_IN_FLIGHT);
        host.boot(&mut machine, 1_000)?;
        bed.has_acceleration = host.ask(&mut machine, "{xac:n}", 1_000)?.status == 0;
        Ok(bed)
    }

    /// A bed for another board, whose image is in the same folder.
    pub fn beside(&self, board: &'static Board) -> Result<Self> {
        Self::new(&self.path.with_file_name(format!("{}.elf", board.name)), board)
    }

    /// Returns a machine in factory state.
    pub fn machine(&self) -> Result<Machine> {
        Machine::new(self.image.clone(), self.board)
    }

    /// Returns the settings that make this firmware comparable with the others.
    pub fn settings(&self, how: How) -> Vec<String> {
        settings(how, self.has_acceleration)
    }

    /// Returns what `measure` finds in the corpus of jobs. It is called once.
    pub(super) fn corpus(&self, measure: fn(&Bed) -> Result<Vec<Measured>>) -> Result<&[Measured]> {
        if self.corpus.get().is_none() {
            let measured = measure(self)?;
            return Ok(self.corpus.get_or_init(|| measured));
        }
        Ok(self.corpus.get().map(Vec::as_slice).unwrap_or_default())
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

    /// Runs a job; an error if anything goes wrong.
    pub fn run(&self, job: &str, how: How) -> Result<(Machine, Report)> {
        let (machine, report) = self.try_run(job, how, Vec::new())?;
        ensure!(report.ok, "{}", report.problems.join("; "));
        Ok((machine, report))
    }

    /// Runs a job under stopwatches, and returns its report however it goes.
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
        let interjections = how.disturbed.map_or_else(Vec::new, disturbances);
        let lines = job::lines_of(job);
        let longest = lines.iter().map(|(_, line)| line.len() + 1).max().unwrap_or(1);
        let in_flight = (RING / longest).clamp(LINES_IN_FLIGHT, IN_FLIGHT);
        let options = Options { baud, settings, in_flight, vcd: None, interjections };
        let report = job::run(&mut machine, &lines, &options, |_| {})?;
        Ok((machine, report))
    }
}

/// Returns the settings that make a firmware comparable, whether or not it has a setting for acceleration.
pub fn settings(how: How, has_acceleration: bool) -> Vec<String> {
    let mut all: Vec<String> = SETTINGS.iter().chain(&MORE).map(|s| s.to_string()).collect();
    let jerk = how.jerk.unwrap_or(NO_JERK_LIMIT);
    all.extend(["x", "y", "z", "a"].map(|axis| format!("{{{axis}jm:{jerk}}}")));
    if has_acceleration {
        let limit = |axis| format!("{{{axis}ac:{}}}", how.acceleration);
        all.extend(["x", "y", "z", "a"].map(limit));
    }
    all.extend(how.more.iter().map(|s| s.to_string()));
    all
}

/// Returns holds that are resumed, and overrides of feed and traverse, at random times.
pub fn disturbances(seed: u64) -> Vec<(u64, u8)> {
    const OVERRIDES: [u8; 8] = [0x90, 0x91, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97];
    let mut random = Random::new(seed);
    let (mut ms, mut all) = (100, Vec::new());
    while ms < DISTURBED_MS {
        ms += 30 + random.below(800);
        if random.below(2) == 0 {
            all.push((ms, b'!'));
            ms += 5 + random.below(300);
            all.push((ms, b'~'));
        } else {
            all.push((ms, OVERRIDES[random.below(8) as usize]));
        }
    }
    all
}

/// A straight path of `mm` in `count` equal moves at `feed` mm/min.
pub fn straight(count: u32, mm: f64, feed: f64) -> String {
    let mut job = format!("G1 F{feed}\n");
    for n in 1..=count {
        let _ = writeln!(job, "G1X{:.2}", f64::from(n) * mm);
    }
    job
}

/// Long and short lines that move nothing, which keep the serial line busy.
pub fn chatter(lines: u32) -> String {
    let line = |n| match n % 3 {
        0 => format!("N{n} G21 G90 (of no consequence)\n"),
        1 => format!("N{n}\n"),
        _ => format!("N{n} G17\n"),
    };
    (1..=lines).map(line).collect()
}

/// A chain of arcs whose radius grows from 0.4 mm to 18 mm, then a helix.
pub fn arcs() -> String {
    let (mut job, [x, y]) = half_circles(44, 1.095);
    let _ = writeln!(job, "G2 X{x:.4} Y{y:.4} Z-2 I6 J0 P3\nG0 Z0\nG0 X0 Y0");
    job
}

/// A chain of arcs whose radius grows from 0.4 mm to 5 mm.
pub fn small_arcs() -> String {
    half_circles(50, 1.053).0
}

/// A chain of half circles, two to the left and one to the right, each `growth` times as large as the half circle
/// before it. Returns the job and the point where it ends.
fn half_circles(count: u32, growth: f64) -> (String, [f64; 2]) {
    let mut job = String::from("G17 G64 G1 F5400\n");
    let (mut x, mut y, mut radius) = (0.0f64, 0.0f64, 0.4f64);
    for n in 0..count {
        let (sin, cos) = (f64::from(n) * 0.7).sin_cos();
        let (i, j) = (radius * cos, radius * sin);
        let code = if n.is_multiple_of(3) { 2 } else { 3 };
        let to = (x + 2.0 * i, y + 2.0 * j);
        let _ = writeln!(job, "G{code} X{:.4} Y{:.4} I{i:.4} J{j:.4}", to.0, to.1);
        ((x, y), radius) = (to, (radius * growth).min(18.0));
    }
    (job, [x, y])
}

/// A wavy ring in straight moves of about `mm`, at `feed` mm/min.
pub fn braid(mm: f64, feed: f64) -> String {
    let count = (240.0 / mm).round();
    let mut job = format!("G64 G1 F{feed}\n");
    for n in 0..=count as u32 {
        let angle = std::f64::consts::TAU * f64::from(n) / count;
        let radius = 30.0 + 8.0 * (7.0 * angle).sin();
        let _ = writeln!(job, "G1 X{:.3} Y{:.3}", radius * angle.cos(), radius * angle.sin());
    }
    job + "G0 X0 Y0\n"
}

/// Squares within squares, with corners of 1.2 mm radius.
pub fn pocket() -> String {
    const R: f64 = 1.2;
    let mut job = String::from("G17 G64 G1 F3300\n");
    for turn in 0..10 {
        let a = 2.0 + 1.9 * f64::from(turn);
        let b = a - R;
        let _ = writeln!(job, "G1 X{:.3} Y{:.3}", -a, -b);
        for (from, to, centre) in [
            ([-a, b], [-b, a], [R, 0.0]),
            ([b, a], [a, b], [0.0, -R]),
            ([a, -b], [b, -a], [-R, 0.0]),
            ([-b, -a], [-a, -b], [0.0, R]),
        ] {
            let _ = writeln!(job, "G1 X{:.3} Y{:.3}", from[0], from[1]);
            let [i, j] = centre;
            let _ = writeln!(job, "G2 X{:.3} Y{:.3} I{i} J{j}", to[0], to[1]);
        }
    }
    job + "G0 X0 Y0\n"
}
