//! Plays and judges a conversation of two streams.
//!
//! What must hold: every line is answered once, in its port's order. Questions are answered within 20 ms unless their
//! sender holds the machine back. What was answered by 0 was done, and what was dropped was not. The machine comes to
//! rest, and stands where it says.

use kerf::boards::outputs;

use super::answer::{Answer, Heard, read};
use super::course::Course;
use super::json::Value;
use super::ops::{Op, Setup};
use super::port::{BYTES_MS, Port, Put};
use crate::side::Side;

/// Longest time until the machine comes to rest, ms.
const REST_MS: u64 = 60_000;

/// Settings of the machine: it moves fast, because there is much to do; M0 waits for a tilde; answers have the
/// numbers of their lines.
const MODES: [&str; 5] = [
    "x:{vm:3000,fr:3000,jm:2000,ac:0}",
    "y:{vm:3000,fr:3000,jm:2000,ac:0}",
    "z:{vm:3000,fr:3000,jm:2000,ac:0}",
    "psw:1,jv:4,xsn:0,ysn:0,zsx:0",
    "uda0:\"0x0\",udb0:\"0x0\"",
];

/// The greeting of grbl's dialect, and the longest time in which it comes behind the banner, ms.
const GRBL: &str = "Grbl 1.1h ['$' for help]";
const GREETS_MS: u64 = 20;

pub(super) type Outcome<T> = Result<T, String>;

/// A machine, and the senders on its two ports.
pub struct Dialogue<S> {
    pub(super) side: S,
    pub(super) ports: [Port; 2],
    pub(super) course: Course,
    pub(super) now: u64,
    /// The number of the next line.
    pub(super) id: u32,
    /// Whether footers have a checksum.
    pub(super) sums: bool,
    /// For each port, the part of the next line that has come, and the number of bytes heard so far.
    pub(super) partial: [Vec<u8>; 2],
    pub(super) heard: [usize; 2],
    pub(super) story: Vec<String>,
    pub(super) banners: usize,
    /// Whether both ports have been put into TinyG's dialect.
    pub(super) settled: bool,
    pub(super) acks: [usize; 2],
    /// The value that each port has set for itself.
    pub(super) values: [u16; 2],
    /// Time until which lines may be dropped, even lines that were sent after whatever drops them.
    pub(super) doubt: u64,
    /// Time of the last exclamation mark since the machine was at rest, and of the last percent sign.
    pub(super) held: Option<u64>,
    pub(super) percent: Option<u64>,
    pub(super) alarmed: bool,
    /// The answer to the last line of the dialogue itself.
    pub(super) told: Option<Answer>,
    /// Longest time that an answer to a question may take, and has taken, ms.
    pub(super) prompt: f64,
    pub slowest: f64,
    /// For each axis, the reported position minus the steps made.
    pub(super) offsets: Option<[f64; 3]>,
}

impl<S: Side> Dialogue<S> {
    /// A dialogue with a machine that must answer questions within `prompt` ms.
    pub fn new(side: S, prompt: f64) -> Self {
        let course = Course::new(side.steps());
        Self {
            side,
            ports: [Port::new(0), Port::new(1)],
            course,
            now: 0,
            id: 1,
            sums: false,
            partial: Default::default(),
            heard: [0; 2],
            story: Vec::new(),
            banners: 0,
            settled: false,
            acks: [0; 2],
            values: [0; 2],
            doubt: 0,
            held: None,
            percent: None,
            alarmed: false,
            told: None,
            prompt,
            slowest: 0.0,
            offsets: None,
        }
    }

    /// Boots a machine with empty EEPROM, and sets it up to move.
    pub fn begin(&mut self) -> Outcome<()> {
        self.side.wire(&[], 0);
        self.side.set_aux_cts(false);
        while self.banners < 2 {
            self.tick()?;
            if self.now > 3_000 {
                return Err("no SYSTEM READY".to_string());
            }
        }
        // Behind the banner comes the greeting of grbl's dialect.
        self.run(GREETS_MS)?;
        // TinyG's dialect on both ports from now on.
        let id = self.id;
        self.ports[1].own(id, &format!("{{tid:{id}}}"), self.now);
        self.id += 1;
        for modes in MODES {
            self.ask(modes)?;
        }
        self.rest()?;
        self.settled = true;
        Ok(())
    }

