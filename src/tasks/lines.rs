//! The line pool: received lines that wait for the parser.
//!
//! There is one pool for each port. The reader fills it and the parser empties it, both in thread mode. Lines lie end
//! to end in one buffer in order of arrival, so that eight short lines of G-code or one long line of JSON fit in the
//! same memory. Control lines (JSON, `$`, `?`) are taken before data lines, each kind in order.
//!
//! Lines that come in order leave a slot and some bytes free, the *reserve*. The reserve is for short control lines
//! that wait behind data in the receive ring ([`overtake`](super::overtake)). No control line begins in order where a
//! short one would not fit whole.
//!
//! A line that cannot be kept whole is kept as a fault, with as much of its text as the answer gives back: the sender
//! gets exactly one response for it either way. Senders may count characters, so every byte that comes is counted with
//! some line: blanks before a line, and bytes between two lines, count with the line that follows. When the pool is
//! full, the reader leaves bytes in the receive ring.

mod entries;

use entries::{Entries, Entry};
use kerf_macros::small;

use crate::gcode::comment::{Aside, is_telling};
use crate::hal::LINES;
use crate::hal::ring::Window;
use crate::hal::serial::TAKEN_RETURN;
use crate::hal::text::copy_printing;
use crate::machine::Alarm;
use crate::machine::alarm::is_program_end;
use crate::protocol::{asks_alarm, ends_alarm, is_control, is_joined, may_be_control};
use crate::realtime::ASCII;
use crate::status::Status;

/// Slots for lines in order; there is one more for control lines that overtake. Senders rely on eight.
pub const SLOTS: usize = LINES;
/// The longest line, in bytes without its end. The limit is lower in a pool with less memory.
pub const LINE_MAX: usize = 254;
/// Asks for a status report. Senders made for other firmwares send it without a line end and then go on with their
/// job.
const ASKS: u8 = b'?';
/// How many bytes are kept of a line that is too long. Where lines are answered in their order, as many are kept of a
/// line that is dropped while it comes in.
const REST_MAX: u8 = 32;

/// What to do with a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Class {
    /// The line overtakes data.
    Control,
    /// The line waits until the planner has room.
    Data,
    /// The line came in an alarm and in time before its end, which came from elsewhere: its G-code is refused.
    Late,
    /// The line could not be kept, and is answered with this status.
    Fault(Status),
    /// The line came before its sender reset the machine. It is never answered.
    Gone,
}

impl Class {
    /// Whether the line is no control line, and has been kept whole.
    #[inline(always)]
    pub fn is_whole(self) -> bool {
        matches!(self, Class::Data | Class::Late)
    }
}

/// Names a line in the pool until it is removed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LineId(u8);

impl LineId {
    /// No line: it has no text, and to remove it does nothing.
    pub const NONE: Self = Self(u8::MAX);
}

/// The byte before the next one, as far as it matters.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Before {
    Other,
    /// A carriage return: a line feed directly after it belongs to that line end.
    Return,
    /// A percent sign that begins a line and flushes nothing. If a name follows, it is kept as part of the line.
    Percent,
}

/// The line pool of a port.
// In this order: AVR reaches a field within 63 bytes of the first in one instruction.
#[repr(C)]
pub struct LinePool {
    bytes: &'static mut [u8],
    /// Where the oldest line begins.
    start: u16,
    /// The end of the last complete line.
    end: u16,
    /// Bytes of the line that is coming in, from `end` on.
    partial: u8,
    /// How many complete lines are control lines.
    controls: u8,
    /// Bytes that have come since the last line and are not kept.
    besides: u16,
    /// Why the line that is coming in cannot be kept.
    fault: Option<Status>,
    /// The last byte.
    before: Before,
    /// Empty lines are kept: in text mode they are answered by a prompt.
    keep_empty: bool,
    /// No line is a control line: all are answered in their order.
    in_order: bool,
    /// A printing host speaks, which has control lines of its own.
    #[cfg(feature = "dialect-reprap")]
    plain: bool,
    /// Longest line.
    longest: u8,
    /// Bytes that are left free for control lines that overtake: the greatest length of such a line.
    reserve: u8,
    /// The most severe alarm of complete lines since the last [`take_stop`](Self::take_stop).
    stop: Alarm,
    /// Complete lines, in order; their bytes lie end to end.
    entries: Entries,
}

