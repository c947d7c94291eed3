//! Plays and judges a random conversation, on the host or on the simulated chip.
//!
//! Whatever is sent, and whatever switches do, this must hold: the machine comes to rest, every line is answered
//! once, the end of each jog is reported, outputs are as reported, and the motors are where the machine says that it
//! is, by the steps that were made ([`PositionModel`]).

use kerf::boards::outputs;

use crate::ops::{BY_HAND, Op};
use crate::position_model::{PositionModel, SETTINGS, SWITCHES, number};
use crate::sender::Sender;
use crate::side::Side;

/// Longest time in which the greeting of grbl's dialect comes behind the banner, ms.
const GREETS_MS: u64 = 20;
/// Lines in flight on each port.
const IN_FLIGHT: [usize; 2] = [4, 2];
/// Longest time until the machine comes to rest, ms.
const REST_MS: u64 = 60_000;
/// Values of `stat` in which nothing runs.
const READY: f64 = 1.0;
const STOPPED: f64 = 3.0;
const ENDED: f64 = 4.0;
/// Values of `stat` in which G-code is refused.
const ALARM: f64 = 2.0;
const SHUTDOWN: f64 = 11.0;
/// Free blocks of an empty queue.
const BLOCKS: f64 = 61.0;
/// Tolerance of a sum of three numbers with three decimals.
const ROUNDED: f64 = 0.0016;

/// A sender's side of a conversation, and the known state of the machine.
pub struct Session<S> {
    side: S,
    ports: [Sender; 2],
    position_model: PositionModel,
    /// Inputs that are closed by hand, as bits.
    closed: u16,
    /// What has been done, to be printed after a failure.
    log: Vec<String>,
}

type Outcome<T> = Result<T, String>;

impl<S: Side> Session<S> {
    /// A session with a machine that is about to boot.
    pub fn new(mut side: S) -> Self {
        side.wire(&SWITCHES, 0);
        let ports = [Sender::new(0), Sender::new(1)];
        let position_model = PositionModel::at_start(side.steps());
        Self { side, ports, position_model, closed: 0, log: Vec::new() }
    }

    /// Boots a machine with empty EEPROM.
    pub fn begin(&mut self) -> Outcome<()> {
        self.greet()?;
        // With this setting M0 waits for a tilde.
        for line in SETTINGS.into_iter().chain(["{psw:1}"]) {
            self.line(0, line)?;
        }
        // Time for the settings to be stored.
        self.run(2_000)?;
        self.rest()
    }

    /// Waits for the banner of a machine that boots. Its position is then 0 wherever it stands.
    pub fn greet(&mut self) -> Outcome<()> {
        self.ports.iter_mut().for_each(Sender::reset);
        let mut waited = 0;
        while self.ports.iter().any(|port| port.banners == 0) {
            self.run(10)?;
            waited += 10;
            if waited > 3_000 {
                return Err("no SYSTEM READY".to_string());
            }
        }
        self.position_model = PositionModel::at_start(self.side.steps());
        // Behind the banner comes the greeting of grbl's dialect.
        self.run(GREETS_MS)?;
        // This settles TinyG's dialect on the ports. In that dialect a reset restarts the board.
        self.line(0, "{stat:n}")?;
        self.line(1, "{stat:n}")?;
        while self.ports.iter().any(|port| port.in_flight() > 0) {
            self.run(2)?;
            waited += 2;
            if waited > 3_000 {
                return Err("a port is not answered".to_string());
            }
        }
        Ok(())
    }