    /// Plays a conversation.
    pub fn play(&mut self, setup: &Setup, ops: &[Op]) -> Outcome<()> {
        self.story.push(format!("{setup:?}"));
        self.set_up(setup)?;
        for op in ops {
            self.story.push(format!("{} ms: {op:?}", self.now));
            match op {
                Op::Feed(main, lines) => {
                    let port = if *main { setup.main } else { 1 - setup.main };
                    self.ports[port].queue.extend(lines.iter().cloned());
                }
                Op::Characters(port, characters, after) => {
                    // The pin may stop the sender between two characters.
                    let one = self.ports[*port].by_pin;
                    let characters = if one { &characters[..1] } else { characters };
                    self.ports[*port].inserts.push_back(((*after).into(), characters));
                }
                Op::Hold(port, holds) => self.hold(*port, *holds),
                Op::Ask(port) => self.ports[*port].asks = true,
                Op::Wait(ms) => self.run((*ms).into())?,
                Op::Rest => self.rest()?,
            }
        }
        self.rest()?;
        self.ask("ex:1,rxm:1")?;
        self.sums = false;
        self.story.clear();
        Ok(())
    }

    /// Returns all that was done and heard in a conversation that failed.
    pub fn story(&self) -> String {
        self.story.join("\n")
    }

    fn set_up(&mut self, setup: &Setup) -> Outcome<()> {
        let Setup { ex, rxm, sv, ec, jv, .. } = setup;
        self.ask(&format!("sv:{sv},ec:{ec},jv:{jv},ex:{ex}"))?;
        // The answer to this setting already follows it.
        self.sums = *rxm == 0;
        self.ask(&format!("rxm:{rxm}"))?;
        // The planner applies settings with the next move, which keeps the chip busy for some ms.
        self.ask("gc:\"g91 g0 z0.025\"")?;
        self.run(100)?;
        self.course.start();
        self.ports.iter_mut().for_each(|port| {
            port.set_up(setup);
            port.count_anew();
        });
        Ok(())
    }

    fn hold(&mut self, port: usize, holds: bool) {
        let (bytes, level) = self.ports[port].hold(holds);
        self.send(port, bytes);
        if let Some(level) = level {
            self.side.set_aux_cts(level);
        }
    }

    fn send(&mut self, port: usize, bytes: &[u8]) {
        match port {
            0 => self.side.send(bytes),
            _ => self.side.send_aux(bytes),
        }
    }

    fn run(&mut self, ms: u64) -> Outcome<()> {
        (0..ms).try_for_each(|_| self.tick())
    }

    /// Lets a ms pass.
    fn tick(&mut self) -> Outcome<()> {
        let stopped = self.side.stops_aux();
        self.ports[1].stop_by_pin(stopped);
        (0..2).for_each(|port| self.emit(port));
        self.side.run_ms(1);
        self.now += 1;
        for port in 0..2 {
            let mut bytes = if port == 0 { self.side.heard() } else { self.side.heard_aux() };
            self.ports[port].heed(&mut bytes);
            for byte in bytes {
                self.heard[port] += 1;
                match byte {
                    b'\n' => self.line(port)?,
                    b'\r' => {}
                    byte => self.partial[port].push(byte),
                }
            }
            self.check_due(port)?;
        }
        let turns = self.side.outputs().0 & outputs::SPINDLE != 0;
        self.course.see(self.now, self.side.steps(), turns)
    }

    /// Puts on a port's line what its sender may send.
    fn emit(&mut self, number: usize) {
        let mut left = BYTES_MS;
        while left > 0 {
            let (axis, epoch) = (self.course.axis, self.course.epoch);
            let before = self.id;
            let put = self.ports[number].put(left, self.now, &mut self.id, axis, epoch);
            match put {
                Put::Nothing => return,
                Put::Bytes(bytes) => {
                    left -= bytes.len();
                    self.send(number, &bytes);
                    if self.id > before {
                        self.begun(number, before);
                    }
                }
                Put::Characters(characters) => {
                    left = left.saturating_sub(characters.len());
                    self.send(number, characters);
                    self.story.push(format!(
                        "{} ms: {number}: {:?}",
                        self.now,
                        characters.escape_ascii().to_string()
                    ));
                    characters.iter().for_each(|character| self.acts(number, *character));
                }
            }
        }
    }

