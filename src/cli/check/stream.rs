//! Sends the lines of a job as a sender does that counts answers.

use std::collections::VecDeque;

use kerf::status::Status;

use super::around::{AXES, Around};
use super::dialect::{Dialect, Heard, Reason};
use super::lines::{Kind, Line};

/// Time without an answer after which the machine is asked for its state, ms; also the time between two questions.
const ASK_MS: u64 = 1_000;
/// Time between two questions whether the machine is at rest, ms.
const POLL_MS: u64 = 20;
/// Time without an answer after which a line at rest counts as one that is never answered, ms.
const UNANSWERED_MS: u64 = 30_000;
/// Longest time without an answer and without a step, beyond the dwells of the job, ms.
const STUCK_MS: u64 = 600_000;
/// Longest time without a step in the whole job, ms. A slow move has such times between its steps, too.
const STILL_MS: u64 = 6 * 3_600_000;
/// Bytes in flight, line ends included: as many as the machine always has room for.
const BYTES: usize = 254;
/// Machine states: alarms, hold, and those in which it does not rest.
const ALARMS: [u8; 4] = [2, 11, 12, 13];
const HOLD: u8 = 6;
const BUSY: [u8; 6] = [5, HOLD, 7, 8, 9, 10];

/// The words for an alarm whose reason is not known.
const IN_ALARM: &str = "an alarm, at this line or one before it";

/// A line that was refused.
pub struct Refused {
    pub line: usize,
    pub text: String,
    pub reason: Reason,
}

/// The results of sending the lines.
#[derive(Default)]
pub struct Streamed {
    pub lines: usize,
    pub refused: Vec<Refused>,
    /// What would end or stop the job, each with the number of its line.
    pub stops: Vec<(usize, String)>,
    /// What was not tried, and notices, each with the number of its line.
    pub notes: Vec<(usize, String)>,
    /// The most lines that were answered in one second.
    pub busiest: usize,
    /// By how much dwells were shortened, ms.
    pub skipped_ms: u64,
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

/// What the job is sent to, and what is known of it.
pub struct Stream<'a> {
    around: &'a mut Around,
    dialect: Dialect,
    /// The work zero, in machine coordinates.
    zero: [f64; 3],
    done: Streamed,
    waits: VecDeque<Line>,
    /// Lines that an alarm has locked out. They are sent once more.
    again: VecDeque<Line>,
    /// Whether a line is on its way that goes alone, and whether it may change settings.
    alone: bool,
    learns: bool,
    /// Whether an alarm has come that is still to be cleared.
    alarmed: bool,
    /// Exceptions of which it is not known yet whether they are alarms, each with its line.
    excepted: Vec<(usize, Reason)>,
    /// Whether the dry run ends here.
    ended: bool,
    /// The number of the last line that was counted.
    counted: usize,
    /// Lines sent, each with a number in the dialect of printing hosts.
    sent: usize,
    /// The number of the last line that was answered.
    last: usize,
    /// Why the line that waits is refused.
    because: Option<Reason>,
    /// Answers to lines that are no part of the job.
    others: usize,
    /// When a line was answered last, and when a motor last made a step, ms.
    heard_at: u64,
    moved_at: u64,
    steps: u64,
    asked_at: u64,
    /// The longest dwell of the job, ms.
    dwell_ms: u64,
}

impl<'a> Stream<'a> {
    /// Prepares for a job whose longest dwell is `dwell_ms`.
    pub fn new(around: &'a mut Around, dialect: Dialect, zero: [f64; 3], dwell_ms: u64) -> Self {
        let now = around.ms;
        Self {
            steps: around.steps(),
            around,
            dialect,
            zero,
            done: Streamed::default(),
            waits: VecDeque::new(),
            again: VecDeque::new(),
            alone: false,
            learns: false,
            alarmed: false,
            excepted: Vec::new(),
            ended: false,
            counted: 0,
            sent: 0,
            last: 0,
            because: None,
            others: 0,
            heard_at: now,
            moved_at: now,
            asked_at: now,
            dwell_ms,
        }
    }

    /// Sends all lines, and waits until the machine rests.
    pub fn run(mut self, lines: impl Iterator<Item = Line>) -> Result<Streamed, String> {
        let mut lines = lines.peekable();
        loop {
            self.fill(&mut lines)?;
            if self.waits.is_empty() || self.ended {
                break;
            }
            self.pass();
            self.mind()?;
        }
        self.rest()?;
        Ok(self.done)
    }

