//! The rows of `pico`, whose chip is emulated. The targets are what users may expect of a chip like the RP2040.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use kerf::boards::{Board, PICO, PICO6};

use super::Better::{Higher, Lower};
use super::axes::{self, Measured};
use super::ringing::{self, Amplitude};
use super::workload::{How, USUAL_JERK, disturbances, settings};
use super::{Figure, Row, corpus, ideal, pauses, spiral};
use crate::emulated::even::{FAST, evenness};
use crate::emulated::{Emulated, Recorded, job};
use crate::host::{Host, LINES_IN_FLIGHT};
use crate::job::{Options, lines_of, read_setup};
use crate::limits;
use crate::machine::USB;
use crate::runs::Runs;

/// Cycles of the CPU in a microsecond.
const PER_US: f64 = 128.0;
/// The exception that exec runs in: SWI_IRQ_1.
const EXEC: usize = 16 + 27;
const NONE: [&str; 3] = ["-"; 3];
/// Time of a sample of the means, s.
const SAMPLE_S: f64 = 0.002;

/// A row whose floor is its target.
const fn row(
    name: &'static str,
    what: &'static str,
    unit: &'static str,
    measure: fn(&PicoBed) -> Result<Figure>,
) -> Row<PicoBed> {
    Row {
        name,
        what,
        unit,
        decimals: 0,
        better: Higher,
        peers: NONE,
        target: None,
        floor: None,
        measure,
    }
}

/// The table.
pub const ROWS: [Row<PicoBed>; 23] = [
    Row {
        target: Some(1e6),
        floor: Some(1e6),
        ..row("rate-1", "rate held, 1 motor", "steps/s", one)
    },
    Row {
        target: Some(1e6),
        floor: Some(1e6),
        ..row("rate-4", "rate held, 4 motors, each", "steps/s", four)
    },
    Row {
        target: Some(500e3),
        floor: Some(500e3),
        ..row("rate-6", "rate held, 6 motors, each (pico6)", "steps/s", six)
    },
    Row {
        better: Lower,
        target: Some(8.0),
        floor: Some(0.0),
        ..row("jitter", "jitter of the leading motor at 1,000,000", "ns", leading)
    },
    Row {
        better: Lower,
        decimals: 2,
        target: Some(1.0),
        floor: Some(1.0),
        ..row("jitter-minor", "a step of another motor is off by", "us", minor)
    },
    Row {
        target: Some(10e3),
        floor: Some(15e3),
        ..row("lines", "lines of 0.05 mm in a second by USB", "lines/s", lines)
    },
    Row {
        target: Some(10e3),
        floor: Some(10e3),
        ..row("lines-xy", "lines of 0.05 mm with G1, X and Y", "lines/s", lines_xy)
    },
    Row {
        target: Some(7e3),
        floor: Some(5.5e3),
        ..row("lines-xyzf", "lines of 0.05 mm with X, Y, Z and F", "lines/s", lines_xyzf)
    },
    Row {
        better: Lower,
        decimals: 3,
        target: Some(1.01),
        floor: Some(1.01),
        ..row("spiral-0.1", "moves of 0.1 mm, over ideal", "", tenth)
    },
    Row {
        better: Lower,
        decimals: 3,
        target: Some(1.02),
        // On a curve near its limit, corners leave less of the acceleration to a longer mean.
        floor: Some(1.05),
        ..row("spiral-0.1-jerk", "moves of 0.1 mm under a jerk limit, over none", "", tenth_jerk)
    },
    Row {
        better: Lower,
        decimals: 1,
        target: Some(4.0),
        floor: Some(3.0),
        ..row("exec", "exec's share of the CPU, 1,000 slices a second", "%", exec)
    },
    Row {
        better: Lower,
        target: None,
        floor: Some(12_500.0),
        ..row("segment-jerk", "exec of a sample of 2 ms under a jerk limit, mean", "cycles", sample)
    },
    Row {
        better: Lower,
        // 1.3 times the mean.
        target: Some(13_700.0),
        floor: Some(25_500.0),
        ..row("segment-jerk-worst", "a run of exec under a jerk limit, worst", "cycles", run)
    },
    Row {
        better: Lower,
        decimals: 2,
        target: Some(1.02),
        floor: Some(1.02),
        ..row("axes-ac", "acceleration of an axis over its limit, jobs", "x", axes_acceleration)
    },
    Row {
        better: Lower,
        decimals: 2,
        target: Some(2.1),
        floor: Some(2.1),
        ..row("axes-jerk", "jerk of an axis over its limit, jobs", "x", axes_jerk)
    },
    Row {
        better: Lower,
        target: Some(50.0),
        floor: Some(50.0),
        ..row("axes-off", "the tool is off the programmed path, jobs", "um", axes_off)
    },
    Row {
        better: Lower,
        decimals: 1,
        floor: Some(170.0),
        ..row("axes-time", "time of these jobs", "s", axes_time)
    },
    Row {
        better: Lower,
        decimals: 1,
        target: Some(1.5),
        floor: Some(0.6),
        ..row("ring-mean", "a load rings behind a mean, at the resonance", "%", ring_mean)
    },
    Row {
        better: Lower,
        decimals: 1,
        target: Some(8.0),
        floor: Some(1.6),
        ..row("ring-mean-near", "a load rings behind a mean, within 20 %", "%", ring_mean_near)
    },
    Row {
        better: Lower,
        decimals: 1,
        target: Some(0.7),
        floor: Some(0.3),
        ..row("ring-ei", "a load rings behind EI, at the resonance", "%", ring_ei)
    },
    Row {
        better: Lower,
        decimals: 1,
        target: Some(2.5),
        floor: Some(0.7),
        ..row("ring-ei-near", "a load rings behind EI, within 20 %", "%", ring_ei_near)
    },
    Row {
        better: Lower,
        target: Some(0.0),
        floor: Some(0.0),
        ..row("pauses-none", "late segments of jobs without a jerk limit", "", pauses_none)
    },
    Row {
        better: Lower,
        target: Some(0.0),
        floor: Some(0.0),
        ..row("pauses-5000", "late segments of jobs under a jerk limit", "", pauses_usual)
    },
];

