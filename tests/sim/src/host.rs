//! A sender on the serial line. It keeps some lines in flight and expects one answer for each.

use std::collections::VecDeque;

use anyhow::{Context, Result, bail};
use kerf::hal::serial::{XOFF, XON};
use serde_json::Value;

use crate::protocol::{Incoming, Response, classify, control_name, is_idle, state_of};
use crate::runs::Runs;
use crate::speech::{self, Speech};

/// Lines in flight by default.
pub const LINES_IN_FLIGHT: usize = 4;

/// The machine state of motion.
const RUNS: i64 = 5;

/// Time that the firmware takes to change its speed after the answer, ms.
const SPEED_CHANGE_MS: u64 = 10;

/// A line that was sent.
#[derive(Clone, Debug)]
struct Line {
    number: usize,
    text: String,
    /// The name that a control line sets or asks for. A control line may be answered before G-code that was sent
    /// earlier.
    name: Option<String>,
}

/// A line and what the firmware said to it.
#[derive(Clone, Debug)]
pub struct Answered {
    /// The number given to `queue`.
    pub number: usize,
    /// What was sent.
    pub text: String,
    /// What came back.
    pub response: Response,
}

/// The sender.
pub struct Host {
    speech: Speech,
    limit: usize,
    queue: VecDeque<(usize, String)>,
    awaiting: VecDeque<Line>,
    partial: Vec<u8>,
    /// Whether the firmware has sent XOFF, and no XON since.
    is_stopped: bool,
    answered: VecDeque<Answered>,
    reports: Vec<Value>,
    strays: Vec<String>,
    banners: usize,
    stat: Option<i64>,
    /// The values that grbl's dialect has shown since the last answer.
    shown: serde_json::Map<String, Value>,
    late: u64,
    heard_at: u64,
    idle_since: Option<u64>,
    /// Characters to send ahead of everything else, each with the cycle at which it is sent.
    interjections: VecDeque<(u64, u8)>,
}

impl Host {
    /// A sender that keeps up to `limit` lines in flight.
    pub fn new(limit: usize) -> Self {
        Host {
            speech: Speech::TinyG,
            limit: limit.max(1),
            queue: VecDeque::new(),
            awaiting: VecDeque::new(),
            partial: Vec::new(),
            is_stopped: false,
            answered: VecDeque::new(),
            reports: Vec::new(),
            strays: Vec::new(),
            banners: 0,
            stat: None,
            shown: serde_json::Map::new(),
            late: 0,
            heard_at: 0,
            idle_since: None,
            interjections: VecDeque::new(),
        }
    }

    /// Returns this sender, which speaks a dialect from now on.
    pub fn speaking(mut self, speech: Speech) -> Self {
        self.speech = speech;
        self
    }

    /// The dialect.
    pub fn speech(&self) -> Speech {
        self.speech
    }

    /// How often the firmware has told that steps came late, in grbl's dialect.
    pub fn late(&self) -> u64 {
        self.late
    }

    /// Asks for the machine's state. The answer to it, in TinyG's dialect, has this number.
    pub fn poll(&mut self, machine: &mut impl Runs, number: usize) {
        match self.speech {
            Speech::TinyG => self.send(machine, number, "{stat:n}"),
            Speech::Grbl => {
                // Not at rest, until the report says so.
                self.stat = Some(RUNS);
                machine.send_now(b'?');
            }
        }
    }

    /// Queues a line, without its line end, under a number of the caller's choice.
    pub fn queue(&mut self, number: usize, text: &str) {
        self.queue.push_back((number, text.to_string()));
    }

    /// Schedules a character that is sent ahead of everything else at a cycle. Call it in the order of the cycles.
    pub fn interject(&mut self, cycle: u64, byte: u8) {
        self.interjections.push_back((cycle, byte));
    }

    /// Whether every line was sent and answered.
    pub fn is_done(&self) -> bool {
        self.queue.is_empty() && self.awaiting.is_empty()
    }

    /// Lines sent and not yet answered.
    pub fn in_flight(&self) -> usize {
        self.awaiting.len()
    }

    /// The oldest line that waits for its answer.
    pub fn oldest(&self) -> Option<&str> {
        self.awaiting.front().map(|l| l.text.as_str())
    }

    /// Takes the lines answered since the last call.
    pub fn take_answered(&mut self) -> Vec<Answered> {
        self.answered.drain(..).collect()
    }

    /// Takes the reports that came since the last call.
    pub fn take_reports(&mut self) -> Vec<Value> {
        std::mem::take(&mut self.reports)
    }

    /// Lines that were not JSON, and answers that belong to no line.
    pub fn strays(&self) -> &[String] {
        &self.strays
    }

    /// Number of banners seen.
    pub fn banners(&self) -> usize {
        self.banners
    }

    /// The machine state last reported.
    pub fn stat(&self) -> Option<i64> {
        self.stat
    }

    /// Cycle at which the firmware began to report that nothing moves; `None` while it moves.
    pub fn idle_since(&self) -> Option<u64> {
        self.idle_since
    }

    /// Cycle at which the last line came from the firmware.
    pub fn heard_at(&self) -> u64 {
        self.heard_at
    }

    /// Runs the machine to a cycle, sending and listening.
    pub fn run_until(&mut self, machine: &mut impl Runs, cycle: u64) -> Result<()> {
        while self.run_until_line(machine, cycle)? {}
        Ok(())
    }

    /// Runs the machine for a time, sending and listening.
    pub fn run_for_ms(&mut self, machine: &mut impl Runs, ms: u64) -> Result<()> {
        self.run_until(machine, machine.cycle() + machine.cycles(ms))
    }