    /// Takes a line that was heard.
    fn line(&mut self, port: usize) -> Outcome<()> {
        let line = String::from_utf8_lossy(&std::mem::take(&mut self.partial[port])).to_string();
        self.story.push(format!("{} ms:     {port} heard {line}", self.now));
        if self.banners < 2 && !line.contains("SYSTEM READY") {
            return Ok(());
        }
        // The greeting of grbl's dialect comes behind the banner while no dialect is settled.
        if !self.settled && ["", GRBL].contains(&line.as_str()) {
            return Ok(());
        }
        match read(&line, self.sums)? {
            Heard::Banner => {
                self.banners += 1;
                if self.banners > 2 { Err("it has started anew".to_string()) } else { Ok(()) }
            }
            Heard::Ack => {
                self.acks[port] += 1;
                let many = self.acks[port] > self.ports[port].enquiries;
                if many { Err("an ack that nobody asked for".to_string()) } else { Ok(()) }
            }
            Heard::Exception(13 | 37) => Err(format!("heard {line}")),
            Heard::Exception(_) | Heard::Report => Ok(()),
            Heard::Answer(answer) => self.answer(port, answer),
        }
    }

    /// Asks something for the dialogue itself, and waits for the answer.
    pub(super) fn ask(&mut self, pairs: &str) -> Outcome<Answer> {
        self.told = None;
        let id = self.id;
        let line = format!("{{{pairs},tid:{id}}}");
        self.ports[0].own(id, &line, self.now);
        self.id += 1;
        self.story.push(format!("{} ms: {line}", self.now));
        let from = self.now;
        loop {
            self.tick()?;
            match self.told.take() {
                Some(answer) if answer.id == Some(id) => return Ok(answer),
                _ if self.now - from > REST_MS => return Err(format!("{line} is not answered")),
                _ => {}
            }
        }
    }

    /// Waits until all lines are answered and nothing moves, and checks that all is as it must be.
    fn rest(&mut self) -> Outcome<()> {
        let from = self.now;
        let (mut last, mut quiet, mut rested) = (self.side.steps(), 0, 0);
        // A machine that waits at M0 reports that it rests as well. So it must report that twice, the second time
        // behind another tilde.
        while rested < 2 {
            if self.now - from > REST_MS {
                return Err("the machine does not come to rest".to_string());
            }
            self.relieve()?;
            self.run(50)?;
            let (steps, idle) = (self.side.steps(), self.ports.iter().all(Port::is_idle));
            // A line that waits for a tilde gets one.
            quiet = if steps == last && idle { quiet + 1 } else { 0 };
            last = steps;
            if quiet < 2 {
                continue;
            }
            let answer = self.ask("stat:n,qr:n,hold:n")?;
            let number = |name| answer.told(name).and_then(Value::number).unwrap_or(-1.0) as i32;
            match number("stat") {
                2 => drop(self.ask("clear:n")?),
                1 | 3 | 4 if number("qr") == 61 && number("hold") == 0 => rested += 1,
                _ => rested = 0,
            }
        }
        self.course.rest()?;
        (self.held, self.percent, self.alarmed, self.doubt) = (None, None, false, 0);
        self.ports.iter_mut().for_each(|port| port.fed = false);
        self.check_counts()?;
        self.check_position()
    }

    /// Releases whatever holds the machine back.
    fn relieve(&mut self) -> Outcome<()> {
        (0..2)
            .filter(|port| self.ports[*port].holds)
            .collect::<Vec<_>>()
            .into_iter()
            .for_each(|port| self.hold(port, false));
        // No `!` or `%` may come now that would make a flush with another one.
        self.send(0, b"~\x90\x95");
        self.ports[0].break_line();
        Ok(())
    }
}