/// Returns the row of this name.
pub fn named(name: &str) -> Option<&'static Row<PicoBed>> {
    ROWS.iter().find(|row| row.name == name)
}

/// The image of `pico`. The image of the board with six motors lies in the same folder.
pub struct PicoBed {
    elf: PathBuf,
    /// What was measured in the corpus of jobs. Several rows share it, because it takes minutes.
    corpus: OnceCell<Corpus>,
    /// How a load rings, which the rows of ringing share.
    ringing: OnceCell<Ringing>,
}

/// The amplitudes behind the moves of the job of `ringing`.
#[derive(Clone, Copy)]
struct Ringing {
    /// Without means.
    exact: Amplitude,
    /// Without a filter.
    means: Amplitude,
    /// With each kind of filter.
    shaped: [Amplitude; 2],
}

/// The measurements of all jobs of the corpus.
#[derive(Default)]
struct Corpus {
    motion: Vec<Measured>,
    exec: Vec<Exec>,
}

/// What exec takes in a job, cycles.
struct Exec {
    name: &'static str,
    /// For each sample of the means, over the whole job.
    mean: f64,
    /// In its longest run.
    worst: f64,
    /// Its runs, for each sample.
    runs: f64,
}

impl PicoBed {
    /// A bed for the ELF file at `path`.
    pub fn new(path: &Path) -> Self {
        PicoBed { elf: path.to_path_buf(), corpus: OnceCell::new(), ringing: OnceCell::new() }
    }

    /// Returns the measurements of the corpus of jobs.
    fn corpus(&self) -> Result<&Corpus> {
        if self.corpus.get().is_none() {
            let corpus = measured(self)?;
            return Ok(self.corpus.get_or_init(|| corpus));
        }
        self.corpus.get().context("nothing is measured")
    }

    /// Returns how a load rings.
    fn ringing(&self) -> Result<&Ringing> {
        if self.ringing.get().is_none() {
            let of = |mode, kind| rings(self, mode, kind);
            let shaped = [of("g64", Some(0))?, of("g64", Some(1))?];
            let ringing = Ringing { exact: of("g61", None)?, means: of("g64", None)?, shaped };
            return Ok(self.ringing.get_or_init(|| ringing));
        }
        self.ringing.get().context("nothing is measured")
    }

    /// Returns a board that has greeted and has these settings.
    fn board(&self, board: &'static Board, settings: &[String]) -> Result<(Emulated, Host)> {
        let elf = self.elf.with_file_name(format!("{}.elf", board.name));
        let (mut board, mut host) = (Emulated::load(&elf, board)?, Host::new(LINES_IN_FLIGHT));
        host.boot(&mut board, 1_000)?;
        for line in settings {
            ask(&mut board, &mut host, line)?;
        }
        Ok((board, host))
    }
}