    /// Like `run_until`, but stops after any line from the firmware. Returns false when the time is up.
    pub fn run_until_line(&mut self, machine: &mut impl Runs, cycle: u64) -> Result<bool> {
        self.fill(machine);
        while let Some((at, byte)) = self.interjections.front().copied()
            && at <= machine.cycle()
        {
            self.interjections.pop_front();
            machine.send_now(byte);
        }
        let next = self.interjections.front().map_or(u64::MAX, |(at, _)| *at);
        machine.run_until_line(cycle.min(next))?;
        self.listen(machine);
        self.fill(machine);
        Ok(machine.cycle() < cycle)
    }

    /// Runs until the banner comes, then a little longer until the line is silent. Then it decides for TinyG's dialect
    /// on a port whose dialect is undecided, if it is to speak that.
    pub fn boot(&mut self, machine: &mut impl Runs, timeout_ms: u64) -> Result<()> {
        let seen = self.banners;
        let end = machine.cycle() + machine.cycles(timeout_ms);
        while self.banners == seen {
            if !self.run_until_line(machine, end)? {
                bail!("{}", self.no_banner(machine, timeout_ms));
            }
        }
        self.run_for_ms(machine, 50)?;
        if self.speech == Speech::TinyG {
            self.ask(machine, "{}", 1_000)?;
        }
        Ok(())
    }

    fn no_banner(&self, machine: &impl Runs, timeout_ms: u64) -> String {
        let garbled = machine.garbled();
        let heard = match self.strays.last() {
            _ if garbled > 0 => format!("{garbled} bytes came at another speed"),
            Some(line) => format!("last heard: {line}"),
            None => "nothing was heard".to_string(),
        };
        format!("no SYSTEM READY within {timeout_ms} ms of reset; {heard}")
    }

    /// Sends a line at once, ahead of all queued lines and whatever is in flight.
    pub fn send(&mut self, machine: &mut impl Runs, number: usize, text: &str) {
        let name = match self.speech {
            Speech::TinyG => {
                machine.send(text.as_bytes());
                control_name(text)
            }
            Speech::Grbl => {
                machine.send(speech::translated(text).as_bytes());
                None
            }
        };
        machine.send(b"\n");
        self.awaiting.push_back(Line { number, text: text.to_string(), name });
    }

    /// Sends a line at once and waits for its answer.
    pub fn ask(
        &mut self,
        machine: &mut impl Runs,
        text: &str,
        timeout_ms: u64,
    ) -> Result<Response> {
        const ASKED: usize = usize::MAX;
        self.send(machine, ASKED, text);
        let end = machine.cycle() + machine.cycles(timeout_ms);
        loop {
            let more = self.run_until_line(machine, end)?;
            if let Some(i) = self.answered.iter().position(|a| a.number == ASKED) {
                return self.answered.remove(i).map(|a| a.response).context("lost an answer");
            }
            if !more {
                bail!("no answer to {text} within {timeout_ms} ms");
            }
        }
    }

    /// Has the firmware change to another speed and follows it.
    pub fn change_speed(&mut self, machine: &mut impl Runs, baud: u32) -> Result<()> {
        let response = self.ask(machine, &format!("{{baud:{baud}}}"), 1_000)?;
        if response.status != 0 {
            bail!("the firmware refuses {baud} baud with status {}", response.status);
        }
        self.run_for_ms(machine, SPEED_CHANGE_MS)?;
        machine.set_baud(baud);
        Ok(())
    }

    fn fill(&mut self, machine: &mut impl Runs) {
        while self.awaiting.len() < self.limit && !self.is_stopped {
            let Some((number, text)) = self.queue.pop_front() else { return };
            self.send(machine, number, &text);
        }
    }

    fn listen(&mut self, machine: &mut impl Runs) {
        for byte in machine.receive() {
            if matches!(byte, XON | XOFF) {
                self.is_stopped = byte == XOFF;
            } else if byte != b'\n' && byte != b'\r' {
                self.partial.push(byte);
            } else if !self.partial.is_empty() {
                let line = String::from_utf8_lossy(&self.partial).into_owned();
                self.partial.clear();
                self.heard_at = machine.cycle();
                self.hear(&line);
            }
        }
    }

    fn hear(&mut self, line: &str) {
        let incoming = match self.speech {
            Speech::TinyG => classify(line),
            Speech::Grbl => speech::classify(line),
        };
        match incoming {
            Incoming::Banner => self.banners += 1,
            Incoming::Report(report) => {
                self.note_state(&report);
                if let (Speech::Grbl, Value::Object(values)) = (self.speech, &report) {
                    self.shown.extend(values.clone());
                }
                self.reports.push(report);
            }
            Incoming::Response(mut response) => {
                if self.speech == Speech::Grbl {
                    response.body = Value::Object(std::mem::take(&mut self.shown));
                }
                self.answer(response);
            }
            Incoming::Late => self.late += 1,
            Incoming::OtherGreeting => {}
            Incoming::Other(line) => self.strays.push(line),
        }
    }

    fn note_state(&mut self, value: &Value) {
        let Some(stat) = state_of(value) else { return };
        self.stat = Some(stat);
        self.idle_since = is_idle(stat).then(|| self.idle_since.unwrap_or(self.heard_at));
    }

    fn answer(&mut self, response: Response) {
        self.note_state(&response.body);
        let named = |l: &Line| {
            let name = l.name.as_deref();
            name.is_some_and(|n| response.body.get(n).is_some())
        };
        let plain = |l: &Line| l.name.is_none();
        let at = self
            .awaiting
            .iter()
            .position(named)
            .or_else(|| self.awaiting.iter().position(plain))
            .unwrap_or(0);
        match self.awaiting.remove(at) {
            Some(Line { number, text, .. }) => {
                self.answered.push_back(Answered { number, text, response });
            }
            None => self.strays.push(response.raw),
        }
    }
}
