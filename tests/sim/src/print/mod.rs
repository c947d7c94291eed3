//! Runs a print from boot to standstill: a file of a slicer, sent as printing hosts send it, to a printer with heaters.
//!
//! | module | contents |
//! |---|---|
//! | [`reading`] | the end of each line, and its heater commands |
//! | [`path`] | whether every step is on the path from line to line |
//! | [`session`] | a printing host: line numbers, checksums, one line in flight |
//! | [`heat`] | the temperatures of the print, and how well they were held |
//!
//! Settings are given to a twin, a second machine, so that the print begins with what a start finds in EEPROM. Steps
//! count from the last G28.

mod heat;
mod path;
pub mod reading;
mod session;

use anyhow::{Context, Result, bail, ensure};
use kerf::boards::{Board, MOTORS};

use crate::by_name;
use crate::job::{self, BOOT_MS, Lines, Options};
use crate::machine::Machine;
use crate::oracle::{Outcome, Setup, Unclear};
use crate::pauses::Scale;
use crate::report::{Measured, Report};
use crate::thermal::{BED, HOT_END};
use crate::trace::Trace;

pub use heat::Heat;
pub use path::{Followed, Place};
use reading::{Asked, Corner};
use session::Session;

/// Selects the machine whose settings a print gets if the image is for the machine `careful`.
const PRINTER: &str = "{mch:3}";
/// Longest time of an answer, ms.
const LINE_MS: u64 = 120_000;
const HEAT_MS: u64 = 20 * 60_000;
/// Time without a step after which motion has ended.
const STILL_MS: u64 = 200;

/// Whether lines are a print, on a board that can print.
pub fn is_print(board: &Board, lines: &Lines) -> bool {
    let has = |feature| board.features.contains(&feature);
    let prints = has("dialect-reprap") && board.heaters.is_some();
    prints && lines.iter().any(|(_, line)| reading::is_printing(line))
}

/// Starts a second machine like this one and sends it the settings. Returns that machine, whose EEPROM has the
/// settings, and its setup.
fn twin(machine: &Machine, lines: &Lines, settings: &[String]) -> Result<(Machine, Setup)> {
    let mut twin = Machine::new(machine.image().clone(), machine.board())?;
    by_name::boot(&mut twin)?;
    let careful = by_name::value(&mut twin, "mch")?.as_i64() == Some(0);
    let own = careful.then_some(PRINTER).into_iter().chain(job::going_on(lines));
    for setting in own.chain(settings.iter().map(String::as_str)) {
        by_name::set(&mut twin, setting)?;
    }
    let setup = by_name::read_setup(&mut twin)?;
    Ok((twin, setup))
}

/// The state of a print while it runs.
struct Run<'a> {
    machine: &'a mut Machine,
    session: Session,
    setup: Setup,
    corners: Result<Vec<Corner>, Unclear>,
    heat: heat::Meter,
    /// The line from whose end steps count.
    home: usize,
    began: u64,
    progress_at: u64,
}

/// Boots the machine, prints and returns the report. An error means that the print could not begin; later problems are
/// in the report. `progress` gets the number of lines answered so far.
pub fn run(
    machine: &mut Machine,
    lines: &Lines,
    options: &Options,
    mut progress: impl FnMut(usize),
) -> Result<Report> {
    ensure!(options.baud.is_none(), "a print is sent at 115,200 baud");
    let (twin, setup) = twin(machine, lines, &options.settings)?;
    machine.set_eeprom(twin.eeprom());
    machine.build(&crate::mechanics::Build::printer(machine.board(), &setup));
    machine.build_heaters();
    machine.recorder_mut().keep_log();
    let mut session = Session::new();
    session.boot(machine, BOOT_MS)?;
    let began = machine.cycle();
    let trace = options.vcd.as_deref().map(|path| {
        let clock_hz = machine.board().clock_hz;
        Trace::create(path, clock_hz, began)
    });
    machine.set_trace(trace.transpose()?);
    machine.meters_mut().clear();
    let corners = reading::read(lines);
    let heat = heat::Meter::default();
    let (home, progress_at) = (0, began);
    let mut run = Run { machine, session, setup, corners, heat, home, began, progress_at };
    run.count_from(0);
    let end = run.stream(lines, &mut progress).and_then(|()| run.settle());
    if let Some(trace) = run.machine.set_trace(None) {
        trace.finish()?;
    }
    Ok(run.report(lines.len(), end))
}

