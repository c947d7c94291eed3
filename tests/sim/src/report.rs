//! The report of a job, as data.

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

use crate::machine::Machine;
use crate::meters::Window;
use crate::oracle::{self, AXES, MotorSetup, Outcome, Setup, UNITS, Unclear};
use crate::pauses::Pause;
use crate::print::{Followed, Heat};
use crate::recorder::Motor;
use crate::threads::Threads;

const AXIS_NAMES: [char; AXES] = ['X', 'Y', 'Z', 'A', 'B', 'C'];

/// A line that the firmware refused.
#[derive(Clone, Serialize, Debug)]
pub struct Rejected {
    /// Its number in the job.
    pub line: usize,
    /// Text of the line.
    pub text: String,
    /// Status with which the firmware refused it.
    pub status: i64,
}

/// The results of the job's runner.
pub struct Measured {
    /// Lines in the job.
    pub lines: usize,
    /// Lines answered.
    pub acknowledged: usize,
    /// Lines skipped by block delete.
    pub skipped: usize,
    /// Lines refused.
    pub rejected: Vec<Rejected>,
    /// Banners that came while the job ran.
    pub restarts: usize,
    /// Segments that were late since the reset, as the firmware counts them.
    pub late_segments: Option<u64>,
    /// Lines that came from the firmware and should not have come.
    pub strays: Vec<String>,
    /// Time from the first line to the standstill, s.
    pub seconds_to_idle: f64,
    /// Time from the first line to the last answer, s.
    pub seconds_to_answer: f64,
    /// Motors and axes.
    pub setup: Setup,
    /// What the oracle expects.
    pub expected: Result<Outcome, Unclear>,
    /// The fault that ended the job early.
    pub fault: Option<String>,
}

/// A pause in the step stream.
#[derive(Clone, Serialize, Debug)]
pub struct PauseReport {
    /// The line of the job that was on its way, if it is known.
    pub line: Option<usize>,
    /// When it began, counted from the first step.
    pub seconds: f64,
    /// How long it took.
    pub ms: f64,
    /// Velocity of the path beside the pause, mm/s.
    pub velocity: f64,
}

/// One motor in a report.
#[derive(Clone, Serialize, Debug)]
pub struct MotorReport {
    /// Number of the motor, from 1.
    pub motor: usize,
    /// The axis it moves.
    pub axis: char,
    /// Steps up minus steps down.
    pub steps: i64,
    /// The steps that the oracle expects.
    pub expected: Option<i64>,
    /// The least steps in both directions together, by the oracle.
    pub least: Option<u64>,
    /// Steps in both directions.
    pub total: u64,
    /// Highest step rate, from the shortest time between two steps.
    pub highest_rate_hz: Option<f64>,
    /// Shortest and longest pulse.
    pub pulse_us: Option<(f64, f64)>,
    /// Shortest time from a change of direction to a step.
    pub dir_setup_us: Option<f64>,
}

/// One axis in a report, in millimetres or degrees.
#[derive(Clone, Serialize, Debug)]
pub struct AxisReport {
    /// Its letter.
    pub axis: char,
    /// Position from the steps that were made.
    pub position: f64,
    /// The position that the oracle expects.
    pub expected: f64,
}

/// A time with interrupts off.
#[derive(Clone, Serialize, Debug)]
pub struct WindowReport {
    /// In cycles.
    pub cycles: u64,
    /// In microseconds.
    pub us: f64,
    /// The interrupt it was in, or `thread`.
    pub context: &'static str,
    /// Where it began and ended.
    pub place: String,
}

/// One interrupt's service.
#[derive(Clone, Serialize, Debug)]
pub struct VectorReport {
    /// Its name.
    pub vector: &'static str,
    /// How often.
    pub count: u64,
    /// Mean cycles, without nested interrupts.
    pub own_mean: f64,
    /// Most cycles, without nested interrupts.
    pub own_max: u64,
    /// Most cycles from flag to acceptance.
    pub latency_max: u64,
}