impl LinePool {
    /// Returns an empty pool that keeps its lines in `bytes` and leaves `reserve` of them to control lines that
    /// overtake.
    pub const fn new(bytes: &'static mut [u8], reserve: u8) -> Self {
        let room = bytes.len().saturating_sub(reserve as usize);
        Self {
            entries: Entries::new(),
            controls: 0,
            start: 0,
            end: 0,
            partial: 0,
            besides: 0,
            fault: None,
            before: Before::Other,
            keep_empty: false,
            in_order: false,
            #[cfg(feature = "dialect-reprap")]
            plain: false,
            longest: if room > LINE_MAX { LINE_MAX } else { room - 1 } as u8,
            reserve,
            stop: Alarm::None,
            bytes,
        }
    }

    /// Sets whether empty lines count as lines from now on.
    pub fn keep_empty(&mut self, keep: bool) {
        self.keep_empty = keep;
    }

    /// Whether this byte acts where it stands and belongs to no line.
    pub fn leaves(&self, byte: u8) -> bool {
        self.in_order && acts(byte)
    }

    /// Sets whether a printing host speaks from now on.
    pub fn keep_plain(&mut self, keep: bool) {
        #[cfg(feature = "dialect-reprap")]
        {
            self.plain = keep;
        }
        let _ = keep;
    }

    /// Whether a printing host speaks.
    #[inline(always)]
    pub fn is_plain(&self) -> bool {
        #[cfg(feature = "dialect-reprap")]
        return self.plain;
        #[cfg(not(feature = "dialect-reprap"))]
        false
    }

    /// Sets whether all lines are answered in their order from now on. Control lines that already wait become data
    /// lines.
    pub fn keep_order(&mut self, keep: bool) {
        self.in_order = keep;
        if keep && self.controls > 0 {
            self.put_in_order();
        }
    }

    #[cold]
    #[inline(never)]
    #[small]
    fn put_in_order(&mut self) {
        self.controls = 0;
        for index in 0..self.entries.len() {
            if let Some(entry) = self.entries.get_mut(index)
                && entry.class == Class::Control
            {
                entry.class = Class::Data;
            }
        }
    }

    /// Returns the line that has come last.
    pub fn newest(&self) -> &[u8] {
        self.text(LineId((self.entries.len() as u8).wrapping_sub(1)))
    }

    /// Returns the class of a line that has come whole.
    #[inline(never)]
    fn classify(&self, line: &[u8]) -> Class {
        if !self.in_order && is_control(line, self.is_plain()) {
            Class::Control
        } else {
            Class::Data
        }
    }

    /// Gives the line that has come last the class that it has in the dialect which it has selected.
    #[cold]
    #[inline(never)]
    #[small]
    pub fn classify_newest(&mut self) {
        let is_control = self.classify(self.newest()) == Class::Control;
        if let Some(last) = self.entries.len().checked_sub(1)
            && let Some(entry) = self.entries.get_mut(last)
            && is_control
            && entry.class == Class::Data
        {
            entry.class = Class::Control;
            self.controls += 1;
        }
    }

    /// Returns the number of free slots, the slot for the line that is coming in included.
    pub fn free(&self) -> u8 {
        SLOTS.saturating_sub(self.entries.len()) as u8
    }