    /// Sends lines while fewer are in flight than a sender has.
    fn fill(
        &mut self,
        lines: &mut std::iter::Peekable<impl Iterator<Item = Line>>,
    ) -> Result<(), String> {
        while !self.ended {
            let none = self.waits.is_empty();
            if (self.alone || self.alarmed) && none {
                self.rest()?;
                if self.learns {
                    self.around.learn(self.dialect == Dialect::RepRap)?;
                }
                (self.alone, self.learns, self.alarmed) = (false, false, false);
            }
            let limit = match self.alone || self.alarmed {
                true => 0,
                false => self.dialect.in_flight(),
            };
            let Some(next) = self.again.front().or_else(|| lines.peek()) else { return Ok(()) };
            let barrier =
                !next.acts.is_empty() || !matches!(next.kind, Kind::Beside | Kind::Untried(_));
            let bytes: usize = self.waits.iter().map(|line| line.bytes.len() + 1).sum();
            let is_full = self.waits.len() >= limit || bytes + next.bytes.len() >= BYTES;
            if !none && (is_full || barrier) {
                return Ok(());
            }
            let Some(line) = self.again.pop_front().or_else(|| lines.next()) else { return Ok(()) };
            self.take(line)?;
        }
        Ok(())
    }

    /// Sends a line, or says why not.
    fn take(&mut self, line: Line) -> Result<(), String> {
        let number = line.number;
        if !line.again && self.counted != number {
            self.counted = number;
            self.done.lines += 1;
        }
        if !line.again {
            self.done.stops.extend(line.acts.iter().map(|act| (number, act.to_string())));
        }
        match line.kind {
            Kind::Untried(why) => self.note(number, format!("not tried: {why}")),
            Kind::Stops(why) => self.done.stops.push((number, why.to_string())),
            Kind::Homes(axes) => return self.home(number, axes),
            // Nothing is left of a line but characters that act at once.
            _ if line.bytes.trim_ascii().is_empty() => {}
            _ if !self.dialect.answers(&line.bytes) => self.send(&line.bytes),
            Kind::Sets | Kind::Alone | Kind::Beside => {
                self.learns = line.kind == Kind::Sets;
                self.alone = line.kind != Kind::Beside;
                if self.alone {
                    self.rest()?;
                }
                self.send(&line.bytes);
                self.waits.push_back(line);
            }
        }
        Ok(())
    }

    fn send(&mut self, line: &[u8]) {
        self.sent += 1;
        self.around.send(&self.dialect.framed(self.sent, line));
    }

    fn note(&mut self, line: usize, note: String) {
        self.done.notes.push((line, note));
    }

    fn stop(&mut self, why: &str) {
        let line = self.waits.front().map_or(self.last, |line| line.number);
        self.done.stops.push((line, why.to_string()));
    }

    /// Takes axes for homed: sets their position.
    fn home(&mut self, number: usize, axes: [bool; 3]) -> Result<(), String> {
        self.rest()?;
        self.note(number, "homing is taken for done".to_string());
        let unit = if self.around.ask("{unit:n}")?.contains(":0}") { 25.4 } else { 1.0 };
        let (mut machine, mut work) = (String::from("G28.3"), String::from("G92"));
        let mut moved = false;
        for n in (0..AXES.len()).filter(|n| axes[*n]) {
            let (axis, homed) = (AXES[n].to_uppercase(), self.around.axes[n].homed);
            machine += &format!(" {axis}{:.4}", homed / unit);
            work += &format!(" {axis}{:.4}", (homed - self.zero[n]) / unit);
            moved |= self.around.off_home(n) > 0.01;
            self.around.place(n, homed);
        }
        if moved {
            self.tell(number, &machine)?;
        }
        // Homing of a printer ends the offsets of G92.
        if self.dialect == Dialect::RepRap {
            self.tell(number, &work)?;
        }
        Ok(())
    }

    /// Sends a line that is no part of the job, and waits until it is done.
    fn tell(&mut self, number: usize, line: &str) -> Result<(), String> {
        let (text, bytes) = (line.to_string(), line.as_bytes().to_vec());
        let line = Line {
            number,
            text,
            bytes,
            acts: Vec::new(),
            kind: Kind::Beside,
            skipped_ms: 0,
            again: true,
        };
        self.send(&line.bytes);
        self.waits.push_back(line);
        while !self.waits.is_empty() && !self.ended {
            self.mind()?;
            self.pass();
        }
        self.rest()
    }

    /// Lets a millisecond pass, and listens.
    fn pass(&mut self) {
        self.around.pass();
        self.listen();
    }

    fn listen(&mut self) {
        let steps = self.around.steps();
        if steps != self.steps {
            (self.steps, self.moved_at) = (steps, self.around.ms);
        }
        while let Some(heard) = self.around.line() {
            match self.dialect.hear(&heard) {
                Heard::Nothing => {}
                Heard::Notice(text) => {
                    let line = self.waits.front().map_or(self.last, |line| line.number);
                    self.note(line, text);
                }
                Heard::Because(reason) => self.because = Some(reason),
                Heard::Paused => {
                    self.others += 1;
                    self.around.send(b"M108\n");
                }
                Heard::Alarm(reason) => self.alarm(self.line_of_alarm(), reason),
                Heard::Exception(reason) => {
                    self.excepted.push((self.line_of_alarm(), reason));
                }
                Heard::Done => self.answer(None),
                Heard::Refused(reason) => self.answer(Some(reason)),
                Heard::Locked if self.dialect == Dialect::RepRap => self.locked(false),
                Heard::Locked => self.locked(true),
            }
        }
    }

