//! `kerf check`: a dry run of a job. The firmware itself runs the job on the host, in mocked time. So refused lines,
//! the travel of the axes and the time are those of the machine.

use std::collections::VecDeque;
use std::fmt::{self, Display, Formatter};

use kerf::canon::{advice, by_number, text as text_of};
use kerf::config::machines;
use kerf::hal::imp::Machine;

/// The number of lines that a sender has in flight.
const IN_FLIGHT: usize = 4;
/// Longest wait for an answer, and for standstill at the end, ms: more than any move takes.
const LONGEST_MS: u64 = 24 * 3_600_000;
/// Time between two questions whether the machine is at rest, ms.
const POLL_MS: u64 = 20;
const MOTORS: usize = 4;
const AXES: [&str; 3] = ["x", "y", "z"];
/// Status of a line that was skipped.
const PASSED_OVER: u8 = 3;

/// The rate of the serial line for which the job is timed, bits a second.
const BAUD: u32 = 115_200;
/// If more lines than this are answered in some second, the board may be slower than the dry run, which does not
/// simulate the board's CPU. An empty queue takes 64 lines at once. At 400 lines a second the board's time agrees
/// within 1 %.
const MOST_LINES: usize = 64 + 400;
/// How much longer the job may take in that case, percent.
const SLOWER: u32 = 8;

/// Statuses of exceptions after which a job continues: a stop, a tool without a length.
const NOTES: [u8; 2] = [38, 180];

/// The input of a dry run.
pub struct Question<'a> {
    /// The name of the machine's profile.
    pub machine: &'a str,
    /// Settings that are sent before the job.
    pub settings: &'a [String],
    /// The work zero in machine coordinates, if it is known.
    pub zero: Option<[f64; 3]>,
}

/// A line that was refused.
pub struct Refused {
    line: usize,
    text: String,
    status: u8,
}

/// The travel of an axis in the job, in mm from the work zero, and the travel that is allowed.
pub struct Extent {
    axis: &'static str,
    from: f64,
    to: f64,
    travel: (f64, f64),
    /// The work zero, in machine coordinates, if it is known.
    zero: Option<f64>,
}

/// The result of a dry run.
pub struct Answer {
    lines: usize,
    refused: Vec<Refused>,
    /// Parts of the job that could not be tried, each with the number of the last answered line.
    notes: Vec<(usize, String)>,
    extents: Vec<Extent>,
    ms: u64,
    /// The most lines that were answered in one second.
    busiest: usize,
}

/// The properties of a motor that are needed here.
#[derive(Clone, Copy)]
struct Motor {
    axis: usize,
    /// The length of a step, mm.
    step: f64,
}

/// The machine, and the recorded data about its run.
struct Run {
    machine: Machine,
    heard: String,
    ms: u64,
    lowest: [i64; MOTORS],
    highest: [i64; MOTORS],
}

impl Run {
    fn boot() -> Option<Self> {
        let (heard, ms) = (String::new(), 0);
        let none = [0; MOTORS];
        Some(Self { machine: Machine::boot(BAUD)?, heard, ms, lowest: none, highest: none })
    }

    /// Lets a millisecond pass.
    fn pass(&mut self) {
        let (machine, lowest, highest) = (&self.machine, &mut self.lowest, &mut self.highest);
        machine.run_until(1, || {
            let position = machine.emitted().position;
            for m in 0..MOTORS {
                lowest[m] = lowest[m].min(position[m]);
                highest[m] = highest[m].max(position[m]);
            }
            false
        });
        self.ms += 1;
        self.heard += &String::from_utf8_lossy(&machine.received());
    }

    fn send(&self, line: &str) {
        self.machine.send(format!("{line}\n").as_bytes());
    }

    fn line(&mut self) -> Option<String> {
        let (line, rest) = self.heard.split_once('\n')?;
        let (line, rest) = (line.to_string(), rest.to_string());
        self.heard = rest;
        Some(line)
    }

    /// Sends a line and returns its answer.
    fn ask(&mut self, line: &str) -> Result<String, String> {
        self.send(line);
        for _ in 0..LONGEST_MS {
            while let Some(heard) = self.line() {
                if let Some(status) = status(&heard) {
                    return if status == 0 { Ok(heard) } else { Err(format!("{line}: {heard}")) };
                }
            }
            self.pass();
        }
        Err(format!("no answer to {line}"))
    }
}

/// Returns the status of an answer; `None` if the line answers nothing.
fn status(heard: &str) -> Option<u8> {
    let (body, footer) = heard.split_once(",\"f\":[1,")?;
    let is_answer = body.starts_with("{\"r\":") && !body.contains("SYSTEM READY");
    let is_unasked = body.starts_with("{\"r\":{\"prb\":");
    let status = footer.split(',').next()?.parse().ok()?;
    (is_answer && !is_unasked).then_some(status)
}

