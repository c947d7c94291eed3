//! A lathe on the simulated chip and its sender, in TinyG's or in grbl's dialect.
//!
//! X and Z have 200 steps/mm and 500 mm/s2, and no ends. Tests use TinyG's names; the machine is addressed in its own
//! dialect.

use kerf::boards::{Board, MEGA2560_GRBL_LATHE};
use kerf_sim::mechanics::{Build, Sensors};
use kerf_sim::{AUX, Machine};

use crate::common::firmware;

/// Steps of X and Z in a millimetre.
pub const STEPS: f64 = 200.0;
/// A step, mm, with a margin for rounding.
pub const STEP: f64 = 1.0 / STEPS + 1e-9;
const X: usize = 0;
const Z: usize = 2;
/// Time of a byte on the wire, cycles.
const BYTE: u64 = 1_389;
/// Cycles of a quarter of a millisecond.
const QUARTER_MS: u64 = 4_000;
/// Edges of the index within this time belong to one pulse, ms.
const BOUNCES_MS: u64 = 20;
/// Longest wait for an answer and for rest, ms. No tap takes minutes.
const PATIENCE_MS: u64 = 20_000;

/// The state that the machine reports.
#[derive(Debug)]
pub struct Status {
    /// `Idle`, `Run`, `Hold`, `Door`, `Alarm`.
    pub state: String,
    /// The reported positions of X and Z, mm.
    pub at: [f64; 2],
    /// Time from the last byte of the question to the first byte of the answer, ms.
    pub took_ms: f64,
}

/// The result of a pass.
pub struct Cut {
    /// Positions of X and Z before the pass, in steps.
    pub start: [i64; 2],
    /// Positions of X and Z when they came to rest, in steps.
    pub end: [i64; 2],
    /// Positions of X and Z at each index pulse, in steps.
    pub indexed: Vec<[i64; 2]>,
}

impl Cut {
    /// Returns how far X or Z were along a thread at index pulses, mm modulo its lead. 1.5 leads at both ends are
    /// left out.
    pub fn phases(&self, axis: usize, lead: f64) -> Vec<f64> {
        let length = (self.end[axis] - self.start[axis]).abs() as f64 / STEPS;
        let inside = 1.5 * lead..=length - 1.5 * lead;
        let ways = self.indexed.iter().map(|at| (at[axis] - self.start[axis]).abs() as f64 / STEPS);
        ways.filter(|way| inside.contains(way)).map(|way| way.rem_euclid(lead)).collect()
    }
}

/// Turns a minute of a [driven] spindle, and the marks of its encoder in a turn.
pub const RPM: f64 = 300.0;
pub const MARKS: u32 = 20;

/// A lathe whose outputs drive the spindle, which gains or loses 600 turns a minute in a second. The spindle turns.
pub fn driven(board: &'static Board) -> Lathe {
    let mut build = Build::lathe(board, MARKS).unwrap();
    (build.spindle.rpm, build.spindle.pwm, build.spindle.torque) = (RPM, None, 600.0);
    let mut lathe = Lathe::of(board, &build, MARKS);
    lathe.take("m3 s300");
    lathe.run_for_ms(3_000);
    lathe.take("g91");
    lathe.forget();
    lathe
}

/// Returns the distance between two phases of a lead, mm.
pub fn apart(one: f64, other: f64, lead: f64) -> f64 {
    let off = (one - other) / lead;
    ((off - off.round()) * lead).abs()
}

/// The machine, and what its sender hears.
pub struct Lathe {
    pub machine: Machine,
    /// Whether it speaks grbl's dialect.
    pub grbl: bool,
    heard: Vec<String>,
    partial: Vec<u8>,
}

impl Lathe {
    /// A board beside a spindle at rest with this many pulses a turn; `change` changes its sensors.
    pub fn new(board: &'static Board, pulses: u32, change: impl Fn(&mut Sensors)) -> Self {
        let mut build = Build::lathe(board, pulses).unwrap();
        build.spindle.pwm = None;
        change(build.spindle.sensors.as_mut().unwrap());
        Self::of(board, &build, pulses)
    }

    /// A board in a machine that is built this way.
    pub fn of(board: &'static Board, build: &Build, pulses: u32) -> Self {
        let mut machine = firmware(board);
        machine.build(build);
        let grbl = board.name == MEGA2560_GRBL_LATHE.name;
        let mut lathe = Lathe { machine, grbl, heard: Vec::new(), partial: Vec::new() };
        lathe.run_for_ms(1_000);
        for motor in [1, 3] {
            ["tr:4", "sa:1.8", "mi:4"].iter().for_each(|row| lathe.set(&format!("{motor}{row}")));
        }
        for axis in ['x', 'z'] {
            let rows = ["fr:1500", "vm:1500", "ac:500", "jm:200000"];
            rows.iter().for_each(|row| lathe.set(&format!("{axis}{row}")));
        }
        lathe.set(&format!("spn:{pulses}"));
        lathe
    }