    /// Plays the actions. Returns those that remain after a reset; `None` if all are done.
    pub fn play<'a>(&mut self, ops: &'a [Op]) -> Outcome<Option<&'a [Op]>> {
        for (at, op) in ops.iter().enumerate() {
            self.log.push(format!("{op:?}"));
            match op {
                Op::Line(port, line) => self.line(*port, line)?,
                Op::Characters(port, characters) => self.send(*port, characters),
                Op::Within(before, characters, after) => {
                    self.patience(0)?;
                    self.position_model.expect(before);
                    self.position_model.expect(after);
                    self.send(
                        0,
                        &[before.as_bytes(), characters, after.as_bytes(), b"\n"].concat(),
                    );
                }
                Op::Input(input, closed) => self.work(*input, *closed),
                Op::Hold(hold) => self.side.set_aux_cts(*hold),
                Op::Wait(ms) => self.run(*ms)?,
                Op::Rest => self.rest()?,
                Op::Reset => {
                    self.relieve();
                    // Nothing is then on its way that would arrive during the start.
                    self.run(20)?;
                    self.send(0, b"g91 g0 x\x18");
                    return Ok(ops.get(at + 1..));
                }
            }
        }
        Ok(None)
    }

    /// Comes to rest, and goes to a place that is known to the step, near where the motors began.
    pub fn finish(&mut self) -> Outcome<()> {
        self.rest()?;
        let (place, line) = self.position_model.way_home();
        self.line(0, &line)?;
        self.rest()?;
        self.position_model.arrive(&place, self.side.steps())?;
        self.log.clear();
        self.ports.iter_mut().for_each(|port| port.heard.clear());
        Ok(())
    }

    /// Returns all that was done and heard in a conversation that failed. Lines that were heard repeatedly come once.
    pub fn story(&self) -> String {
        let mut story: Vec<_> = self.log.iter().map(|done| format!("  {done}\n")).collect();
        story.push("heard\n".to_string());
        for (n, port) in self.ports.iter().enumerate() {
            story.extend(port.heard.iter().map(|line| format!("  {n}: {line}\n")));
        }
        story.dedup();
        story.concat()
    }

    /// Lets time pass.
    pub fn run(&mut self, ms: u64) -> Outcome<()> {
        self.side.run_ms(ms);
        for port in &mut self.ports {
            port.hear(&mut self.side)?;
        }
        Ok(())
    }

    fn send(&mut self, port: usize, bytes: &[u8]) {
        self.ports[port].send(&mut self.side, bytes);
    }

    /// Sends a line as soon as the port has fewer unanswered lines than it may have.
    fn line(&mut self, port: usize, line: &str) -> Outcome<()> {
        self.patience(port)?;
        self.position_model.expect(line);
        self.send(port, format!("{line}\n").as_bytes());
        Ok(())
    }

    /// Waits until another line may be sent on the port.
    fn patience(&mut self, port: usize) -> Outcome<()> {
        let mut waited = 0;
        while self.ports[port].in_flight() >= IN_FLIGHT[port] {
            self.run(20)?;
            waited += 20;
            // The machine may be held with its queue full.
            if waited % 400 == 0 {
                self.relieve();
            }
            if waited > REST_MS {
                return Err(format!("no answer on port {port}"));
            }
        }
        Ok(())
    }

    /// Releases whatever keeps the machine from moving.
    fn relieve(&mut self) {
        for input in BY_HAND {
            if self.closed & 1 << input != 0 {
                self.work(input, false);
            }
        }
        self.side.set_aux_cts(false);
        self.send(0, b"~");
    }

    /// Actuates an input by hand.
    fn work(&mut self, input: usize, closed: bool) {
        self.closed = self.closed & !(1 << input) | u16::from(closed) << input;
        self.position_model.disturb();
        self.side.set_input(input, closed);
    }

    /// Waits until the machine is at rest. Then checks that its position and its outputs are as it reports.
    fn rest(&mut self) -> Outcome<()> {
        let (mut before, mut waited) = (None, 0);
        while !self.is_at_rest(&mut before)? {
            self.relieve();
            self.run(50)?;
            waited += 50;
            if waited > REST_MS {
                return Err("the machine does not come to rest".to_string());
            }
        }
        self.check_position()?;
        self.check_outputs()?;
        match self.ports.iter().map(|port| port.jogs).sum() {
            0 => Ok(()),
            jogs => Err(format!("{jogs} jogs have no end")),
        }
    }

    /// Whether nothing moves and nothing waits. Clears an alarm.
    fn is_at_rest(&mut self, before: &mut Option<[i64; 4]>) -> Outcome<bool> {
        let steps = self.side.steps();
        let still = before.replace(steps) == Some(steps);
        if !still || self.ports.iter().any(|port| port.in_flight() > 0) {
            return Ok(false);
        }
        let Some(told) = self.ask("{stat:n,qr:n}", "stat")? else { return Ok(false) };
        match number(&told, "") {
            Some(ALARM | SHUTDOWN) => {
                self.ask("{clear:n}", "clear")?;
                Ok(false)
            }
            Some(READY | STOPPED | ENDED) => Ok(number(&told, "\"qr\":") == Some(BLOCKS)),
            _ => Ok(false),
        }
    }

    /// Sends a request and waits for the answer. Returns what stands behind `name` in it; `None` if a queue flush has
    /// dropped it.
    fn ask(&mut self, line: &str, name: &str) -> Outcome<Option<String>> {
        self.line(0, line)?;
        let mut waited = 0;
        while self.ports[0].in_flight() > 0 {
            self.run(2)?;
            waited += 2;
            if waited > REST_MS {
                return Err(format!("{line} is not answered"));
            }
        }
        Ok(self.ports[0].told(name).map(str::to_string))
    }

    fn check_position(&mut self) -> Outcome<()> {
        let Some(told) = self.ask("{mpo:n}", "mpo")? else { return Err("no position".to_string()) };
        self.position_model.compare(&told, self.side.steps())?;
        let called = self.ask("{pos:n,ofs:n}", "pos")?.ok_or("no position of the system")?;
        let (called, offset) = called.split_once("\"ofs\":").ok_or("no offset")?;
        for axis in ["\"x\":", "\"y\":", "\"z\":", "\"a\":"] {
            let of = |text| number(text, axis).ok_or_else(|| format!("no {axis} in {text}"));
            if (of(called)? + of(offset)? - of(&told)?).abs() > ROUNDED {
                return Err(format!("{called} and offset {offset} are not {told}"));
            }
        }
        Ok(())
    }

    fn check_outputs(&mut self) -> Outcome<()> {
        let Some(told) = self.ask("{spe:n,spd:n,com:n,cof:n}", "spe")? else {
            return Err("no outputs".to_string());
        };
        let is = |name, bit| if number(&told, name) == Some(1.0) { bit } else { 0 };
        let turns = is("", outputs::SPINDLE);
        let told_on = turns
            | if turns != 0 { is("\"spd\":", outputs::COUNTERCLOCKWISE) } else { 0 }
            | is("\"com\":", outputs::MIST)
            | is("\"cof\":", outputs::FLOOD);
        let (on, _) = self.side.outputs();
        let on = if on & outputs::SPINDLE == 0 { on & !outputs::COUNTERCLOCKWISE } else { on };
        match on == told_on {
            true => Ok(()),
            false => Err(format!("outputs are {on:#b}, and {told}")),
        }
    }
}