/// Sends a line; an error if the firmware refuses the line.
fn ask(board: &mut Emulated, host: &mut Host, line: &str) -> Result<()> {
    let response = host.ask(board, line, 5_000)?;
    ensure!(response.is_ok(), "{line} is answered by {}", response.raw);
    Ok(())
}

fn fast() -> Vec<String> {
    FAST.map(str::to_owned).to_vec()
}

/// Records the edges of steps in 5 ms of the cruise of a move.
fn cruise(bed: &PicoBed, board: &'static Board, more: &[&str], line: &str) -> Result<Recorded> {
    let settings: Vec<_> = fast().into_iter().chain(more.iter().map(|s| s.to_string())).collect();
    let (mut board, mut host) = bed.board(board, &settings)?;
    ask(&mut board, &mut host, line)?;
    host.run_for_ms(&mut board, 108)?;
    board.record_for_ms(5)
}

/// Returns the lowest step rate of the motors that move. An error unless exactly `motors` motors move.
fn rate(recorded: &Recorded, motors: usize) -> Result<Figure> {
    let moving = recorded.times.iter().filter(|times| times.len() > 1);
    let rates: Vec<_> = moving.map(|times| evenness(times).0).collect();
    ensure!(rates.len() == motors, "{} motors move", rates.len());
    let lowest = rates.into_iter().fold(f64::INFINITY, f64::min);
    // Rounded to 10 steps/s, the resolution of a slope over so few steps.
    Ok(Figure { value: (lowest / 10.0).round() * 10.0, note: String::new() })
}

fn one(bed: &PicoBed) -> Result<Figure> {
    rate(&cruise(bed, &PICO, &[], "g0 x100")?, 1)
}

fn four(bed: &PicoBed) -> Result<Figure> {
    rate(&cruise(bed, &PICO, &[], "g0 x100 y100 z100 a100")?, 4)
}

/// Six motors: X, A, and two motors each of Y and Z.
fn six(bed: &PicoBed) -> Result<Figure> {
    let more = ["{5ma:1,5tr:1.25,6ma:2,6tr:1.25}"];
    rate(&cruise(bed, &PICO6, &more, "g1 f46875 x60 y60 z60 a60")?, 6)
}

/// Four motors, each at its own rate.
const UNLIKE: &str = "g0 x100 y87.3 z-61.8 a29";

fn leading(bed: &PicoBed) -> Result<Figure> {
    let recorded = cruise(bed, &PICO, &[], UNLIKE)?;
    let first = recorded.times.first().context("no motor")?;
    Ok((evenness(first).1 as f64 * 1e3 / PER_US).into())
}

fn minor(bed: &PicoBed) -> Result<Figure> {
    let recorded = cruise(bed, &PICO, &[], UNLIKE)?;
    Ok(recorded.times.iter().map(|times| evenness(times).2).fold(0.0, f64::max).into())
}

/// Lines that are accepted in a second. The moves are too short for motion to limit the rate. Each line must be
/// accepted and each move made.
fn lines(bed: &PicoBed) -> Result<Figure> {
    stream(bed, [64, 0, 0], |n| format!("x{:.2}\n", n * 0.05))
}

fn lines_xy(bed: &PicoBed) -> Result<Figure> {
    let line = |n| format!("g1 x{:.3} y{:.3}\n", n * 0.05, n * 0.05);
    stream(bed, [64, 64, 0], line)
}

fn lines_xyzf(bed: &PicoBed) -> Result<Figure> {
    let speed = |n: f64| 40_000.0 - 50.0 * (n % 2.0);
    let line = |n| format!("x{:.3} y{:.3} z{:.3} f{}\n", n * 0.05, n * 0.05, n * 0.05, speed(n));
    stream(bed, [64; 3], line)
}

