//! Automatic reports: status reports and queue reports.
//!
//! [`StatusReport`] is the list of what to report, with the values that were sent last. [`Report`] sends one status
//! report in steps. [`queue_report`] sends a queue report at once. The reporting task holds the transmitter from the
//! first step of a report to the last. [`Machine::moment`] makes all steps of a report describe the same moment.

use super::Format;
use super::Mode;
use super::token::{DEFAULT_TOKENS, Shown, Token};
use super::value::{SYNC_ERROR, Source};
use super::write::Writer;
use crate::config::Fixed;
use crate::progmem::Text;
use crate::protocol::{Machine, Out, Remembers, Value};
use crate::text;

/// The most entries of a status report.
pub const LONGEST_REPORT: usize = 36;

/// The number of bytes for one bit per entry.
const HIGH: usize = LONGEST_REPORT.div_ceil(8);

/// The list of the status report: its tokens, in order, and the value of each as last sent.
pub struct StatusReport {
    /// The lower eight bits of the tokens' numbers; the ninth bits are in `high`.
    low: [u8; LONGEST_REPORT],
    high: [u8; HIGH],
    /// The low 24 bits of each value, which saves 38 bytes. A change goes unnoticed only if it is a multiple of
    /// 16,777,216. For a position, which is compared in thousandths, that is 16.777216 m between two reports.
    sent: [[u8; 3]; LONGEST_REPORT],
    len: u8,
    /// Whether the list is new, so that the values in `sent` have no meaning.
    fresh: bool,
}

#[small]
impl StatusReport {
    /// Returns the token of an entry; `None` past the end.
    pub fn token(&self, index: u8) -> Option<Token> {
        (index < self.len).then(|| self.at(index))
    }

    fn at(&self, index: u8) -> Token {
        let place = usize::from(index);
        let low = self.low.get(place).copied().unwrap_or(0);
        let high = self.high.get(place / 8).copied().unwrap_or(0) >> (index % 8) & 1;
        Token::numbered(u16::from_le_bytes([low, high]))
    }

    /// Empties the list.
    pub fn clear(&mut self) {
        self.len = 0;
        self.fresh = true;
    }

    /// Writes a token into an entry. Returns whether there is room.
    fn put(&mut self, index: u8, token: Token) -> bool {
        let place = usize::from(index);
        let [number, ninth] = token.number().to_le_bytes();
        let (Some(low), Some(high)) = (self.low.get_mut(place), self.high.get_mut(place / 8))
        else {
            return false;
        };
        *low = number;
        let bit = 1 << (index % 8);
        *high = if ninth != 0 { *high | bit } else { *high & !bit };
        true
    }

    /// Adds a token, unless it is in the list already. The token must not be [far](Token::is_far). Returns whether
    /// there was room.
    pub fn add(&mut self, token: Token) -> bool {
        if (0..self.len).any(|index| self.at(index) == token) {
            return true;
        }
        if !self.put(self.len, token) {
            return false;
        }
        self.len += 1;
        self.fresh = true;
        true
    }

    /// Removes a token from the list.
    pub fn remove(&mut self, token: Token) {
        let Some(found) = (0..self.len).find(|&index| self.at(index) == token) else { return };
        for index in found + 1..self.len {
            self.put(index - 1, self.at(index));
        }
        self.len -= 1;
        self.fresh = true;
    }

    /// Records that `value` is being sent for an entry. Returns whether it differs from the value sent before.
    fn note(&mut self, index: u8, value: i32) -> bool {
        let [a, b, c, _] = value.to_le_bytes();
        match self.sent.get_mut(usize::from(index)) {
            Some(sent) => core::mem::replace(sent, [a, b, c]) != [a, b, c],
            None => false,
        }
    }
}

/// The list goes back to its default together with the settings.
#[small]
impl Remembers for StatusReport {
    fn new() -> Self {
        StatusReport {
            low: [0; LONGEST_REPORT],
            high: [0; HIGH],
            sent: [[0; 3]; LONGEST_REPORT],
            len: 0,
            fresh: true,
        }
    }

    fn restore(&mut self) {
        self.clear();
        for token in DEFAULT_TOKENS.get() {
            self.add(token);
        }
    }

    fn refresh(&mut self) {
        self.fresh = true;
    }
}

/// A status report that is being sent.
pub struct Report {
    index: u8,
    all: bool,
    /// Whether the next entry is the first of a line, so that the line describes the machine now.
    first: bool,
    /// Whether part of the current line has been written.
    begun: bool,
    format: Format,
}