/// Returns the status of an exception.
fn exception(heard: &str) -> Option<u8> {
    let (_, rest) = heard.strip_prefix("{\"er\":")?.split_once("\"st\":")?;
    rest.split([',', '}']).next()?.parse().ok()
}

/// Returns the number behind a name in an answer.
fn value(heard: &str, name: &str) -> Result<f64, String> {
    let after = heard.split_once(&format!("\"{name}\":")).map(|(_, rest)| rest);
    let digits = after.and_then(|rest| rest.split([',', '}']).next());
    digits.and_then(|d| d.parse().ok()).ok_or_else(|| format!("no {name} in {heard}"))
}

/// Whether a line homes. The dry run has no switches.
fn homes(line: &str) -> bool {
    let line: String = line.chars().filter(|c| !c.is_whitespace()).collect();
    let line = line.to_ascii_uppercase();
    line.contains("G28.2") || line.contains("G28.4")
}

/// Returns the lines that a sender sends, each with its number: blank lines and `%` are left out.
fn sent(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = (1..).zip(text.lines().map(str::trim));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('%'))
}

/// Runs a job. The error says why it could not begin.
pub fn check(text: &str, question: &Question) -> Result<Answer, String> {
    let machine = machines::ALL.iter().position(|m| m.name == question.machine);
    let known = || machines::ALL.map(|machine| machine.name).join(", ");
    let machine =
        machine.ok_or_else(|| format!("no machine {}; there are {}", question.machine, known()))?;
    let mut run = Run::boot().ok_or("the machine does not start")?;
    run.ask(&format!("{{mch:{machine}}}"))?;
    for line in question.settings {
        run.ask(line)?;
    }
    // Stops do not wait, because there is no operator. Reports are off, because they would take time on the line.
    run.ask("{psw:0,sl:0,sv:0,qv:0,jv:3,ej:1}")?;
    let mut motors = Vec::new();
    for m in 1..=MOTORS {
        let heard = run.ask(&format!("{{{m}:n}}"))?;
        let of = |name| value(&heard, name);
        // Steps are counted before pins are inverted, so the motor's direction does not matter.
        let step = of("tr")? * of("sa")? / 360.0 / of("mi")?;
        motors.push(Motor { axis: of("ma")? as usize, step });
    }
    let mut travels = Vec::new();
    for axis in AXES {
        let heard = run.ask(&format!("{{{axis}:n}}"))?;
        let of = |name| value(&heard, name);
        // The position after homing.
        let homed = if matches!(of("sx")? as u8, 1 | 3) { of("tm")? } else { of("tn")? };
        travels.push((of("tn")?, of("tm")?, homed));
    }
    let at = |n: usize| travels[n].2;
    let zero = question.zero.unwrap_or([at(0), at(1), at(2)]);
    run.ask(&format!("g21 g28.3 x{} y{} z{}", at(0), at(1), at(2)))?;
    run.ask(&format!("g10 l2 p1 x{} y{} z{}", zero[0], zero[1], zero[2]))?;
    let began = run.ms;
    let Streamed { lines, refused, notes, busiest, .. } = stream(&mut run, text)?;
    while run.ask("{stat:n}").is_ok_and(|heard| value(&heard, "stat") == Ok(5.0)) {
        (0..POLL_MS).for_each(|_| run.pass());
    }
    let extents = (0..AXES.len()).filter_map(|n| {
        let (index, motor) = motors.iter().enumerate().find(|(_, motor)| motor.axis == n)?;
        let ends = [run.lowest[index], run.highest[index]].map(|steps| steps as f64 * motor.step);
        let [from, to] = ends.map(|mm| mm + at(n) - zero[n]);
        Some(Extent {
            axis: AXES[n],
            from: from.min(to),
            to: from.max(to),
            travel: (travels[n].0, travels[n].1),
            zero: question.zero.map(|zero| zero[n]),
        })
    });
    let extents = extents.collect();
    Ok(Answer { lines, refused, notes, extents, ms: run.ms - began, busiest })
}

/// The results of streaming the lines.
#[derive(Default)]
struct Streamed {
    lines: usize,
    refused: Vec<Refused>,
    notes: Vec<(usize, String)>,
    busiest: usize,
    /// The times at which the lines of the last second were answered, ms.
    answered: VecDeque<u64>,
}

impl Streamed {
    /// Takes note that a line has been answered now.
    fn answered_at(&mut self, ms: u64) {
        self.answered.push_back(ms);
        while self.answered.front().is_some_and(|at| at + 1_000 <= ms) {
            self.answered.pop_front();
        }
        self.busiest = self.busiest.max(self.answered.len());
    }
}