/// Sends lines, each of which moves the first motors by so many steps, and waits for their answers. Returns how many are
/// answered in a second.
fn stream(bed: &PicoBed, moves: [i64; 3], line: impl Fn(f64) -> String) -> Result<Figure> {
    const LINES: usize = 2_000;
    let (mut board, mut host) = bed.board(&PICO, &fast())?;
    ask(&mut board, &mut host, "g1f40000")?;
    let text: String = (1..=LINES).map(|n| line(n as f64)).collect();
    let (begun, mut heard) = (board.cycle(), Vec::new());
    let (thread, asleep) = (board.spent(0), board.asleep());
    board.send_to(USB, text.as_bytes());
    while heard.iter().filter(|byte| **byte == b'\n').count() < LINES {
        board.run_for_ms(1)?;
        heard.extend(board.receive_from(USB));
        ensure!(board.cycle() < begun + board.cycles(2_000), "{} bytes", heard.len());
    }
    let cycles = (board.cycle() - begun) as f64;
    let busy = 100.0 * (board.spent(0) - thread) / cycles;
    let idle = 100.0 * (board.asleep() - asleep) / cycles;
    let heard = String::from_utf8(heard)?;
    let taken = |line: &&str| line.starts_with("{\"r\":") && line.contains("\"f\":[1,0,");
    let taken = heard.lines().filter(taken).count();
    ensure!(taken == LINES, "{taken} lines are taken");
    board.run_for_ms(3_000)?;
    let steps = &board.positions()[..3];
    ensure!(steps == moves.map(|motor| LINES as i64 * motor), "{steps:?} steps");
    let value = LINES as f64 / (cycles / PER_US / 1e6);
    Ok(Figure {
        value,
        note: format!("thread mode takes {busy:.0} % of the CPU, {idle:.0} % are idle"),
    })
}

/// Returns a board that has just begun a spiral of 2,000 moves of 0.1 mm at 6,000 mm/min.
fn begun(bed: &PicoBed, jerk: Option<f64>) -> Result<Emulated> {
    let (mut board, _) = bed.board(&PICO, &settings(How { jerk, ..How::default() }, true))?;
    board.send_to(USB, spiral(0.1).as_bytes());
    while board.totals() == [0; 4] {
        board.run_for_ms(1)?;
        ensure!(board.cycle() < board.cycles(10_000), "nothing moves");
    }
    Ok(board)
}

/// How long the spiral of [`begun`] takes from its first step to its last, s.
fn seconds(bed: &PicoBed, jerk: Option<f64>) -> Result<f64> {
    let mut board = begun(bed, jerk)?;
    let start = board.cycle();
    board.run_for_ms(3_000)?;
    let last = board.last_step().context("no step")?;
    ensure!(board.cycle() - last > board.cycles(100), "it has not ended");
    Ok((last - start) as f64 / PER_US / 1e6)
}

fn tenth(bed: &PicoBed) -> Result<Figure> {
    Ok((seconds(bed, None)? / ideal(0.1)).into())
}

fn tenth_jerk(bed: &PicoBed) -> Result<Figure> {
    Ok((seconds(bed, Some(USUAL_JERK))? / seconds(bed, None)?).into())
}

/// Cycles of exec's handler, without the handlers that interrupt it. A move of 0.1 mm is a slice of one millisecond.
fn exec(bed: &PicoBed) -> Result<Figure> {
    let mut board = begun(bed, None)?;
    board.run_for_ms(500)?;
    let (from, before) = (board.cycle(), board.spent(EXEC));
    board.run_for_ms(1_000)?;
    let value = 100.0 * (board.spent(EXEC) - before) / (board.cycle() - from) as f64;
    ensure!(value > 0.1, "exec does not run");
    Ok(value.into())
}

/// Cycles that exec takes for a sample of the means, of the job in which that is most.
fn sample(bed: &PicoBed) -> Result<Figure> {
    cycles(bed, |exec| exec.mean)
}

/// Cycles of the longest run of exec. Nearly each run makes a sample.
fn run(bed: &PicoBed) -> Result<Figure> {
    cycles(bed, |exec| exec.worst)
}

fn cycles(bed: &PicoBed, value: fn(&Exec) -> f64) -> Result<Figure> {
    let all = &bed.corpus()?.exec;
    let told =
        all.iter().map(|exec| format!("{} {:.0} ({:.1} runs)", exec.name, value(exec), exec.runs));
    let note = told.collect::<Vec<_>>().join(", ");
    Ok(Figure { value: all.iter().map(value).fold(0.0, f64::max), note })
}

fn axes_acceleration(bed: &PicoBed) -> Result<Figure> {
    Ok(axes::acceleration_of(&bed.corpus()?.motion))
}

fn axes_jerk(bed: &PicoBed) -> Result<Figure> {
    Ok(axes::jerk_of(&bed.corpus()?.motion))
}

fn axes_off(bed: &PicoBed) -> Result<Figure> {
    Ok(axes::off_of(&bed.corpus()?.motion))
}

fn axes_time(bed: &PicoBed) -> Result<Figure> {
    Ok(axes::time_of(&bed.corpus()?.motion))
}

fn ring_mean(bed: &PicoBed) -> Result<Figure> {
    left(bed, 0, |amplitude| amplitude.here)
}

fn ring_mean_near(bed: &PicoBed) -> Result<Figure> {
    left(bed, 0, |amplitude| amplitude.near)
}