/// The report of a job.
#[derive(Clone, Serialize, Debug)]
pub struct Report {
    /// Whether there is no problem.
    pub ok: bool,
    /// The problems found.
    pub problems: Vec<String>,
    /// The line from which on the oracle cannot compute the end of the job, and why. The ends are then not checked; all
    /// else is.
    pub unchecked: Option<String>,
    /// The board.
    pub board: &'static str,
    /// Lines in the job.
    pub lines: usize,
    /// Lines answered.
    pub acknowledged: usize,
    /// Lines skipped by block delete.
    pub skipped: usize,
    /// Lines refused.
    pub rejected: Vec<Rejected>,
    /// From the first step to the last.
    pub seconds_moving: f64,
    /// From the first line to the standstill.
    pub seconds_to_idle: f64,
    /// From the first line to the last answer.
    pub seconds_to_answer: f64,
    /// The motors.
    pub motors: Vec<MotorReport>,
    /// The axes that have motors.
    pub axes: Vec<AxisReport>,
    /// Share of time that the CPU is awake, from the first step to the last.
    pub cpu_load: Option<f64>,
    /// Share of time in interrupts, from the first step to the last.
    pub interrupt_load: Option<f64>,
    /// Longest time in which no tick could come in, outside the step interrupt.
    pub interrupts_off: WindowReport,
    /// Longest time with interrupts off inside the step interrupt.
    pub interrupts_off_in_step: WindowReport,
    /// Bytes never touched between static data and stack.
    pub free_stack: Option<i32>,
    /// Bytes that were lost because they were not read in time.
    pub uart_overruns: u64,
    /// Pauses in the step stream ([`crate::pauses`]).
    pub pauses: Vec<PauseReport>,
    /// Standstills of the step timer in mid-motion.
    pub starved: Vec<PauseReport>,
    /// Segments that were late since the reset, as the firmware counts them; 255 means 255 or more.
    pub late_segments: Option<u64>,
    /// Tops of the step timer that were written when the counter had already passed them.
    pub missed_tops: u64,
    /// Resets by the watchdog.
    pub resets: u64,
    /// Threads that were cut beside a spindle with an encoder.
    pub threads: Option<Threads>,
    /// How the steps of a print followed its file.
    pub followed: Option<Followed>,
    /// The heaters of a print.
    pub heat: Vec<Heat>,
    /// What a print was told at lines that were passed over, such as an unknown M code.
    pub told: Vec<String>,
    /// The interrupts that were served.
    pub vectors: Vec<VectorReport>,
    /// Motors and axes, as the firmware reports them.
    #[serde(skip)]
    pub setup: Setup,
}

impl Report {
    /// Combines the results of the job's runner and of the meters.
    pub fn new(machine: &Machine, measured: Measured) -> Self {
        let expected = measured.expected.as_ref().ok();
        let recorder = machine.recorder();
        let motors = measured.setup.motors.iter().zip(recorder.motors()).enumerate();
        let motors: Vec<_> = motors
            .map(|(i, (setup, motor))| motor_report(machine, i, setup, motor, expected))
            .collect();
        let axes = expected.map_or(Vec::new(), |e| axis_reports(&motors, &measured.setup, e));
        let (cpu_load, interrupt_load) = loads(machine);
        let span = recorder.span();
        let found = recorder.pauses();
        let mut report = Report {
            ok: false,
            problems: Vec::new(),
            unchecked: measured.expected.as_ref().err().map(ToString::to_string),
            board: machine.board().name,
            lines: measured.lines,
            acknowledged: measured.acknowledged,
            skipped: measured.skipped,
            rejected: measured.rejected.clone(),
            seconds_moving: span.map_or(0.0, |((a, _), (b, _))| machine.seconds(b - a)),
            seconds_to_idle: measured.seconds_to_idle,
            seconds_to_answer: measured.seconds_to_answer,
            motors,
            axes,
            cpu_load,
            interrupt_load,
            interrupts_off: window_report(machine, machine.meters().window_outside()),
            interrupts_off_in_step: window_report(machine, machine.meters().window_step()),
            free_stack: machine.free_stack(),
            uart_overruns: machine.uart(0).overruns(),
            pauses: pause_reports(machine, &found.pauses),
            starved: pause_reports(machine, &found.starved),
            late_segments: measured.late_segments,
            missed_tops: machine.missed_tops(),
            resets: machine.resets(),
            threads: None,
            followed: None,
            heat: Vec::new(),
            told: Vec::new(),
            vectors: vector_reports(machine),
            setup: measured.setup.clone(),
        };
        report.problems = report.find_problems(&measured);
        report.ok = report.problems.is_empty();
        report
    }