impl Run<'_> {
    fn stream(&mut self, lines: &Lines, progress: &mut impl FnMut(usize)) -> Result<()> {
        self.session.set_number(self.machine, LINE_MS)?;
        for (n, (number, text)) in lines.iter().enumerate() {
            let line = reading::without_comment(text);
            if !line.is_empty() {
                self.asked(line);
                self.session.say(self.machine, *number, line, HEAT_MS)?;
                self.progress_at = self.machine.cycle();
                self.answered(n);
            }
            progress(n + 1);
        }
        self.session.say(self.machine, 0, "M400", LINE_MS)
    }

    fn asked(&mut self, line: &str) {
        let now = self.machine.cycle();
        match reading::asked(line) {
            Asked::HotEnd(degrees) => self.heat.asked(HOT_END, degrees, now),
            Asked::Bed(degrees) => self.heat.asked(BED, degrees, now),
            Asked::Nothing => {}
        }
    }

    /// Takes the answer to line `n`. If the line homes, steps count from its end.
    fn answered(&mut self, n: usize) {
        if self.corners.as_ref().is_ok_and(|corners| corners[n].homes) {
            self.count_from(n);
        }
    }

    /// Counts steps from here, where the machine stands at the end of a line.
    fn count_from(&mut self, corner: usize) {
        self.home = corner;
        let ends = self.ends();
        let motors = self.setup.motors.iter().enumerate();
        let active_low = motors.fold(0, |bits, (m, motor)| bits | u8::from(motor.active_low) << m);
        let scale = Scale {
            clock_hz: f64::from(self.machine.board().clock_hz),
            motors: self.setup.travels(),
            ends: ends.into_iter().map(|(line, place)| (line, self.at_pins(place))).collect(),
        };
        let recorder = self.machine.recorder_mut();
        recorder.set_active_low(active_low);
        recorder.clear();
        recorder.meter_pauses(scale);
    }

    fn at_pins(&self, place: Place) -> Place {
        let inverted = |m: usize| self.setup.motors[m].inverted;
        std::array::from_fn(|m| if inverted(m) { -place[m] } else { place[m] })
    }

    /// Returns where each line behind the last homing ends, in steps from the end of the homing.
    fn ends(&self) -> Vec<(usize, Place)> {
        let corners = self.corners.as_deref().unwrap_or_default();
        let Some(home) = corners.get(self.home) else { return Vec::new() };
        // Steps count from the end of a homing; in a print that does not home they count from 0.
        let from = |m: usize| {
            let motor = &self.setup.motors[m];
            if home.homes { motor.steps(home.position[motor.axis]) } else { 0 }
        };
        let first = if home.homes { self.home + 1 } else { 0 };
        let end = |corner: &Corner| {
            let steps = |m: usize| {
                let motor = &self.setup.motors[m];
                motor.steps(corner.position[motor.axis]) - from(m)
            };
            (corner.line, std::array::from_fn(steps))
        };
        corners.iter().skip(first).map(end).collect()
    }

    /// Waits until no motor steps any more.
    fn settle(&mut self) -> Result<()> {
        let end = self.machine.cycle() + self.machine.cycles(LINE_MS);
        let still = self.machine.cycles(STILL_MS);
        loop {
            self.session.run_for_ms(self.machine, STILL_MS / 4)?;
            let now = self.machine.cycle();
            let moved = self.machine.recorder().last_step().unwrap_or(0);
            if now - moved.max(self.progress_at) > still {
                return Ok(());
            }
            if now > end {
                bail!("does not come to rest");
            }
        }
    }

    fn expected(&self) -> Result<Outcome, Unclear> {
        let corners = self.corners.as_ref().map_err(Clone::clone)?;
        let steps = self.ends().last().map_or(Place::default(), |(_, place)| *place);
        Ok(Outcome {
            position: corners.last().map(|corner| corner.position).unwrap_or_default(),
            steps: steps.to_vec(),
            // The whole path is compared.
            least: vec![0; MOTORS],
            longest_dwell_ms: 0,
        })
    }

    fn report(mut self, lines: usize, end: Result<()>) -> Report {
        let moved = self.machine.recorder().last_step().unwrap_or(self.began);
        let idle_at = moved.max(self.progress_at);
        let up: [bool; MOTORS] = std::array::from_fn(|m| !self.setup.motors[m].inverted);
        let log = self.machine.recorder().log();
        let followed = path::follow(log, Place::default(), &self.ends(), up, path::ROUNDED);
        let seconds = |cycle: u64| self.machine.seconds(cycle.saturating_sub(self.began));
        let (to_idle, to_answer) = (seconds(idle_at), seconds(self.progress_at));
        let mut report = Report::new(
            self.machine,
            Measured {
                lines,
                acknowledged: if end.is_ok() { lines } else { self.session.answered() },
                skipped: 0,
                rejected: self.session.take_rejected(),
                restarts: self.session.starts(),
                late_segments: Some(self.session.late()),
                strays: self.session.strays().to_vec(),
                seconds_to_idle: to_idle,
                seconds_to_answer: to_answer,
                setup: self.setup.clone(),
                expected: self.expected(),
                fault: end.err().map(|e| format!("{e:#}")),
            },
        );
        let heat = self.heat.heat(self.machine, self.began);
        let followed = self.corners.is_ok().then_some(followed);
        report.add_print(followed, heat, self.session.take_told());
        report
    }
}

/// Returns where a print that does not home ends, in steps of each motor from where it began.
pub fn end_of(lines: &Lines, setup: &Setup) -> Result<Vec<i64>> {
    let corners = reading::read(lines)?;
    let last = corners.last().context("a print without lines")?;
    Ok(setup.motors.iter().map(|motor| motor.steps(last.position[motor.axis])).collect())
}