fn ring_ei(bed: &PicoBed) -> Result<Figure> {
    left(bed, 1, |amplitude| amplitude.here)
}

fn ring_ei_near(bed: &PicoBed) -> Result<Figure> {
    left(bed, 1, |amplitude| amplitude.near)
}

/// How much a load rings with a filter, in percent of that without means.
fn left(bed: &PicoBed, kind: usize, of: fn(&Amplitude) -> f64) -> Result<Figure> {
    let Ringing { exact, means, shaped } = bed.ringing()?;
    let value = 100.0 * of(&shaped[kind]) / of(exact);
    let note = format!(
        "{:.1} um under G61, {:.0} % of it without a filter",
        1e3 * of(exact),
        100.0 * of(means) / of(exact)
    );
    Ok(Figure { value, note })
}

/// Returns how much a load rings behind the moves of the job of `ringing`, with a filter of this kind.
fn rings(bed: &PicoBed, mode: &str, kind: Option<u8>) -> Result<Amplitude> {
    let mut settings: Vec<_> = ringing::SETTINGS.map(str::to_owned).to_vec();
    if let Some(kind) = kind {
        settings.push(format!("{{ist:{kind}}}"));
        settings.push(format!("{{isx:{}}}", ringing::HERTZ));
    }
    let options = Options { settings, ..Options::default() };
    let mut board = Emulated::load(&bed.elf, &PICO)?;
    board.begin_recording();
    let report = job::run(&mut board, &lines_of(&ringing::job(mode)), &options, |_| ())?;
    ensure!(report.problems.is_empty(), "{}", report.problems.join("; "));
    let steps = board.end_recording()?.steps(f64::from(PICO.clock_hz));
    let setup = read_setup(&mut board, &mut Host::new(1))?;
    Ok(ringing::amplitude(&steps, &setup))
}

/// Runs all jobs of the corpus.
fn measured(bed: &PicoBed) -> Result<Corpus> {
    let mut corpus = Corpus::default();
    for (name, text) in corpus::jobs() {
        let how = How { more: &axes::ROUTER, ..How::default() };
        let options = Options { settings: settings(how, true), ..Options::default() };
        let mut board = Emulated::load(&bed.elf, &PICO)?;
        board.begin_recording();
        let report = job::run(&mut board, &lines_of(&text), &options, |_| ())?;
        ensure!(report.problems.is_empty(), "{name}: {}", report.problems.join("; "));
        let steps = board.end_recording()?.steps(f64::from(PICO.clock_hz));
        let mut host = Host::new(1);
        let setup = read_setup(&mut board, &mut host)?;
        let limits = limits::asked(&mut board, &mut host, &setup);
        let motion = Measured::of(name, &text, &steps, &setup, &limits)?;
        let samples = motion.seconds / SAMPLE_S;
        corpus.exec.push(Exec {
            name,
            mean: board.spent(EXEC) / samples,
            worst: board.longest(EXEC),
            runs: board.runs(EXEC) / samples,
        });
        corpus.motion.push(motion);
    }
    Ok(corpus)
}

fn pauses_none(bed: &PicoBed) -> Result<Figure> {
    late(bed, None)
}

fn pauses_usual(bed: &PicoBed) -> Result<Figure> {
    late(bed, Some(USUAL_JERK))
}

/// Counts the segments that come late in all jobs. A job without late segments must end on its exact steps.
///
/// Holds and overrides come in every other job: without a jerk limit in one half of the jobs, under a jerk limit in
/// the other half. The emulator takes a minute for all jobs.
fn late(bed: &PicoBed, jerk: Option<f64>) -> Result<Figure> {
    let (mut sum, mut note) = (0, String::new());
    for (seed, (name, text)) in (1..).zip(&pauses::jobs()) {
        let disturbed = (seed + u64::from(jerk.is_some())) % 2 == 0;
        let options = Options {
            settings: settings(How { jerk, ..How::default() }, true),
            interjections: if disturbed { disturbances(seed) } else { Vec::new() },
            ..Options::default()
        };
        let mut board = Emulated::load(&bed.elf, &PICO)?;
        let report = job::run(&mut board, &lines_of(text), &options, |_| ())?;
        let problems = report.problems.join("; ");
        ensure!(problems.is_empty() || report.late > 0, "{name}: {problems}");
        sum += report.late;
        if report.late > 0 {
            let how = if disturbed { " with holds and overrides" } else { "" };
            note += &format!("{name}{how} {}, ", report.late);
        }
    }
    Ok(Figure { value: sum as f64, note })
}