    /// Whether there is no line, nor any part of one.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty() && self.partial == 0
    }

    /// Whether there is room for the next byte, whatever it is.
    #[inline(never)]
    pub fn ready(&self) -> bool {
        let need = if self.is_within_line() { 1 } else { u16::from(self.reserve) + 1 };
        self.entries.len() < SLOTS && self.room() >= need
    }

    /// Returns how many more bytes lines in order may take.
    #[inline(always)]
    pub fn room(&self) -> u16 {
        let used = self.end - self.start + u16::from(self.partial) + u16::from(self.reserve);
        (self.bytes.len() as u16).saturating_sub(used)
    }

    /// Whether a part of a line has come.
    #[inline(always)]
    pub fn is_within_line(&self) -> bool {
        self.partial > 0 || self.fault.is_some()
    }

    /// Whether the line that is coming in is text that begins with a brace.
    #[inline(never)]
    #[small]
    pub fn is_in_braces(&self) -> bool {
        let text = self.slice(self.end.into(), self.partial);
        text.first() == Some(&b'{') && text.iter().all(|byte| matches!(byte, b' '..=b'~'))
    }

    /// Returns the greatest length of a control line that may overtake, without its end.
    pub fn reserve(&self) -> u8 {
        self.reserve
    }

    /// Whether a control line of `len` bytes may overtake now.
    pub fn has_reserve(&self, len: u8) -> bool {
        let used = self.end - self.start + u16::from(self.partial) + u16::from(len);
        self.entries.len() <= SLOTS && usize::from(used) <= self.bytes.len()
    }

    /// Whether `len` bytes of a ring, from `from` on, are a control line. Copies them behind the line that is coming
    /// in; the caller has made sure that there is [room](Self::has_reserve).
    #[inline(never)]
    #[small]
    pub fn is_control(&mut self, ring: &Window<'_>, from: u8, len: u8) -> bool {
        let mut at = usize::from(self.end) + usize::from(self.partial);
        if at + usize::from(len) > self.bytes.len() {
            at = self.move_down(at);
        }
        self.lay(ring, from, len, at);
        self.classify(self.slice(at, len)) == Class::Control
    }

    /// Puts a control line of a ring before the line that is coming in. Its sender counts `besides` more bytes for it;
    /// `u16::MAX` is one byte less.
    #[inline(never)]
    #[small]
    pub fn put_before(&mut self, ring: &Window<'_>, from: u8, len: u8, besides: u16) {
        let at = usize::from(self.end);
        for n in (at..at + usize::from(self.partial)).rev() {
            if let Some(byte) = self.bytes.get(n).copied()
                && let Some(place) = self.bytes.get_mut(n + usize::from(len))
            {
                *place = byte;
            }
        }
        self.lay(ring, from, len, at);
        if self.entries.push(Entry { len, class: Class::Control, besides }) {
            self.end += u16::from(len);
            self.note_control(at, len);
        }
    }

    /// Returns the most severe alarm of lines since the last call ([`stop`](super::stop)).
    #[inline(always)]
    pub fn take_stop(&mut self) -> Alarm {
        core::mem::replace(&mut self.stop, Alarm::None)
    }

    /// Counts a new control line, and records its alarm, if any.
    #[inline(never)]
    #[small]
    fn note_control(&mut self, start: usize, len: u8) {
        self.controls += 1;
        let asked = asks_alarm(self.slice(start, len), self.is_plain());
        self.stop = self.stop.max(asked.unwrap_or(Alarm::None));
    }

    /// Copies bytes of a ring to the place `at` in the buffer.
    #[inline(never)]
    #[small]
    fn lay(&mut self, ring: &Window<'_>, from: u8, len: u8, at: usize) -> &[u8] {
        let line = self.bytes.get_mut(at..at + usize::from(len)).unwrap_or(&mut []);
        line.iter_mut().zip(from..).for_each(|(place, n)| *place = ring.get(n));
        line
    }

    /// Takes the printing bytes at the beginning of `bytes` into the line that is coming in, as far as there is room.
    /// Stops at a byte that needs [`LinePool::put`]. If the bytes are a whole line, takes the line feed behind them
    /// too. Returns how many bytes were taken, and whether they were a whole line. Cost: 10 cycles a byte, and 150.
    #[inline(never)]
    pub fn put_text(&mut self, bytes: &[u8]) -> (u8, bool) {
        let begins = self.partial == 0;
        let waits = if begins { !self.may_begin(bytes) } else { self.is_asking() };
        if self.fault.is_some() || waits {
            return (0, false);
        }
        let text = if self.in_order { before_realtime(bytes) } else { bytes };
        let most = usize::from(self.room().min((self.longest - self.partial).into()));
        let at = self.room_at();
        let slots = self.bytes.get_mut(at..).unwrap_or(&mut []);
        let slots = slots.get_mut(..most.min(slots.len())).unwrap_or(&mut []);
        let count = copy_printing(text, slots);
        if count > 0 {
            self.before = Before::Other;
        }
        self.partial += count;
        let has_end = begins && count > 0 && bytes.get(usize::from(count)) == Some(&b'\n');
        let ends = has_end && self.entries.len() < SLOTS && self.room() > 0;
        if ends {
            self.keep_whole();
        }
        (count + u8::from(ends), ends)
    }

    /// Whether a line may begin with these bytes now. If not, [`LinePool::put`] takes the first of them, or it waits:
    /// a control line stays in the ring, where it may overtake, until it is sure to fit.
    #[inline(always)]
    fn may_begin(&self, bytes: &[u8]) -> bool {
        match bytes.first() {
            None | Some(b' ' | b'\t' | &ASKS | &TAKEN_RETURN) => false,
            Some(_) if self.before == Before::Percent => false,
            Some(first) => !may_be_control(*first) || self.ready(),
        }
    }

    /// Takes one byte. Returns whether it completes a line.
    #[inline(never)]
    pub fn put(&mut self, byte: u8) -> bool {
        let now = if byte == b'\r' { Before::Return } else { Before::Other };
        let before = core::mem::replace(&mut self.before, now);
        if byte == b'\n' && before == Before::Return {
            self.pass(1);
            return false;
        }
        if byte == b'\n' || byte == b'\r' {
            return self.end_line();
        }
        if self.fault.is_some() || (self.partial == 0 && is_blank(byte)) {
            if before == Before::Percent {
                self.before = before;
            }
            self.pass(1);
            return false;
        }
        if before == Before::Percent && (byte.is_ascii_alphanumeric() || byte == b'_') {
            self.keep_percent();
        }
        let asks = self.end_question(byte);
        self.keep_byte(byte);
        asks
    }

    /// Adds a byte to the line that is coming in.
    #[inline(never)]
    fn keep_byte(&mut self, byte: u8) {
        if self.partial == self.longest {
            self.drop_percent();
        }
        let at = self.room_at();
        match self.bytes.get_mut(at) {
            Some(slot) if self.partial < self.longest => {
                *slot = byte;
                self.partial += 1;
            }
            _ => {
                self.spoil(self.why_too_long());
                self.pass(1);
            }
        }
    }

    /// Takes a percent sign that stands outside comments and flushes nothing. At the beginning of a line it may begin
    /// the name of a program, `%prog1`; anywhere else it belongs to no line. A sender may also have meant a flush, so
    /// what begins with no letter or digit, such as JSON, is a line of its own.
    #[inline(never)]
    #[small]
    pub fn percent(&mut self) {
        match self.slice(self.end.into(), self.partial) {
            _ if self.is_plain() || self.fault.is_some() => {}
            [] => self.before = Before::Percent,
            // A byte order mark.
            [0xEF, 0xBB, 0xBF] => self.keep_percent(),
            _ => {}
        }
    }

    /// Makes room in a line that has its greatest length with the percent sign before it.
    #[cold]
    #[inline(never)]
    #[small]
    fn drop_percent(&mut self) {
        let start = usize::from(self.end);
        let end = start + usize::from(self.partial);
        if self.bytes.get(start) == Some(&b'%') && end <= self.bytes.len() {
            self.bytes.copy_within(start + 1..end, start);
            self.partial -= 1;
            self.pass(1);
        }
    }

    /// Adds a percent sign to the line that is coming in. The sender does not count it with the line.
    #[inline(never)]
    #[small]
    fn keep_percent(&mut self) {
        self.keep_byte(b'%');
        self.besides = self.besides.wrapping_sub(1);
    }

    /// Adds a byte to the comment that is coming in, if the comment tells values. The sender does not count the byte with
    /// the line.
    #[inline(always)]
    pub fn keep_aside(&mut self, byte: u8) {
        let text = self.slice(self.end.into(), self.partial);
        if self.fault.is_none() && is_telling(text) {
            self.keep_byte(byte);
            self.besides = self.besides.wrapping_sub(1);
        }
    }

    /// Ends the line that is coming in if it is a question mark and `next` begins another line. Returns whether it
    /// has.
    #[inline(never)]
    #[small]
    pub fn end_question(&mut self, next: u8) -> bool {
        let ends = self.is_asking() && next > b' ' && next != TAKEN_RETURN;
        if ends {
            // There is no line end that the sender counts.
            self.besides = self.besides.wrapping_sub(1);
            self.end_line();
        }
        ends
    }

    /// Whether the line that is coming in is a question mark. Whatever follows is another line then.
    pub fn is_asking(&self) -> bool {
        self.partial > 0
            && !self.in_order
            && !self.is_plain()
            && self.bytes.get(usize::from(self.end)) == Some(&ASKS)
    }

    /// Counts bytes that are not kept.
    #[inline(never)]
    #[small]
    fn pass(&mut self, count: u8) {
        self.besides = self.besides.wrapping_add(count.into());
    }

    /// Returns where the next byte goes. When the lines have reached the end of the buffer, they all move to its
    /// beginning; with short lines this happens once in thirty.
    #[inline(always)]
    fn room_at(&mut self) -> usize {
        let at = usize::from(self.end) + usize::from(self.partial);
        if at < self.bytes.len() || self.start == 0 {
            return at;
        }
        self.move_down(at)
    }

    #[cold]
    #[inline(never)]
    fn move_down(&mut self, at: usize) -> usize {
        self.bytes.copy_within(usize::from(self.start)..at, 0);
        self.end -= self.start;
        at - usize::from(core::mem::take(&mut self.start))
    }

    /// Returns why the line that is coming in is too long: because of lost line ends, or because it is.
    #[cold]
    #[inline(never)]
    fn why_too_long(&self) -> Status {
        let joined = self.is_plain() && is_joined(self.slice(self.end.into(), self.partial));
        if joined { Status::BufferFull } else { Status::InputTooLong }
    }

    /// Gives up the line that is coming in: it will be answered with `status`.
    pub fn spoil(&mut self, status: Status) {
        // A small pool keeps less, to leave room for control lines.
        let most = REST_MAX.min(self.longest / 4);
        // Where lines are answered in their order, the answer depends on whether the dropped line was a jog or other
        // G-code.
        // What is too long is not dropped without a number, even if it looks like several lines.
        let tells = status == Status::InputTooLong
            || self.partial == self.longest
            || self.in_order && status == Status::Terminated;
        let kept = if tells { self.partial.min(most) } else { 0 };
        self.pass(self.partial - kept);
        self.partial = kept;
        self.fault = Some(status);
    }

    /// Forgets the line that is coming in. Its bytes count with the next one.
    pub fn forget(&mut self) {
        self.pass(self.partial);
        self.partial = 0;
        self.fault = None;
    }

    /// Returns whether the next byte is in a comment.
    pub fn aside(&self) -> Aside {
        let text = self.slice(usize::from(self.end), self.partial);
        text.iter().fold(Aside::NONE, |aside, byte| aside.after(*byte))
    }

    /// Whether a control line waits.
    pub fn has_controls(&self) -> bool {
        self.controls > 0
    }

    /// Whether the line that has come last is a control line.
    pub fn ends_with_control(&self) -> bool {
        self.entries.last().is_some_and(|entry| entry.class == Class::Control)
    }

    /// Whether a data line waits, or a fault.
    pub fn has_data(&self) -> bool {
        self.entries.len() > usize::from(self.controls)
    }

    /// Whether a line waits that is never answered.
    pub fn has_gone(&self) -> bool {
        self.entries.iter().any(|entry| entry.class == Class::Gone)
    }

    /// Drops all lines that are not control lines. They are never answered, because their sender has reset the machine.
    #[cold]
    #[inline(never)]
    #[small]
    pub fn drop_unanswered(&mut self) {
        for index in 0..self.entries.len() {
            if let Some(entry) = self.entries.get_mut(index)
                && entry.class != Class::Control
            {
                entry.class = Class::Gone;
            }
        }
    }

    /// Drops all data lines: they will be answered with `status`.
    pub fn terminate(&mut self, status: Status) {
        self.terminate_from(0, status);
    }

    /// Drops data lines as [`terminate`](Self::terminate) does, but the `first` ones.
    pub fn terminate_from(&mut self, first: u8, status: Status) {
        self.drop_data(first, Class::Fault(status));
    }

    /// Has the G-code of all data lines refused, because of an alarm that is on or has just been ended. Other lines
    /// are carried out, and so is everything from a line on that ends an alarm. Returns whether G-code that comes
    /// behind the last line is refused as well: no line before it ends the alarm.
    pub fn refuse(&mut self) -> bool {
        self.drop_data(0, Class::Late)
    }

    /// Has the line that has come last refused, as [`refuse`](Self::refuse) does, although a line that has overtaken it
    /// ends the alarm. Returns whether the line ends the alarm itself.
    pub fn refuse_newest(&mut self) -> bool {
        let last = (self.entries.len() as u8).wrapping_sub(1);
        self.drop_data(last, Class::Late);
        self.ends_alarm(self.newest())
    }

    /// Gives data lines a class, the `first` ones excepted. Returns whether it came as far as the last line.
    #[cold]
    #[inline(never)]
    #[small]
    fn drop_data(&mut self, first: u8, class: Class) -> bool {
        for index in first..self.entries.len() as u8 {
            let id = LineId(index);
            let before = self.class(id);
            if !before.is_whole() && before != Class::Control {
                continue;
            }
            if class == Class::Late && self.ends_alarm(self.text(id)) {
                return usize::from(index) + 1 == self.entries.len();
            }
            if let Some(entry) = self.entries.get_mut(index.into())
                && before != Class::Control
            {
                entry.class = class;
            }
        }
        true
    }

    /// Whether a line ends an alarm: a program end alone, in a pool that keeps the order `$X` and `$H`, and in others
    /// what their dialect has for it.
    fn ends_alarm(&self, text: &[u8]) -> bool {
        if !self.in_order {
            return is_program_end(text) || ends_alarm(text, self.is_plain());
        }
        let mut text = text.iter().filter(|byte| **byte != b' ').map(|byte| byte | b' ');
        let first = [text.next(), text.next(), text.next(), text.next()];
        match first {
            [Some(b'$'), Some(b'x'), None, _] => true,
            [Some(b'$'), Some(b'h'), axis, None] => {
                axis.is_none_or(|axis| matches!(axis, b'a'..=b'c' | b'x'..=b'z'))
            }
            _ => false,
        }
    }

    /// Returns the class of a line as it is now: the line may have been dropped since it was taken.
    pub fn class(&self, id: LineId) -> Class {
        self.entries.get(usize::from(id.0)).map_or(Class::Data, |entry| entry.class)
    }

    /// Drops the line that is coming in, if it is a data line so far.
    #[inline(never)]
    pub fn terminate_partial(&mut self, status: Status) {
        if self.before == Before::Percent {
            self.before = Before::Other;
        }
        let text = self.slice(usize::from(self.end), self.partial);
        if !text.is_empty() && self.classify(text) == Class::Data {
            self.spoil(status);
        }
    }

    /// Sets whether the next byte follows a carriage return.
    pub fn follow(&mut self, returned: bool) {
        self.before = if returned { Before::Return } else { Before::Other };
    }

    /// Takes the end of a line; `returned` if it was a carriage return. Returns whether a line has been completed.
    pub fn end(&mut self, returned: bool) -> bool {
        self.follow(returned);
        self.end_line()
    }

    #[inline(never)]
    fn end_line(&mut self) -> bool {
        match self.fault.take() {
            Some(status) => self.keep(Class::Fault(status)),
            None if self.partial == 0 && !self.keep_empty => {
                self.pass(1);
                return false;
            }
            None => self.keep_whole(),
        }
        true
    }

    /// Adds the line that was coming in, which has no fault.
    #[inline(never)]
    fn keep_whole(&mut self) {
        self.keep(self.classify(self.slice(self.end.into(), self.partial)));
    }

    /// Adds the line that was coming in, as one of `class`.
    #[inline(always)]
    fn keep(&mut self, class: Class) {
        let len = core::mem::take(&mut self.partial);
        let besides = core::mem::take(&mut self.besides);
        if self.entries.push(Entry { len, class, besides }) {
            let start = usize::from(self.end);
            self.end += u16::from(len);
            if class == Class::Control {
                self.note_control(start, len);
            }
        }
    }

    fn slice(&self, start: usize, len: u8) -> &[u8] {
        self.bytes.get(start..start + usize::from(len)).unwrap_or(&[])
    }

    /// Returns the line to process next. Data lines, and faults, which keep their place among them, are returned only
    /// if `data` is wanted. Where lines keep their order, a line that asks or sets something is returned in any case, and
    /// so is a line that is never answered.
    pub fn next(&self, data: bool) -> Option<(LineId, Class)> {
        let index = match self.controls {
            0 if !data && !self.is_command() => return None,
            0 => 0,
            _ => self.entries.iter().position(|e| e.class == Class::Control)?,
        };
        self.entries.get(index).map(|e| (LineId(index as u8), e.class))
    }

    /// Whether lines keep their order, and the oldest begins with a dollar sign and is no jog, or is never answered.
    /// Such a line waits for no motion.
    fn is_command(&self) -> bool {
        if !self.in_order {
            return false;
        }
        if self.entries.first().is_some_and(|first| first.class == Class::Gone) {
            return true;
        }
        let mut text = self.text(LineId(0)).iter().filter(|byte| **byte != b' ');
        text.next() == Some(&b'$')
            && !matches!(text.next(), Some(b'J' | b'j'))
            && self.entries.first().is_some_and(|first| first.class.is_whole())
    }

    /// Returns the text of the oldest line, if it is next and a data line.
    pub fn oldest(&self) -> Option<&[u8]> {
        match self.entries.first() {
            Some(Entry { len, class: Class::Data, .. }) if self.controls == 0 => {
                Some(self.slice(self.start.into(), *len))
            }
            _ => None,
        }
    }

    /// Removes the oldest line.
    #[inline(never)]
    pub fn remove_oldest(&mut self) {
        let Some(oldest) = self.entries.pop_first() else { return };
        self.start += u16::from(oldest.len);
        self.controls -= u8::from(oldest.class == Class::Control);
        self.rewind();
    }

    /// If there is no line, has the next one begin at the start of the buffer.
    #[inline(always)]
    fn rewind(&mut self) {
        if self.entries.is_empty() && self.partial == 0 {
            (self.start, self.end) = (0, 0);
        }
    }

    /// Returns the text of a line.
    pub fn text(&self, id: LineId) -> &[u8] {
        let index = usize::from(id.0);
        match self.entries.get(index) {
            Some(entry) => self.slice(self.start_of(index), entry.len),
            None => &[],
        }
    }

    /// Returns how many bytes the sender counts for a line, with its end.
    pub fn length(&self, id: LineId) -> u16 {
        let length = |entry: &Entry| entry.besides.wrapping_add(u16::from(entry.len) + 1);
        self.entries.get(usize::from(id.0)).map_or(0, length)
    }

    /// Returns how many bytes the sender counts for the oldest line, with its end.
    pub fn oldest_length(&self) -> u16 {
        self.length(LineId(0))
    }

    fn start_of(&self, index: usize) -> usize {
        if index == 0 {
            return self.start.into();
        }
        let before = self.entries.iter().take(index);
        before.fold(usize::from(self.start), |at, e| at + usize::from(e.len))
    }

    /// Removes a line. Any line but the oldest costs about 8 cycles for each byte behind it.
    #[inline(never)]
    pub fn remove(&mut self, id: LineId) {
        let index = usize::from(id.0);
        if index == 0 {
            return self.remove_oldest();
        }
        let Some(Entry { len, class, .. }) = self.entries.get(index).copied() else {
            return;
        };
        self.close_gap(self.start_of(index), len);
        self.controls -= u8::from(class == Class::Control);
        self.entries.remove(index);
    }

    fn close_gap(&mut self, start: usize, len: u8) {
        let behind = start + usize::from(len);
        let end = usize::from(self.end) + usize::from(self.partial);
        if behind <= end && end <= self.bytes.len() {
            self.bytes.copy_within(behind..end, start);
        }
        self.end -= u16::from(len);
    }
}

/// Whether a byte acts where it stands, if all lines are answered in their order ([`realtime`](super::realtime)).
pub fn acts(byte: u8) -> bool {
    byte == ASKS || byte > ASCII
}

/// Returns the bytes before the first one that acts.
#[inline(never)]
#[small]
fn before_realtime(bytes: &[u8]) -> &[u8] {
    let end = bytes.iter().position(|byte| acts(*byte)).unwrap_or(bytes.len());
    bytes.get(..end).unwrap_or(bytes)
}

/// Whether a byte is a blank.
pub fn is_blank(byte: u8) -> bool {
    byte == b' ' || byte == b'\t'
}

#[cfg(test)]
mod tests;