/// Sends the lines as a sender does that counts answers.
fn stream(run: &mut Run, text: &str) -> Result<Streamed, String> {
    let mut done = Streamed::default();
    let (mut last, mut silent) = (0, 0);
    let mut waits: VecDeque<Option<(usize, &str)>> = VecDeque::new();
    let mut lines = sent(text);
    loop {
        while waits.len() < IN_FLIGHT
            && let Some((number, line)) = lines.next()
        {
            done.lines += 1;
            if homes(line) {
                done.notes.push((number, "homing is taken for done".to_string()));
                continue;
            }
            run.send(line);
            waits.push_back(Some((number, line)));
        }
        if waits.is_empty() {
            return Ok(done);
        }
        run.pass();
        silent += 1;
        while let Some(heard) = run.line() {
            silent = 0;
            match (status(&heard), exception(&heard)) {
                (Some(status), _) => {
                    done.answered_at(run.ms);
                    let Some(Some((line, text))) = waits.pop_front() else { continue };
                    last = line;
                    // A note reports the alarm, so the lines that it refuses are not listed.
                    if !matches!(status, 0 | PASSED_OVER | 203) {
                        done.refused.push(Refused { line, text: text.to_string(), status });
                    }
                }
                (_, Some(203)) => {}
                (_, Some(st)) if NOTES.contains(&st) => done.notes.push((last, says(st))),
                (_, Some(st)) => {
                    done.notes.push((last, format!("{}: it cannot be tried here", says(st))));
                    run.send("{clear:n}");
                    waits.push_back(None);
                }
                _ => {}
            }
        }
        if silent > LONGEST_MS {
            return Err(format!("no answer after line {last}"));
        }
    }
}

/// Returns the status with its text.
fn says(code: u8) -> String {
    format!("status {code} {}", by_number(code).map(text_of).unwrap_or_default())
}

impl Extent {
    fn fits(&self) -> bool {
        let (lower, upper) = self.travel;
        // If both ends are equal the axis has no limits.
        let slack = 0.01;
        lower == upper
            || match self.zero {
                Some(zero) => self.from + zero >= lower - slack && self.to + zero <= upper + slack,
                None => self.to - self.from <= upper - lower + slack,
            }
    }
}

impl Answer {
    /// Returns the time that the job takes, s.
    #[allow(dead_code)]
    pub fn seconds(&self) -> f64 {
        self.ms as f64 / 1e3
    }

    /// Whether the board may take longer than the dry run says.
    pub fn is_rushed(&self) -> bool {
        self.busiest > MOST_LINES
    }

    /// Whether the machine would run the whole job.
    pub fn is_good(&self) -> bool {
        self.refused.is_empty() && self.extents.iter().all(Extent::fits)
    }
}

impl Display for Answer {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for Refused { line, text, status } in &self.refused {
            writeln!(f, "line {line}: {text}")?;
            writeln!(f, "    {}", says(*status))?;
            if let Some((cause, cure)) = by_number(*status).and_then(advice) {
                writeln!(f, "    why: {cause}\n    do:  {cure}")?;
            }
        }
        for (line, note) in &self.notes {
            writeln!(f, "line {line}: {note}")?;
        }
        writeln!(f, "{} lines, {} refused", self.lines, self.refused.len())?;
        writeln!(f, "{:4}{:>12}{:>12}{:>12}{:>26}", "", "from", "to", "size", "travel")?;
        for extent in &self.extents {
            let Extent { axis, from, to, travel: (lower, upper), .. } = extent;
            let travel = format!("{lower:.3} to {upper:.3}");
            let size = to - from;
            let fits = if extent.fits() { "" } else { "   does not fit" };
            let axis = axis.to_uppercase();
            writeln!(f, "{axis:4}{from:>12.3}{to:>12.3}{size:>12.3}{travel:>26}{fits}")?;
        }
        if self.extents.iter().any(|extent| extent.zero.is_none()) {
            writeln!(
                f,
                "from and to are from the work zero; --zero X,Y,Z says where that is, and has it checked"
            )?;
        }
        let (s, tenths) = (self.ms / 1_000, self.ms % 1_000 / 100);
        writeln!(f, "time {}:{:02}:{:02}.{tenths}", s / 3_600, s / 60 % 60, s % 60)?;
        if self.is_rushed() {
            writeln!(
                f,
                "up to {SLOWER} % more: {} lines in a second are about what the board can do",
                self.busiest
            )?;
        }
        writeln!(f, "result: {}", if self.is_good() { "OK" } else { "FAILED" })
    }
}