#[small]
impl Report {
    /// Starts an automatic report of all changed entries, or of all entries. `None` if the settings want no status
    /// reports.
    #[inline(never)]
    pub fn begin(mode: Mode, machine: &mut impl Machine) -> Option<Report> {
        let verbosity = machine.settings().status_verbosity();
        if verbosity == 0 {
            return None;
        }
        let fresh = core::mem::take(&mut machine.memory().tinyg.fresh);
        let format = mode.format(machine);
        let all = fresh || verbosity > 1;
        Some(Report { index: 0, all, first: true, begun: false, format })
    }

    /// Handles one entry. Returns whether there is more to do. If no value has changed, nothing is sent.
    #[inline(never)]
    pub fn step(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool {
        let Some(token) = machine.memory().tinyg.token(self.index) else {
            self.end(out);
            return false;
        };
        machine.moment(core::mem::take(&mut self.first));
        let shown = token.read(machine);
        let value = match shown {
            Shown::Number(fixed) => fixed.value,
            Shown::Data(bits) => bits,
            Shown::Text(_) => 0,
        };
        let changed = machine.memory().tinyg.note(self.index, value);
        self.index += 1;
        if changed || self.all {
            let mut writer = Writer::body(out, &mut self.format);
            if !core::mem::replace(&mut self.begun, true) {
                writer.head(text!("sr"));
            }
            writer.key(token.name().bytes());
            writer.shown(shown);
        }
        true
    }

    /// Ends the line here, so that an answer can be sent in between. The rest follows in a line of its own, which
    /// describes its own moment. `false` in text mode, where every entry is a line already.
    pub fn split(&mut self, out: &mut impl Out) -> bool {
        if self.format.is_plain() {
            return false;
        }
        self.end(out);
        (self.first, self.begun) = (true, false);
        true
    }

    fn end(&mut self, out: &mut impl Out) {
        if self.begun {
            Writer::body(out, &mut self.format).tail();
        }
    }
}

/// Sends a queue report, if the settings want any: the free blocks, and at a higher verbosity the blocks added and
/// removed since the last report.
#[small]
#[inline(never)]
pub fn queue_report(mode: Mode, machine: &mut impl Machine, out: &mut impl Out) {
    let verbosity = machine.settings().queue_verbosity();
    if verbosity == 0 {
        return;
    }
    let mut format = mode.format(machine);
    let mut writer = Writer::body(out, &mut format);
    writer.begin_object();
    writer.count(text!("qr"), machine.value(Value::QueueFree));
    if verbosity > 1 {
        writer.count(text!("qi"), machine.value(Value::QueueAdded));
        writer.count(text!("qo"), machine.value(Value::QueueRemoved));
    }
    writer.end_object();
}

/// Sends a status report that has only the sync error: how far the axes are ahead of the spindle.
#[small]
#[inline(never)]
pub fn sync_report(mode: Mode, machine: &mut impl Machine, out: &mut impl Out) {
    let mut format = mode.format(machine);
    let mut writer = Writer::body(out, &mut format);
    let token = Token::single(SYNC_ERROR);
    let shown = token.read(machine);
    writer.head(text!("sr"));
    writer.key(token.name().bytes());
    writer.shown(shown);
    writer.tail();
}

/// Sends how much the sender may send again, after a queue flush. Sent at every verbosity.
#[small]
#[inline(never)]
pub fn receive_report(mode: Mode, machine: &mut impl Machine, out: &mut impl Out) {
    let mut format = mode.format(machine);
    let mut writer = Writer::body(out, &mut format);
    writer.begin_object();
    writer.count(text!("rx"), Source::Room.read(machine));
    writer.end_object();
}

#[small]
impl<O: Out> Writer<'_, O> {
    /// Begins a report: with nothing in text mode, with `{"name":{` in JSON.
    fn head(&mut self, name: Text) {
        if !self.is_plain() {
            self.open();
            self.key_text(name);
            self.open();
        }
    }

    fn tail(&mut self) {
        if !self.is_plain() {
            self.close();
        }
        self.end_object();
    }

    fn begin_object(&mut self) {
        if !self.is_plain() {
            self.open();
        }
    }

    fn end_object(&mut self) {
        if !self.is_plain() {
            self.close();
        }
        self.end_line();
    }

    fn count(&mut self, name: Text, value: i32) {
        self.key_text(name);
        self.fixed(Fixed::int(value));
    }
}