    /// Adds the threads of the job, if it has any. What is wrong with them becomes a problem of the job.
    pub fn add_threads(&mut self, threads: Option<Threads>) {
        self.problems.extend(threads.as_ref().and_then(Threads::problem));
        self.ok = self.problems.is_empty();
        self.threads = threads;
    }

    /// Adds the results that only prints have. Steps that do not follow the file are a problem of the job.
    /// `told` is what the firmware has said to lines that it passed over.
    pub fn add_print(&mut self, followed: Option<Followed>, heat: Vec<Heat>, told: Vec<String>) {
        self.problems.extend(followed.as_ref().and_then(Followed::problem));
        self.ok = self.problems.is_empty();
        (self.followed, self.heat, self.told) = (followed, heat, told);
    }

    /// Number of pauses or of standstills of the step timer, whichever is larger.
    pub fn dry(&self) -> usize {
        self.pauses.len().max(self.starved.len())
    }

    /// Whether nothing is wrong but pauses.
    pub fn is_exact(&self) -> bool {
        self.problems.len() == self.pause_problems().len()
    }

    fn pause_problems(&self) -> Vec<String> {
        let late = match self.late_segments {
            Some(0) => None,
            Some(n) => Some(format!("{n} late segments by the firmware's count")),
            None => Some("the firmware does not tell of late segments".to_string()),
        };
        let pauses = worst("pauses in the step stream", &self.pauses);
        let starved = worst("stops of the step timer in mid-motion", &self.starved);
        [pauses, starved, late].into_iter().flatten().collect()
    }

    fn find_problems(&self, measured: &Measured) -> Vec<String> {
        let mut problems: Vec<String> = measured.fault.iter().cloned().collect();
        if let Some(first) = self.rejected.first() {
            let (n, of) = (self.rejected.len(), self.lines);
            problems.push(format!("{n} of {of} lines rejected, the first is line {}", first.line));
        }
        if self.acknowledged < self.lines && measured.fault.is_none() {
            problems.push(format!("only {} of {} lines answered", self.acknowledged, self.lines));
        }
        let strays: Vec<_> = measured.strays.iter().filter(|line| !is_notice(line)).collect();
        if let Some(first) = strays.first() {
            let n = strays.len();
            problems.push(format!("unasked-for lines ({n}), the first is {first}"));
        }
        problems.extend(self.wrong_motors());
        problems.extend(self.pause_problems());
        if measured.restarts > 0 {
            problems.push(format!("the firmware restarted {} times", measured.restarts));
        }
        if self.resets > 0 {
            problems.push(format!("{} resets by the watchdog", self.resets));
        }
        problems
    }

    fn wrong_motors(&self) -> impl Iterator<Item = String> {
        let wrong =
            |m: &MotorReport| oracle::faults(m.motor, (m.steps, m.expected), (m.total, m.least));
        self.motors.iter().flat_map(wrong)
    }
}

/// Describes the number of pauses and the longest one; `None` if there are none.
fn worst(what: &str, pauses: &[PauseReport]) -> Option<String> {
    let longest = pauses.iter().max_by(|a, b| a.ms.total_cmp(&b.ms))?;
    Some(format!("{} {what}, the longest {longest}", pauses.len()))
}

impl Display for PauseReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let PauseReport { seconds, ms, velocity, .. } = self;
        match self.line {
            Some(line) => write!(f, "in line {line}")?,
            None => f.write_str("in an unknown line")?,
        }
        write!(f, " at {seconds:.3} s: {ms:.3} ms at {velocity:.1} mm/s")
    }
}

