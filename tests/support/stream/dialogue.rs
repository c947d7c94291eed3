//! A conversation of two streams, had and judged.
//!
//! Every line is answered once, in its port's order; questions are answered within 20 ms unless their sender holds the machine back; what
//! has been answered by 0 has been done, and what has been dropped has not; the machine comes to rest, and stands where
//! it says.

use kerf::boards::outputs;

use super::answer::{Answer, Heard, read};
use super::course::Course;
use super::deeds::{Deed, Setup};
use super::json::Value;
use super::ledger::{Cut, Sent};
use super::lines::{AXES, Effect};
use super::port::{BYTES_MS, Port, Put};
use crate::side::Side;

/// How long a byte takes, ms.
const BYTE_MS: f64 = 0.0869;
/// Bytes of answers that may have been on their way when their lines were killed: the ring, the response that is half sent, and what is
/// said until the kill is seen.
const UNDER_WAY: usize = 800;
/// Lines that come within so many ms of a kill on the other port may be dropped, or not.
const ABOUT_MS: u64 = 10;
/// Characters of two writes make a flush within so many ms.
const TOGETHER_MS: u64 = 30;
/// Longest that the machine may take to come to rest.
const REST_MS: u64 = 60_000;
/// Steps in a mm, and how far off a position is that is told to 0.001 mm.
const STEPS_MM: f64 = 1_280.0;
const CLOSE: f64 = 1.2;

/// How the machine moves: fast, for there is much to do. M0 waits for a tilde, and answers have the numbers of their lines.
const MODES: [&str; 5] = [
    "x:{vm:3000,fr:3000,jm:2000,ac:0}",
    "y:{vm:3000,fr:3000,jm:2000,ac:0}",
    "z:{vm:3000,fr:3000,jm:2000,ac:0}",
    "psw:1,jv:4,xsn:0,ysn:0,zsx:0",
    "uda0:\"0x0\",udb0:\"0x0\"",
];

type Outcome<T> = Result<T, String>;

/// A machine, and the senders on its two ports.
pub struct Dialogue<S> {
    side: S,
    ports: [Port; 2],
    course: Course,
    now: u64,
    /// The number of the next line.
    id: u32,
    /// Footers have a checksum.
    sums: bool,
    /// What has come of the line that is being heard, and all bytes and lines so far.
    partial: [Vec<u8>; 2],
    heard: [usize; 2],
    story: Vec<String>,
    banners: usize,
    acks: [usize; 2],
    /// What each port has set its value to.
    values: [u16; 2],
    /// Until when lines may be dropped although none was sent behind what drops them.
    doubt: u64,
    /// When an exclamation mark was sent last, since the machine was at rest; and a percent sign.
    held: Option<u64>,
    percent: Option<u64>,
    alarmed: bool,
    /// The answer to the last line of the dialogue's own.
    told: Option<Answer>,
    /// Longest that an answer to a question may take, ms; and has taken.
    prompt: f64,
    pub slowest: f64,
    /// Position that is told less the steps made, of each axis.
    offsets: Option<[f64; 3]>,
}

impl<S: Side> Dialogue<S> {
    /// With a machine that is to answer questions within so many ms.
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

    /// A machine that has never been used boots, and is set up to move.
    pub fn begin(&mut self) -> Outcome<()> {
        self.side.wire(&[]);
        while self.banners < 2 {
            self.tick()?;
            if self.now > 3_000 {
                return Err("no SYSTEM READY".to_string());
            }
        }
        for modes in MODES {
            self.ask(modes)?;
        }
        self.rest()
    }

    /// Has a conversation.
    pub fn play(&mut self, setup: &Setup, deeds: &[Deed]) -> Outcome<()> {
        self.story.push(format!("{setup:?}"));
        self.set_up(setup)?;
        for deed in deeds {
            self.story.push(format!("{} ms: {deed:?}", self.now));
            match deed {
                Deed::Feed(main, lines) => {
                    let port = if *main { setup.main } else { 1 - setup.main };
                    self.ports[port].queue.extend(lines.iter().cloned());
                }
                Deed::Characters(port, characters, after) => {
                    self.ports[*port].inserts.push_back(((*after).into(), characters));
                }
                Deed::Hold(port, holds) => self.hold(*port, *holds),
                Deed::Ask(port) => self.ports[*port].asks = true,
                Deed::Wait(ms) => self.run((*ms).into())?,
                Deed::Rest => self.rest()?,
            }
        }
        self.rest()?;
        self.ask("ex:1,rxm:1")?;
        self.sums = false;
        self.story.clear();
        Ok(())
    }

    /// All that was done, and heard, of a conversation that failed.
    pub fn story(&self) -> String {
        self.story.join("\n")
    }

