//! A job on an emulated board, from boot to standstill, compared with the G-code.

use std::fmt::{self, Display, Formatter};

use anyhow::{Result, bail};

use super::Emulated;
use crate::host::Host;
use crate::job::{BOOT_MS, Lines, Options, POLL, Watch, ask_settings, read_setup};
use crate::oracle::{self, MotorSetup, Outcome, Unclear};
use crate::protocol::STATUS_NOOP;
use crate::runs::Runs;

/// The result of a job.
pub struct Report {
    /// The problems found.
    pub problems: Vec<String>,
    /// Segments that came late, as the firmware itself counts them.
    pub late: u64,
    lines: usize,
    motors: Vec<Motor>,
    unchecked: Option<String>,
    seconds: f64,
    load: f64,
}

struct Motor {
    steps: i64,
    expected: Option<i64>,
    /// The least steps in both directions together.
    least: Option<u64>,
    total: u64,
    highest_hz: Option<f64>,
}

/// Boots the board, sends settings and a job, and returns the result. `progress` gets the number of lines answered so
/// far. USB has no line speed to change, and no waveforms are written.
pub fn run(
    board: &mut Emulated,
    lines: &Lines,
    options: &Options,
    progress: impl FnMut(usize),
) -> Result<Report> {
    let mut host = Host::new(options.in_flight);
    host.boot(board, BOOT_MS)?;
    ask_settings(board, &mut host, lines, &options.settings)?;
    let setup = read_setup(board, &mut host)?;
    let numbered = || lines.iter().map(|(n, l)| (*n, l.as_str()));
    let expected = oracle::run(numbered(), &setup);
    let banners = host.banners();
    let (began, slept) = (board.cycle(), board.asleep());
    for (ms, byte) in &options.interjections {
        host.interject(began + board.cycles(*ms), *byte);
    }
    let mut problems = Vec::new();
    let mut watch = Watch::new(oracle::longest_dwell_ms(numbered(), &setup));
    let end = stream(board, &mut host, lines, &mut watch, &mut problems, progress)
        .and_then(|()| watch.settle(board, &mut host));
    problems.extend(end.err().map(|error| format!("{error:#}")));
    if host.banners() > banners || board.resets() > 0 {
        problems.push("the firmware has restarted".to_string());
    }
    let late = late_segments(board, &mut host);
    if late != Some(0) {
        problems.push("segments came late".to_string());
    }
    let cycles = (board.cycle() - began) as f64;
    let mut report = Report {
        problems,
        late: late.unwrap_or(0),
        lines: lines.len(),
        motors: motors(board, &setup.motors, &expected),
        unchecked: expected.err().map(|unclear| unclear.to_string()),
        seconds: cycles / f64::from(board.board().clock_hz),
        load: 1.0 - (board.asleep() - slept) / cycles,
    };
    report.hold_against();
    Ok(report)
}

/// Sends all lines; each refused line is a problem.
fn stream(
    board: &mut Emulated,
    host: &mut Host,
    lines: &Lines,
    watch: &mut Watch,
    problems: &mut Vec<String>,
    mut progress: impl FnMut(usize),
) -> Result<()> {
    lines.iter().for_each(|(number, text)| host.queue(*number, text));
    let (mut done, mut progress_at) = (0, board.cycle());
    loop {
        host.run_until_line(board, board.cycle() + board.cycles(100))?;
        for answered in host.take_answered() {
            if answered.number == POLL {
                continue;
            }
            (done, progress_at) = (done + 1, board.cycle());
            let status = answered.response.status;
            if !answered.response.is_ok() && status != STATUS_NOOP {
                let (number, text) = (answered.number, answered.text);
                problems.push(format!("line {number} is refused with status {status}: {text}"));
            }
            progress(done);
        }
        host.take_reports();
        if host.is_done() {
            return Ok(());
        }
        watch.check(board, host, progress_at)?;
    }
}

/// Asks the firmware for its own count of late segments; `None` if it does not answer.
fn late_segments(board: &mut Emulated, host: &mut Host) -> Option<u64> {
    host.ask(board, "{stv:n}", BOOT_MS).ok()?.body.get("stv")?.as_u64()
}

fn motors(
    board: &Emulated,
    setup: &[MotorSetup],
    expected: &Result<Outcome, Unclear>,
) -> Vec<Motor> {
    let (steps, totals, gaps) = (board.steps(), board.totals(), board.gaps());
    let motor = |(m, setup): (usize, &MotorSetup)| Motor {
        steps: if setup.inverted { -steps[m] } else { steps[m] },
        expected: expected.as_ref().ok().map(|outcome| outcome.steps[m]),
        least: expected.as_ref().ok().map(|outcome| outcome.least[m]),
        total: totals[m],
        highest_hz: gaps[m].map(|gap| 1.0 / gap),
    };
    setup.iter().enumerate().map(motor).collect()
}

impl Report {
    fn hold_against(&mut self) {
        for (m, motor) in self.motors.iter().enumerate() {
            let at_end = (motor.steps, motor.expected);
            self.problems.extend(oracle::faults(m + 1, at_end, (motor.total, motor.least)));
        }
    }
}

impl Display for Report {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Report { lines, seconds, load, .. } = self;
        writeln!(f, "{lines} lines in {seconds:.1} s, CPU {:.0} % busy", load * 100.0)?;
        for (m, motor) in self.motors.iter().enumerate().filter(|(_, motor)| motor.total > 0) {
            write!(f, "motor {}: {} steps, ", m + 1, motor.total)?;
            write!(f, "at {}", motor.steps)?;
            match motor.expected {
                Some(expected) if expected == motor.steps => write!(f, " as expected")?,
                Some(expected) => write!(f, " instead of {expected}")?,
                None => {}
            }
            writeln!(f, "; at most {:.0} steps/s", motor.highest_hz.unwrap_or(0.0))?;
        }
        if let Some(why) = &self.unchecked {
            writeln!(f, "ends are not checked: {why}")?;
        }
        for problem in &self.problems {
            writeln!(f, "problem: {problem}")?;
        }
        let ok = if self.problems.is_empty() { "OK" } else { "FAILED" };
        writeln!(f, "result: {ok}")
    }
}

/// Refuses the options that an emulated board does not support.
pub fn check(options: &[(&str, bool)]) -> Result<()> {
    for (name, given) in options {
        if *given {
            bail!("{name} is for simulated boards");
        }
    }
    Ok(())
}