fn pause_reports(machine: &Machine, pauses: &[Pause]) -> Vec<PauseReport> {
    let first = machine.recorder().span().map_or(0, |((first, _), _)| first);
    let report = |pause: &Pause| PauseReport {
        line: pause.line,
        seconds: machine.seconds(pause.cycle.saturating_sub(first)),
        ms: microseconds(machine, pause.cycles) / 1e3,
        velocity: pause.velocity,
    };
    pauses.iter().map(report).collect()
}

fn microseconds(machine: &Machine, cycles: u64) -> f64 {
    machine.seconds(cycles) * 1e6
}

fn motor_report(
    machine: &Machine,
    index: usize,
    setup: &MotorSetup,
    motor: &Motor,
    expected: Option<&Outcome>,
) -> MotorReport {
    let us = |cycles| microseconds(machine, cycles);
    MotorReport {
        motor: index + 1,
        // Of two motors that drive X and Y together, the second is reported as Y.
        axis: AXIS_NAMES[setup.axis.max(usize::from(setup.besides < 0))],
        steps: if setup.inverted { -motor.position } else { motor.position },
        expected: expected.map(|e| e.steps[index]),
        least: expected.map(|e| e.least[index]),
        total: motor.steps,
        highest_rate_hz: motor.min_interval.map(|c| 1.0 / machine.seconds(c)),
        pulse_us: motor.pulse.map(|(a, b)| (us(a), us(b))),
        dir_setup_us: motor.min_setup.map(us),
    }
}

/// Returns each axis once, with the position of its first motor.
fn axis_reports(motors: &[MotorReport], setup: &Setup, expected: &Outcome) -> Vec<AxisReport> {
    let mut axes: Vec<AxisReport> = Vec::new();
    for (motor, of) in motors.iter().zip(&setup.motors) {
        if axes.iter().any(|a| a.axis == motor.axis) {
            continue;
        }
        let named = AXIS_NAMES.iter().position(|name| *name == motor.axis).unwrap_or(of.axis);
        let want = expected.position[named] as f64 / UNITS as f64;
        let per_unit = of.steps(1_000_000 * UNITS as i64) as f64 / 1e6;
        let off = motor.steps - motor.expected.unwrap_or(motor.steps);
        let error = if per_unit == 0.0 { 0.0 } else { off as f64 / per_unit };
        axes.push(AxisReport { axis: motor.axis, position: want + error, expected: want });
    }
    axes
}

fn loads(machine: &Machine) -> (Option<f64>, Option<f64>) {
    let Some(((from, a), (to, b))) = machine.recorder().span() else { return (None, None) };
    let all = (to - from) as f64;
    if all == 0.0 {
        return (None, None);
    }
    let asleep = (b.asleep - a.asleep) as f64;
    let inside = (b.in_interrupts - a.in_interrupts) as f64;
    (Some(1.0 - asleep / all), Some(inside / all))
}

fn window_report(machine: &Machine, window: Window) -> WindowReport {
    WindowReport {
        cycles: window.cycles,
        us: microseconds(machine, window.cycles),
        context: window.vector.map_or("thread", |vector| machine.chip().vector_name(vector)),
        place: if window.cycles == 0 { String::new() } else { machine.describe(&window) },
    }
}

fn vector_reports(machine: &Machine) -> Vec<VectorReport> {
    let all = (0..machine.chip().vectors.len() as u8).map(|v| (v, machine.meters().service(v)));
    all.filter(|(_, s)| s.count > 0)
        .map(|(v, s)| VectorReport {
            vector: machine.chip().vector_name(v),
            count: s.count,
            own_mean: s.own_sum as f64 / s.count as f64,
            own_max: s.own_max,
            latency_max: s.latency_max,
        })
        .collect()
}

/// Whether a line is only a notice that the program has caused: a stop that waits for a cycle start (38), or a tool
/// without a length (180).
fn is_notice(line: &str) -> bool {
    line.starts_with("{\"er\":") && ["\"st\":38,", "\"st\":180,"].iter().any(|st| line.contains(st))
}