    /// Takes the answer to the oldest line.
    fn answer(&mut self, refused: Option<Reason>) {
        self.heard_at = self.around.ms;
        if self.others > 0 {
            self.others -= 1;
            return;
        }
        self.done.answered_at(self.around.ms);
        let Some(line) = self.waits.pop_front() else { return };
        self.last = line.number;
        match refused.or(self.because.take()) {
            Some(reason) => {
                self.done.refused.push(Refused { line: line.number, text: line.text, reason });
            }
            None => self.done.skipped_ms += line.skipped_ms,
        }
    }

    /// Takes the refusal of the oldest line by an alarm that was not cleared. It has not been read, so it is sent once
    /// more. `answered` says that no other answer to it comes.
    fn locked(&mut self, answered: bool) {
        if !self.alarmed && self.excepted.is_empty() && !self.waits.is_empty() {
            self.stop(IN_ALARM);
        }
        let Some(line) = self.waits.front_mut() else { return };
        self.alarmed = true;
        if line.again {
            let text = "the alarm stays".to_string();
            self.because = Some(Reason { text, status: Some(Status::Alarmed) });
        } else {
            self.again.push_back(Line { again: true, acts: Vec::new(), ..line.clone() });
            line.skipped_ms = 0;
        }
        if answered {
            self.answer(None);
        }
    }

    /// Takes an alarm: says that it ends the job, or that a probing cannot be tried. It is cleared later.
    fn alarm(&mut self, line: usize, reason: Reason) {
        if reason.status == Some(Status::ProbeFailed) {
            self.note(line, format!("{}: it cannot be tried here", reason.text));
        } else {
            let text = format!("{}: an alarm, at this line or one before it", reason.text);
            self.done.stops.push((line, text));
        }
        self.alarmed = true;
    }

    /// Returns the number of the line to which an alarm of this moment belongs.
    fn line_of_alarm(&self) -> usize {
        self.waits.front().filter(|_| self.alone).map_or(self.last, |line| line.number)
    }

    /// Tells the exceptions that have come: as an alarm if the machine is in one.
    fn judge(&mut self) -> Result<(), String> {
        if self.excepted.is_empty() {
            return Ok(());
        }
        let is_alarm = ALARMS.contains(&self.around.state()?);
        for (line, reason) in std::mem::take(&mut self.excepted) {
            match is_alarm {
                true => self.alarm(line, reason),
                false => self.note(line, reason.text),
            }
        }
        Ok(())
    }

    /// Ends the dry run at this line.
    fn end(&mut self, why: &str) {
        if !self.ended {
            self.stop(&format!("{why}: the lines behind were not tried"));
        }
        self.ended = true;
    }

    /// Looks for what ends the dry run, and asks for the machine's state while no line is answered.
    fn mind(&mut self) -> Result<(), String> {
        self.judge()?;
        if self.around.was_reset() {
            self.end("the machine restarts");
        }
        if self.around.still_ms > STILL_MS {
            self.end("in all the machine has stood still for 6 hours");
        }
        let now = self.around.ms;
        let since = |then: u64| now.saturating_sub(then);
        if self.ended || since(self.heard_at.max(self.asked_at)) < ASK_MS {
            return Ok(());
        }
        let state = self.look()?;
        let rests = !BUSY.contains(&state);
        if rests && since(self.heard_at.max(self.moved_at)) > UNANSWERED_MS {
            self.heard_at = now;
            if let Some(Line { number: line, text, .. }) = self.waits.pop_front() {
                let reason = Reason { text: "it is not answered".to_string(), status: None };
                self.done.refused.push(Refused { line, text, reason });
            }
        }
        if since(self.heard_at.max(self.moved_at)) > STUCK_MS + self.dwell_ms {
            self.end("the machine waits here for ever");
        }
        Ok(())
    }

    /// Asks for the machine's state. Ends a hold, and an alarm.
    fn look(&mut self) -> Result<u8, String> {
        let state = self.around.state()?;
        self.asked_at = self.around.ms;
        self.listen();
        self.judge()?;
        match state {
            HOLD => {
                self.stop("the machine holds and waits for ~");
                self.around.send(b"~");
            }
            state if ALARMS.contains(&state) => {
                if !self.alarmed {
                    self.stop(IN_ALARM);
                }
                self.around.ask("{clear:n}")?;
            }
            _ => {}
        }
        Ok(state)
    }

    /// Waits until the machine rests.
    fn rest(&mut self) -> Result<(), String> {
        while !self.ended {
            let state = self.look()?;
            if !BUSY.contains(&state) && !ALARMS.contains(&state) {
                return Ok(());
            }
            let since = self.around.ms.saturating_sub(self.moved_at.max(self.heard_at));
            if since > STUCK_MS + self.dwell_ms {
                self.end("the machine does not come to rest");
            }
            if self.around.still_ms > STILL_MS {
                self.end("in all the machine has stood still for 6 hours");
            }
            (0..POLL_MS).for_each(|_| self.pass());
        }
        Ok(())
    }
}