    /// Turns the spindle at this speed, and waits until the firmware has measured it.
    pub fn turn(&mut self, rpm: f64) {
        self.machine.tamper(|mechanics, now| mechanics.force_spindle(rpm, now));
        self.run_for_ms(if rpm.abs() < 100.0 { 3_500 } else { 800 });
    }

    fn listen(&mut self) {
        for byte in self.machine.receive() {
            match byte {
                b'\r' | b'\n' if self.partial.is_empty() => {}
                b'\r' | b'\n' => {
                    self.heard.push(String::from_utf8_lossy(&self.partial).into_owned());
                    self.partial.clear();
                }
                byte => self.partial.push(byte),
            }
        }
    }

    pub fn run_for_ms(&mut self, ms: u64) {
        self.machine.run_for_ms(ms).unwrap();
        self.listen();
    }

    fn run_for_quarter(&mut self) {
        self.machine.run_until(self.machine.cycle() + QUARTER_MS).unwrap();
        self.listen();
    }

    /// Sends a line and returns its answer.
    pub fn ask(&mut self, line: &str) -> String {
        let from = self.heard.len();
        self.machine.send(format!("{line}\n").as_bytes());
        let grbl = self.grbl;
        let answers = |heard: &String| match grbl {
            true => heard == "ok" || heard.starts_with("error:"),
            false => heard.contains("\"f\":["),
        };
        for _ in 0..PATIENCE_MS {
            self.run_for_ms(1);
            if let Some(answer) = self.heard[from..].iter().find(|heard| answers(heard)) {
                return answer.clone();
            }
        }
        panic!("no answer to {line}: {:?}", &self.heard[from..]);
    }

    /// Sends a line that must be executed.
    pub fn take(&mut self, line: &str) {
        let answer = self.ask(line);
        assert!(answer == "ok" || answer.contains("[1,0,"), "{line} is answered by {answer}");
    }

    /// Changes a setting, given with TinyG's name, as `spn:4`.
    pub fn set(&mut self, setting: &str) {
        let line = match self.grbl {
            true => format!("${}", setting.replace(':', "=")),
            false => format!("{{{setting}}}"),
        };
        self.take(&line);
    }

    /// Asks for a setting or a value, by TinyG's name.
    pub fn value(&mut self, name: &str) -> f64 {
        if self.grbl {
            self.take(&format!("${name}"));
            let answer = format!("${name}=");
            let line = self.heard.iter().rev().find(|line| line.starts_with(&answer)).unwrap();
            return line[answer.len()..].parse().unwrap();
        }
        let answer = self.ask(&format!("{{{name}:n}}"));
        number(&answer, &format!("\"{name}\":"))
    }

    /// Asks for the state of the machine.
    pub fn status(&mut self) -> Status {
        let from = self.heard.len();
        let question: &[u8] = if self.grbl { b"?" } else { b"{stat:n,mpox:n,mpoz:n}\n" };
        self.machine.send(question);
        let asked = self.machine.cycle() + question.len() as u64 * BYTE;
        let begins = if self.grbl { "<" } else { "{\"r\":{\"stat\"" };
        let mut answered = None;
        loop {
            self.run_for_quarter();
            if let Some(at) = self.heard[from..].iter().position(|one| one.starts_with(begins)) {
                let at = from + at;
                let answer = self.heard.remove(at);
                let took = answered.map_or(0, |at: u64| at.saturating_sub(asked));
                let took_ms = self.machine.seconds(took) * 1e3;
                return if self.grbl {
                    grbl_status(&answer, took_ms)
                } else {
                    tinyg_status(&answer, took_ms)
                };
            }
            if self.partial.starts_with(&begins.as_bytes()[..1]) {
                answered.get_or_insert(self.machine.cycle());
            } else if !self.partial.is_empty() {
                // Another line has come, not the answer.
                answered = None;
            }
            let late = self.machine.cycle().saturating_sub(asked);
            assert!(
                late < self.machine.cycles(PATIENCE_MS),
                "nobody answers: {:?}",
                &self.heard[from..]
            );
        }
    }

    /// Asks on the other port. Returns how long the answer took, ms.
    pub fn ask_other_port(&mut self) -> f64 {
        let (question, answer): (&[u8], &str) =
            if self.grbl { (b"?", "<") } else { (b"{mpoz:n}\n", "mpoz") };
        drop(self.machine.receive_from(AUX));
        self.machine.send_to(AUX, question);
        let asked = self.machine.cycle() + question.len() as u64 * BYTE;
        let mut heard = Vec::new();
        loop {
            self.run_for_quarter();
            heard.extend(self.machine.receive_from(AUX));
            let took = self.machine.cycle().saturating_sub(asked);
            if String::from_utf8_lossy(&heard).contains(answer) {
                return self.machine.seconds(took) * 1e3;
            }
            assert!(took < self.machine.cycles(PATIENCE_MS), "nobody answers the second port");
        }
    }

    /// Returns the positions of the motors of X and Z, in steps.
    pub fn motors(&self) -> [i64; 2] {
        [X, Z].map(|motor| self.machine.recorder().motors()[motor].position)
    }

