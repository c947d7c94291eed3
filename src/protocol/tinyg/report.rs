//! What the machine tells unasked: status reports and queue reports.
//!
//! [`StatusReport`] is the list of what to tell and what was told last; [`Report`] sends one report
//! in steps, [`queue_report`] one queue report at once. The reporting task holds the transmitter
//! from the first step of a report to its last; [`Machine::moment`] makes it tell of one moment.

use super::Format;
use super::Mode;
use super::token::{DEFAULT_TOKENS, Shown, Token};
use super::value::{SYNC_ERROR, Source};
use super::write::Writer;
use crate::config::Fixed;
use crate::progmem::Text;
use crate::protocol::{Machine, Out, Remembers, Value};
use crate::text;

/// Entries a report may have.
pub const LONGEST_REPORT: usize = 36;

/// Bytes of a bit for each entry.
const HIGH: usize = LONGEST_REPORT.div_ceil(8);

/// The status report: its tokens, in order, and the value of each as last sent.
pub struct StatusReport {
    /// The lower eight bits of their numbers, and the ninth.
    low: [u8; LONGEST_REPORT],
    high: [u8; HIGH],
    /// The low 24 bits of each value, which saves 38 bytes: a change would have to be a multiple of 16,777,216, for
    /// positions 1.6777216 m between two reports, to pass unseen.
    sent: [[u8; 3]; LONGEST_REPORT],
    len: u8,
    /// The list is new: what was sent means nothing.
    fresh: bool,
}

#[small]
impl StatusReport {
    /// Entry `index`.
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

    /// Enters a token. Whether there is room.
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

    /// Adds a token that is not [far](Token::is_far) behind the others, once. Whether there was room.
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

    /// Takes a token off the list.
    pub fn remove(&mut self, token: Token) {
        let Some(found) = (0..self.len).find(|&index| self.at(index) == token) else { return };
        for index in found + 1..self.len {
            self.put(index - 1, self.at(index));
        }
        self.len -= 1;
        self.fresh = true;
    }

    /// Notes that `value` is being sent for an entry. Whether it differs from the last.
    fn note(&mut self, index: u8, value: i32) -> bool {
        let [a, b, c, _] = value.to_le_bytes();
        match self.sent.get_mut(usize::from(index)) {
            Some(sent) => core::mem::replace(sent, [a, b, c]) != [a, b, c],
            None => false,
        }
    }
}

/// With the defaults of settings it is the default list.
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

/// A status report on its way.
pub struct Report {
    index: u8,
    all: bool,
    /// The next entry is the first of a line: it is told of now.
    first: bool,
    /// Something has been put of the line.
    begun: bool,
    format: Format,
}

#[small]
impl Report {
    /// Begins an automatic report, if the settings want any: of what has changed, or everything.
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

    /// Looks at one entry. Whether there is more to do. If nothing has changed, nothing is sent.
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

    /// Ends the line here, so that an answer can be sent: what is left follows in a line of its own, which tells of its own moment.
    /// False if a line can't end here: in text a report is as many lines as it has entries.
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

/// Sends a queue report if the settings want any: free blocks, and with more verbosity those added
/// and removed since the last.
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

/// Sends how far the axes are ahead of the spindle: a status report of that alone.
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

/// Sends what is free for lines, after a queue flush, whatever the verbosity.
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
    /// Begins a report: nothing in text, else `{"name":{`.
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
