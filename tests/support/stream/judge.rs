//! Judges a conversation: its answers, and the effects of real-time characters on lines.

use super::answer::Answer;
use super::dialogue::{Dialogue, Outcome};
use super::json::Value;
use super::ledger::{Cut, Sent};
use super::lines::{AXES, Effect};
use crate::side::Side;

/// Bytes of answers that may have been on their way when their lines were killed: the ring, the response that is half
/// sent, and what is sent until the kill is noticed.
const UNDER_WAY: usize = 800;
/// Time around a kill on the other port within which lines may or may not be dropped, ms.
const ABOUT_MS: u64 = 10;
/// Time within which two characters of separate writes make a flush, ms.
const TOGETHER_MS: u64 = 30;
/// Time that a byte takes on the line, ms.
const BYTE_MS: f64 = 0.0869;
/// Steps in a mm, and the tolerance, in steps, of a position that is reported to 0.001 mm.
const STEPS_MM: f64 = 1_280.0;
const CLOSE: f64 = 1.2;

impl<S: Side> Dialogue<S> {
    /// Takes note that lines have been begun, from this number on.
    pub(super) fn begun(&mut self, port: usize, from: u32) {
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

    /// Takes note that a real-time character has been sent.
    pub(super) fn acts(&mut self, port: usize, character: u8) {
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

    /// Takes note that the lines on both ports may be dropped, or are dropped.
    pub(super) fn cut(&mut self, by: usize, cut: Cut) {
        let now = self.now;
        let mut goes_on = [false; AXES.len()];
        let mut turns = false;
        for (number, port) in self.ports.iter_mut().enumerate() {
            let (begun, led) = (port.has_begun(), port.has_only_led());
            let last = port.ledger.waiting.last().map(|sent| sent.id);
            port.ledger.cut(cut, self.heard[number], |sent| {
                // A line of JSON of which a part has come may not be recognized as G-code yet. On the other port
                // perhaps none of the line has come.
                let partly = begun && Some(sent.id) == last;
                let wrapped = led || sent.line.text.starts_with('{');
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

    /// Takes the answer to a line.
    pub(super) fn answer(&mut self, port: usize, answer: Answer) -> Outcome<()> {
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
                // Lines that came behind the flush may have been dropped with it.
                self.course.doubt();
            }
            _ => {}
        }
        self.told = Some(answer);
        Ok(())
    }

    pub(super) fn judge_status(&self, port: usize, sent: &Sent, answer: &Answer) -> Outcome<()> {
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

    pub(super) fn check_value(&self, port: usize, answer: &Answer) -> Outcome<()> {
        let name = if port == 0 { "uda0" } else { "udb0" };
        let told = answer.told(name).and_then(Value::text);
        let is = format!("0x{:x}", self.values[port]);
        if told == Some(&is) { Ok(()) } else { Err(format!("{name} is {is}, and {answer:?}")) }
    }

    /// Checks that a question that is due is answered in time.
    pub(super) fn check_due(&mut self, port: usize) -> Outcome<()> {
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

    /// Checks that the reported lengths are those of what was sent, and that every port with an enquiry has got an
    /// answer to it.
    pub(super) fn check_counts(&self) -> Outcome<()> {
        for (number, port) in self.ports.iter().enumerate() {
            if self.sums && !port.counts_right() {
                return Err(format!("{:?} bytes were counted on port {number}", port.counted));
            }
            if port.enquiries > 0 && self.acks[number] == 0 {
                return Err(format!("no ack on port {number}"));
            }
        }
        Ok(())
    }

    /// Checks that the motors are where the machine says.
    pub(super) fn check_position(&mut self) -> Outcome<()> {
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
