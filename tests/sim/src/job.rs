//! Runs a job from boot to standstill, and checks it.

mod setup;
mod watch;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use kerf::boards::MOTORS;

use crate::host::{Host, LINES_IN_FLIGHT};
use crate::machine::Machine;
use crate::oracle::{self, Outcome, Setup, Unclear};
use crate::pauses::Scale;
use crate::protocol::STATUS_NOOP;
use crate::report::{Measured, Rejected, Report};
use crate::runs::Runs;
use crate::speech::Speech;
use crate::trace::Trace;

pub use setup::{read_setup, read_travels, setup_of};
pub(crate) use watch::{POLL, Watch};

/// Longest time of a reset, ms of AVR time.
pub(crate) const BOOT_MS: u64 = 5_000;
/// Longest time of a setting, ms of AVR time.
const ASK_MS: u64 = 5_000;
/// Longer than the time between two bytes that are written to the EEPROM, ms.
const PUT_AWAY_MS: u64 = 100;

/// The lines of a job, each with its number in the file.
pub type Lines = Vec<(usize, String)>;

/// The options of a run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Speed of the serial line that the firmware is told to change to after boot, before the settings.
    pub baud: Option<u32>,
    /// Settings to send first; each must be accepted.
    pub settings: Vec<String>,
    /// Lines in flight.
    pub in_flight: usize,
    /// Where to write the step and direction signals.
    pub vcd: Option<PathBuf>,
    /// Real-time characters, each with the time in the job at which it is sent, ms; the earliest first.
    pub interjections: Vec<(u64, u8)>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            baud: None,
            settings: Vec::new(),
            in_flight: LINES_IN_FLIGHT,
            vcd: None,
            interjections: Vec::new(),
        }
    }
}

impl Options {
    /// Options with these settings. `{baud:N}` becomes the speed of the line, because the sender has to follow it.
    pub fn with_settings(settings: impl Iterator<Item = String>) -> Self {
        let mut options = Self::default();
        for setting in settings {
            match setting.strip_prefix("{baud:") {
                Some(rate) => options.baud = rate.trim_end_matches('}').parse().ok(),
                None => options.settings.push(setting),
            }
        }
        options
    }
}

/// Splits G-code text into the lines that a sender sends. Leaves out blank lines, and `%`, which would flush the
/// queue.
pub fn lines_of(text: &str) -> Lines {
    let numbered = text.lines().enumerate().map(|(i, l)| (i + 1, l.trim()));
    numbered
        .filter(|(_, l)| !l.is_empty() && !l.starts_with('%'))
        .map(|(i, l)| (i, l.to_string()))
        .collect()
}

/// Reads a job from a file.
pub fn read_lines(path: &Path) -> Result<Lines> {
    let name = path.display();
    let bytes = fs::read(path).with_context(|| format!("cannot read {name}"))?;
    let lines = lines_of(&String::from_utf8_lossy(&bytes));
    if lines.is_empty() {
        bail!("{name} has no lines to send");
    }
    Ok(lines)
}

/// The state of a job while it runs.
struct Run<'a> {
    machine: &'a mut Machine,
    host: Host,
    setup: Setup,
    expected: Result<Outcome, Unclear>,
    longest_dwell_ms: u64,
    acknowledged: usize,
    skipped: usize,
    rejected: Vec<Rejected>,
    began: u64,
    progress_at: u64,
}

/// Waits until the settings are in the EEPROM, so that all jobs begin under equal conditions. While the settings are
/// being written, a motor that is not the dominant one may step 0.7 us off its usual time, because each read of the
/// EEPROM halts the CPU.
pub(crate) fn put_away(machine: &mut Machine, host: &mut Host) -> Result<()> {
    let mut writes = None;
    while writes.replace(machine.eeprom_writes()) != Some(machine.eeprom_writes()) {
        host.run_for_ms(machine, PUT_AWAY_MS)?;
    }
    Ok(())
}