    fn set_up(&mut self, setup: &Setup) -> Outcome<()> {
        let Setup { ex, rxm, sv, ec, jv, .. } = setup;
        self.ask(&format!("sv:{sv},ec:{ec},jv:{jv},ex:{ex}"))?;
        // Its answer counts already so.
        self.sums = *rxm == 0;
        self.ask(&format!("rxm:{rxm}"))?;
        // The planner takes up settings with the first move behind them, which keeps the chip busy for some ms.
        self.ask("gc:\"g91 g0 z0.025\"")?;
        self.run(100)?;
        self.course.start();
        self.ports.iter_mut().for_each(|port| {
            port.set_up(setup);
            port.counted = [port.carried(); 2];
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

    /// A ms.
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

    /// A port's sender puts on the line what it may.
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

    /// Lines have been begun, from this number on.
    fn begun(&mut self, port: usize, from: u32) {
        let (doubted, heard) = (self.now <= self.doubt, self.heard[port]);
        let ledger = &mut self.ports[port].ledger;
        let mut drops = false;
        for sent in ledger.waiting.iter_mut().filter(|sent| sent.id >= from) {
            self.story.push(format!("{} ms: {port}: {:?}", self.now, sent.line.text));
            if doubted && sent.is_data() {
                (sent.cut, sent.heard) = (Cut::Perhaps, heard);
            }
            match sent.line.effect {
                Effect::Spindle => self.course.turns(),
                Effect::Flush | Effect::Alarm => drops = true,
                _ => {}
            }
            self.alarmed |= sent.line.effect == Effect::Alarm;
        }
        if drops {
            self.held = Some(self.now);
            self.cut(port, Cut::Perhaps);
            self.course.doubt();
            self.doubt = u64::MAX;
        }
    }

    /// A real-time character has been sent.
    fn acts(&mut self, port: usize, character: u8) {
        if b"~%\x04".contains(&character) {
            self.ports[port].break_line();
        }
        let since = |then: Option<u64>| then.map(|then| self.now - then);
        match character {
            4 => {
                self.held = Some(self.now);
                self.cut(port, Cut::Surely);
            }
            b'%' => {
                self.percent = Some(self.now);
                if self.held.is_some() {
                    self.cut(port, Cut::Perhaps);
                }
            }
            b'!' => {
                let flushes = since(self.percent).is_some_and(|ms| ms <= TOGETHER_MS);
                self.held = Some(self.now);
                if flushes {
                    self.cut(port, Cut::Perhaps);
                }
            }
            _ => {}
        }
    }

    /// What has come on both ports may be dropped, or is.
    fn cut(&mut self, by: usize, cut: Cut) {
        let now = self.now;
        let mut goes_on = [false; AXES.len()];
        let mut turns = false;
        for (number, port) in self.ports.iter_mut().enumerate() {
            let begun = port.has_begun();
            let last = port.ledger.waiting.last().map(|sent| sent.id);
            port.ledger.cut(cut, self.heard[number], |sent| {
                // One that has come in part, of JSON, may not be known as G-code yet; of the other port none may have come.
                let partly = begun && Some(sent.id) == last;
                let wrapped = sent.line.text.starts_with('{');
                let late = number != by && (now - sent.begun < 2 || port.by_pin);
                if partly && (wrapped || number != by) || late { Cut::Perhaps } else { Cut::Surely }
            });
            for sent in
                port.ledger.waiting.iter().filter(|sent| sent.is_data() && sent.cut != Cut::Surely)
            {
                match sent.line.effect {
                    Effect::Move(axis, _) => goes_on[axis] = true,
                    Effect::Spindle => turns = true,
                    _ => {}
                }
            }
        }
        self.course.cut(now, cut, goes_on, turns);
        self.doubt = self.doubt.max(now + ABOUT_MS);
    }

    /// A line has been heard.
    fn line(&mut self, port: usize) -> Outcome<()> {
        let line = String::from_utf8_lossy(&std::mem::take(&mut self.partial[port])).to_string();
        self.story.push(format!("{} ms:     {port} heard {line}", self.now));
        if self.banners < 2 && !line.contains("SYSTEM READY") {
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

    /// A line is answered.
    fn answer(&mut self, port: usize, answer: Answer) -> Outcome<()> {
        let sent = self.ports[port].ledger.answer(&answer)?;
        self.judge_status(port, &sent, &answer)?;
        if self.sums {
            self.ports[port].counted[1] += answer.told as usize;
        }
        let clear = answer.status == 0;
        match sent.line.effect {
            Effect::Move(axis, steps) if clear => {
                self.course.moved(axis, steps, sent.epoch, sent.cut == Cut::Perhaps);
            }
            Effect::Set(value) if clear => self.values[port] = value,
            Effect::Get => self.check_value(port, &answer)?,
            Effect::Flush if !self.alarmed => {
                let drops = |sent: &Sent| sent.line.effect == Effect::Flush;
                let more = self.ports.iter().any(|port| port.ledger.waiting.iter().any(drops));
                self.doubt = if more { u64::MAX } else { self.now + ABOUT_MS };
                // Lines that came behind it may have been dropped with it.
                self.course.doubt();
            }
            _ => {}
        }
        self.told = Some(answer);
        Ok(())
    }

    fn judge_status(&self, port: usize, sent: &Sent, answer: &Answer) -> Outcome<()> {
        let status = answer.status;
        let other_feeds = self.ports[1 - port].fed;
        let wrong = match (sent.is_data(), status) {
            (true, 0) => {
                let late = self.heard[port] - sent.heard > UNDER_WAY;
                sent.line.too_long || sent.cut == Cut::Surely && late
            }
            (true, 5) => sent.cut == Cut::No,
            (true, 107) => !sent.line.too_long,
            // A hold that began when nothing moved holds the port that fed last.
            (true, 117) => !other_feeds && self.held.is_none(),
            (true, 203 | 208) => !self.alarmed,
            (true, _) => true,
            (false, 100) => !sent.line.text.contains("none"),
            (false, 106) => sent.line.effect != Effect::Flush,
            (false, status) => status != 0,
        };
        if wrong {
            Err(format!("{:?} ({:?}) is answered {answer:?}", sent.line.text, sent.cut))
        } else {
            Ok(())
        }
    }

    fn check_value(&self, port: usize, answer: &Answer) -> Outcome<()> {
        let name = if port == 0 { "uda0" } else { "udb0" };
        let told = answer.told(name).and_then(Value::text);
        let is = format!("0x{:x}", self.values[port]);
        if told == Some(&is) { Ok(()) } else { Err(format!("{name} is {is}, and {answer:?}")) }
    }

    /// A question that is due has been answered in time.
    fn check_due(&mut self, port: usize) -> Outcome<()> {
        let (heard, now) = (self.heard[port], self.now);
        let Some(sent) = self.ports[port].ledger.waiting.iter_mut().find(|sent| sent.due) else {
            return Ok(());
        };
        let Some(ended) = sent.ended else {
            sent.heard = heard;
            return Ok(());
        };
        let said = (heard - sent.heard) as f64 * BYTE_MS;
        let took = (now - ended) as f64 - said;
        self.slowest = self.slowest.max(took);
        if took <= self.prompt {
            return Ok(());
        }
        Err(format!("{:?} on port {port} is not answered", sent.line.text))
    }

    /// Asks something of its own, and waits for the answer.
    fn ask(&mut self, pairs: &str) -> Outcome<Answer> {
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

    /// Waits until all is answered and nothing moves, and looks whether it is as it is to be.
    fn rest(&mut self) -> Outcome<()> {
        let from = self.now;
        let (mut last, mut quiet) = (self.side.steps(), 0);
        loop {
            if self.now - from > REST_MS {
                return Err("the machine does not come to rest".to_string());
            }
            self.relieve()?;
            self.run(50)?;
            let (steps, idle) = (self.side.steps(), self.ports.iter().all(Port::is_idle));
            // What waits for a tilde gets one.
            quiet = if steps == last && idle { quiet + 1 } else { 0 };
            last = steps;
            if quiet < 2 {
                continue;
            }
            let answer = self.ask("stat:n,qr:n,hold:n")?;
            let number = |name| answer.told(name).and_then(Value::number).unwrap_or(-1.0) as i32;
            match number("stat") {
                2 => drop(self.ask("clear:n")?),
                1 | 3 | 4 if number("qr") == 64 && number("hold") == 0 => break,
                _ => {}
            }
        }
        self.course.rest()?;
        (self.held, self.percent, self.alarmed, self.doubt) = (None, None, false, 0);
        self.ports.iter_mut().for_each(|port| port.fed = false);
        self.check_counts()?;
        self.check_position()
    }

    /// Lets go of all that holds the machine back.
    fn relieve(&mut self) -> Outcome<()> {
        (0..2)
            .filter(|port| self.ports[*port].holds)
            .collect::<Vec<_>>()
            .into_iter()
            .for_each(|port| self.hold(port, false));
        // A character of two that make a flush is not to come now.
        self.send(0, b"~\x90\x95");
        self.ports[0].break_line();
        Ok(())
    }

    /// The lengths told are those of what was sent, and everybody who asked was told that somebody is there.
    fn check_counts(&self) -> Outcome<()> {
        for (number, port) in self.ports.iter().enumerate() {
            let [sent, told] = port.counted;
            if self.sums && !(sent - port.slack..=sent).contains(&told) {
                return Err(format!("{told} bytes of {sent} were counted on port {number}"));
            }
            if port.enquiries > 0 && self.acks[number] == 0 {
                return Err(format!("no ack on port {number}"));
            }
        }
        Ok(())
    }

    /// Where the machine says that it is its motors are.
    fn check_position(&mut self) -> Outcome<()> {
        let answer = self.ask("mpo:n")?;
        let steps = self.side.steps();
        let mut offsets = [0.0; AXES.len()];
        for (m, axis) in AXES.iter().enumerate() {
            let told = answer.told("mpo").and_then(|mpo| mpo.get(axis)?.number());
            let told = told.ok_or_else(|| format!("no {axis} in {answer:?}"))?;
            offsets[m] = told * STEPS_MM - steps[m] as f64;
        }
        let was = *self.offsets.get_or_insert(offsets);
        match (0..AXES.len()).find(|m| (was[*m] - offsets[*m]).abs() > CLOSE) {
            None => Ok(()),
            Some(m) => {
                Err(format!("{} is {} steps off what it says", AXES[m], offsets[m] - was[m]))
            }
        }
    }
}