    /// Returns the positions of X and Z at index pulses from the `since`-th on, in steps.
    pub fn indexed(&self, since: usize) -> Vec<[i64; 2]> {
        let all = &self.machine.mechanics().unwrap().indexed()[since..];
        let mut kept: Vec<&(u64, _)> = Vec::new();
        for one in all {
            // Edges of a contact that bounces are not pulses of their own.
            if kept.last().is_none_or(|last| one.0 > last.0 + self.machine.cycles(BOUNCES_MS)) {
                kept.push(one);
            }
        }
        kept.iter().map(|(_, steps): &&(u64, [i64; 4])| [steps[X], steps[Z]]).collect()
    }

    /// Returns the number of index pulses so far.
    pub fn turns(&self) -> usize {
        self.machine.mechanics().unwrap().indexed().len()
    }

    /// Begins a pass and runs until the axis of the thread has come `far` mm.
    pub fn begin(&mut self, line: &str, axis: usize, far: f64) {
        let start = self.motors()[axis];
        self.machine.send(format!("{line}\n").as_bytes());
        let patience = self.machine.cycle() + self.machine.cycles(PATIENCE_MS);
        while ((self.motors()[axis] - start).abs() as f64) < far * STEPS {
            self.run_for_quarter();
            assert!(self.machine.cycle() < patience, "{line} does not begin: {:?}", self.heard);
        }
    }

    /// Runs until nothing moves or waits to move. Returns the state of the machine.
    pub fn rest(&mut self) -> Status {
        for _ in 0..PATIENCE_MS / 100 {
            let before = self.machine.recorder().steps();
            self.run_for_ms(100);
            let status = self.status();
            if status.state != "Run" && self.machine.recorder().steps() == before {
                return status;
            }
        }
        panic!("it does not come to rest: {:?}", self.heard);
    }

    /// Executes a line and returns what it has cut.
    pub fn cut(&mut self, line: &str) -> Cut {
        let (start, since) = (self.motors(), self.turns());
        self.take(line);
        let status = self.rest();
        assert_eq!(status.state, "Idle", "{line}: {:?}", self.heard);
        Cut { start, end: self.motors(), indexed: self.indexed(since) }
    }

    /// Checks that the reported positions of X and Z agree with the motors. A line may have ended between two steps.
    pub fn agrees(&self, status: &Status, why: &str) {
        let told = status.at.map(|at| (at * STEPS).round() as i64);
        assert_eq!(told, self.motors(), "{status:?}: {why}");
    }

    /// Ends an alarm, and moves both axes back to 0.
    pub fn recover(&mut self) {
        self.take(if self.grbl { "$X" } else { "{clear:n}" });
        self.take("g90 g53 g0 x0 z0");
        self.rest();
        assert_eq!(self.motors(), [0, 0], "the way back");
    }

    /// Returns how often an exception was reported, by its number in TinyG's dialect or its line in grbl's. Forgets
    /// what was heard.
    pub fn told(&mut self, exception: u16, line: &str) -> usize {
        let token = if self.grbl { line.to_string() } else { format!("\"st\":{exception},") };
        let is_it =
            |one: &&String| (self.grbl || one.starts_with("{\"er\"")) && one.contains(&token);
        self.heard.iter().filter(is_it).count()
    }

    /// Returns the exceptions that were reported, as they came; in grbl's dialect alarms and messages.
    pub fn exceptions(&self) -> Vec<&str> {
        let begins = if self.grbl { ["ALARM:", "[MSG:"] } else { ["{\"er\"", "{\"er\""] };
        let is_one = |one: &&String| begins.iter().any(|begin| one.starts_with(begin));
        self.heard.iter().filter(is_one).map(String::as_str).collect()
    }

    /// Returns all that was heard.
    pub fn all_heard(&self) -> &[String] {
        &self.heard
    }

    /// Forgets what was heard.
    pub fn forget(&mut self) {
        self.heard.clear();
    }
}

/// The number behind a name.
fn number(text: &str, name: &str) -> f64 {
    let (_, rest) = text.split_once(name).unwrap_or_else(|| panic!("no {name} in {text}"));
    rest.split([',', '}', '|', '>']).next().unwrap().parse().unwrap()
}

fn tinyg_status(answer: &str, took_ms: f64) -> Status {
    let state = match number(answer, "\"stat\":") as u8 {
        2 | 11 | 13 => "Alarm",
        5 => "Run",
        6 => "Hold",
        _ => "Idle",
    };
    let at = [number(answer, "\"mpox\":"), number(answer, "\"mpoz\":")];
    Status { state: state.to_string(), at, took_ms }
}

fn grbl_status(answer: &str, took_ms: f64) -> Status {
    let state = answer[1..].split(['|', ':']).next().unwrap().to_string();
    let (_, rest) = answer.split_once("MPos:").unwrap();
    let at: Vec<f64> =
        rest.split(['|', '>']).next().unwrap().split(',').map(|one| one.parse().unwrap()).collect();
    Status { state, at: [at[0], at[2]], took_ms }
}