/// Detects pauses from now on. The machine must stand still at the start of `lines`.
pub fn meter_pauses(machine: &mut Machine, lines: &Lines, setup: &Setup) {
    let ends = oracle::ends(lines.iter().map(|(n, l)| (*n, l.as_str())), setup);
    let at_pins = |steps: Vec<i64>| -> [i64; MOTORS] {
        std::array::from_fn(|m| if setup.motors[m].inverted { -steps[m] } else { steps[m] })
    };
    let scale = Scale {
        clock_hz: f64::from(machine.board().clock_hz),
        motors: setup.travels(),
        ends: ends.into_iter().map(|(line, steps)| (line, at_pins(steps))).collect(),
    };
    machine.recorder_mut().meter_pauses(scale);
}

/// Setting for programs that wait for an operator: the simulator has none, so the firmware resumes by itself.
const GO_ON: &str = "{psw:0}";

/// Whether a line has a code that may wait for an operator.
fn may_wait(line: &str) -> bool {
    let line = line.split(['(', ';']).next().unwrap_or_default().to_ascii_uppercase();
    let line: String = line.chars().filter(|c| !c.is_whitespace()).collect();
    let codes = line.split('M').skip(1);
    let numbers = codes.filter_map(|rest| rest.split(|c: char| !c.is_ascii_digit()).next());
    numbers.filter_map(|digits| digits.parse::<u32>().ok()).any(|n| matches!(n, 0 | 1 | 6 | 60))
}

/// Returns the setting that a job needs in front of its own: [`GO_ON`], if its lines have a code that may wait for an
/// operator.
pub(crate) fn going_on(lines: &Lines) -> Option<&'static str> {
    lines.iter().any(|(_, line)| may_wait(line)).then_some(GO_ON)
}

/// Sends settings, each of which must be accepted. If the lines have a code that may wait for an operator, also sends
/// [`GO_ON`].
pub(crate) fn ask_settings(
    machine: &mut impl Runs,
    host: &mut Host,
    lines: &Lines,
    settings: &[String],
) -> Result<()> {
    for line in going_on(lines).into_iter().chain(settings.iter().map(String::as_str)) {
        let response = host.ask(machine, line, ASK_MS)?;
        if response.status != 0 {
            bail!("the firmware refuses {line} with status {}: {}", response.status, response.raw);
        }
    }
    Ok(())
}

/// Why the rate of the line cannot be changed.
const NO_BAUD: &str = "a job in grbl's dialect is sent at 115,200 baud";

/// Returns the dialect in which jobs are sent to a machine.
pub fn speech_of(machine: &Machine) -> Result<Speech> {
    let board = machine.board();
    let speech = Speech::of(board.features);
    speech.with_context(|| {
        format!("jobs are sent in TinyG's or grbl's dialect, which the board {} lacks", board.name)
    })
}

/// Boots the machine, runs a job on it and returns the report. An error means that the job could not begin; later
/// problems are in the report. `progress` gets the number of lines answered so far.
pub fn run(
    machine: &mut Machine,
    lines: &Lines,
    options: &Options,
    mut progress: impl FnMut(usize),
) -> Result<Report> {
    let speech = speech_of(machine)?;
    ensure!(speech == Speech::TinyG || options.baud.is_none(), "{NO_BAUD}");
    let mut host = Host::new(options.in_flight).speaking(speech);
    host.boot(machine, BOOT_MS)?;
    if let Some(baud) = options.baud {
        host.change_speed(machine, baud)?;
    }
    ask_settings(machine, &mut host, lines, &options.settings)?;
    put_away(machine, &mut host)?;
    let setup = read_setup(machine, &mut host)?;
    let expected = oracle::run(lines.iter().map(|(n, l)| (*n, l.as_str())), &setup);
    let longest_dwell_ms =
        oracle::longest_dwell_ms(lines.iter().map(|(n, l)| (*n, l.as_str())), &setup);
    let began = machine.cycle();
    for (ms, byte) in &options.interjections {
        host.interject(began + machine.cycles(*ms), *byte);
    }
    let trace = options.vcd.as_deref().map(|path| {
        let clock_hz = machine.board().clock_hz;
        Trace::create(path, clock_hz, began)
    });
    machine.set_trace(trace.transpose()?);
    let active_low = setup.motors.iter().enumerate();
    let active_low = active_low.fold(0, |bits, (m, motor)| bits | u8::from(motor.active_low) << m);
    machine.recorder_mut().set_active_low(active_low);
    machine.recorder_mut().clear();
    meter_pauses(machine, lines, &setup);
    machine.meters_mut().clear();
    let banners = host.banners();
    let mut run = Run {
        machine,
        host,
        setup,
        expected,
        longest_dwell_ms,
        acknowledged: 0,
        skipped: 0,
        rejected: Vec::new(),
        began,
        progress_at: began,
    };
    let end = run.stream(lines, &mut progress).and_then(|()| run.settle());
    let late = run.late_segments();
    if let Some(trace) = run.machine.set_trace(None) {
        trace.finish()?;
    }
    let restarts = run.host.banners() - banners;
    Ok(run.report(lines.len(), restarts, late, end))
}

impl Run<'_> {
    fn stream(&mut self, lines: &Lines, progress: &mut impl FnMut(usize)) -> Result<()> {
        for (number, text) in lines {
            self.host.queue(*number, text);
        }
        let mut watch = watch::Watch::new(self.longest_dwell_ms);
        loop {
            self.machine.follow_pulses();
            let slice = self.machine.cycle() + self.machine.cycles(100);
            while self.host.run_until_line(self.machine, slice)? {
                self.collect(progress);
            }
            self.collect(progress);
            if self.host.is_done() {
                return Ok(());
            }
            watch.check(self.machine, &mut self.host, self.progress_at)?;
        }
    }

    fn collect(&mut self, progress: &mut impl FnMut(usize)) {
        for answered in self.host.take_answered() {
            if answered.number == watch::POLL {
                continue;
            }
            self.progress_at = self.machine.cycle();
            self.acknowledged += 1;
            self.skipped += usize::from(answered.response.status == STATUS_NOOP);
            if !answered.response.is_ok() {
                self.rejected.push(Rejected {
                    line: answered.number,
                    text: answered.text,
                    status: answered.response.status,
                });
            }
            progress(self.acknowledged);
        }
        self.host.take_reports();
    }

    /// Waits for the end of motion.
    fn settle(&mut self) -> Result<()> {
        let mut watch = watch::Watch::new(self.longest_dwell_ms);
        watch.settle(self.machine, &mut self.host)
    }

    /// Asks the firmware for its own count of late segments; `None` if it does not answer.
    fn late_segments(&mut self) -> Option<u64> {
        if self.host.speech() == Speech::Grbl {
            return Some(self.host.late());
        }
        self.host.ask(self.machine, "{stv:n}", ASK_MS).ok()?.body.get("stv")?.as_u64()
    }

    fn report(
        self,
        lines: usize,
        restarts: usize,
        late_segments: Option<u64>,
        end: Result<()>,
    ) -> Report {
        let moved = self.machine.recorder().last_step().unwrap_or(self.began);
        let idle_at = self.host.idle_since().unwrap_or(0).max(moved).max(self.progress_at);
        Report::new(
            self.machine,
            Measured {
                lines,
                acknowledged: self.acknowledged,
                skipped: self.skipped,
                rejected: self.rejected,
                restarts,
                late_segments,
                strays: self.host.strays().to_vec(),
                seconds_to_idle: self.machine.seconds(idle_at.saturating_sub(self.began)),
                seconds_to_answer: self.machine.seconds(self.progress_at - self.began),
                setup: self.setup,
                expected: self.expected,
                fault: end.err().map(|e| format!("{e:#}")),
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::{lines_of, may_wait};

    #[test]
    fn stops_are_found() {
        for line in ["M0", "g0 x1 m06 t1", "N5 M 60", "M01"] {
            assert!(may_wait(line), "{line}");
        }
        for line in ["M3 S100", "(M0)", "G0 X1 ; M6", "M8", "M30", "M02"] {
            assert!(!may_wait(line), "{line}");
        }
    }

    #[test]
    fn only_what_a_sender_sends() {
        let lines = lines_of("%\n\nG0 X1  \r\n (note)\n%\n");
        assert_eq!(lines, [(3, "G0 X1".to_string()), (4, "(note)".to_string())]);
    }
}
