//! The line pool: received lines that wait for the parser.
//!
//! Filled by the reader, emptied by the parser, both in thread mode. Lines lie end to end in one buffer
//! in order of arrival, so that eight short lines of G-code and one long line of JSON fit the same
//! memory. Control lines (JSON, `$`, `?`) are taken before data lines, each kind in order.
//!
//! A line that cannot be kept whole is kept as a fault instead: the sender gets exactly one
//! response for it either way. When the pool is full the reader leaves bytes in the receive ring.

use heapless::Vec;

use super::printing::copy_printing;
use crate::protocol::asks_help;
use crate::status::Status;

/// Line slots. Senders count on eight.
pub const SLOTS: usize = 8;
/// Bytes for all lines together.
pub const POOL: usize = 560;
/// Longest line, in bytes without its end.
pub const LINE_MAX: usize = 254;

/// What to do with a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Class {
    /// Overtakes data.
    Control,
    /// Waits until the planner has room.
    Data,
    /// Could not be kept; answered with this status.
    Fault(Status),
}

#[derive(Clone, Copy)]
struct Entry {
    len: u8,
    class: Class,
}

/// Names a line in the pool until it is removed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LineId(u8);

/// Whether a place in a line is in a comment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Aside {
    /// It is not.
    None,
    /// In parentheses.
    Parentheses,
    /// Behind a semicolon.
    Rest,
}

impl Aside {
    /// The same behind one more byte.
    pub fn after(self, byte: u8) -> Self {
        match (self, byte) {
            (_, b'\n' | b'\r') => Self::None,
            (Self::Rest, _) | (Self::None, b';') => Self::Rest,
            (_, b'(') => Self::Parentheses,
            (_, b')') => Self::None,
            (aside, _) => aside,
        }
    }
}

/// The pool. The buffer is last: what lies before it, AVR reaches in one instruction.
#[repr(C)]
pub struct LinePool {
    /// Complete lines, in order; their bytes lie end to end.
    entries: Vec<Entry, SLOTS>,
    /// How many of them are control lines.
    controls: u8,
    /// Where the oldest line begins.
    start: u16,
    /// Behind the last complete line.
    end: u16,
    /// Bytes of the line that is coming in, from `end` on.
    partial: u8,
    /// Why the line that is coming in cannot be kept.
    fault: Option<Status>,
    /// The last byte was a carriage return: a line feed right behind it ends the same line.
    returned: bool,
    /// Empty lines are kept: in text mode they are answered by a prompt.
    keep_empty: bool,
    bytes: [u8; POOL],
}

impl LinePool {
    /// An empty pool.
    pub const fn new() -> Self {
        Self {
            entries: Vec::new(),
            controls: 0,
            start: 0,
            end: 0,
            partial: 0,
            fault: None,
            returned: false,
            keep_empty: false,
            bytes: [0; POOL],
        }
    }

    /// Whether empty lines are lines, from now on.
    pub fn keep_empty(&mut self, keep: bool) {
        self.keep_empty = keep;
    }

    /// Free slots, not counting the one a line is coming into.
    pub fn free(&self) -> u8 {
        (SLOTS - self.entries.len()) as u8
    }

    /// Whether the next byte can be taken, whatever it is.
    #[inline(never)]
    pub fn ready(&self) -> bool {
        let used = self.end - self.start + u16::from(self.partial);
        self.entries.len() < SLOTS && used < POOL as u16
    }

    /// Takes the printing bytes that `bytes` begins with, as far as they fit and are no matter for
    /// [`LinePool::put`]. Returns how many. Cost: 9 cycles a byte.
    #[inline(never)]
    pub fn put_text(&mut self, bytes: &[u8]) -> u8 {
        if self.fault.is_some() || (self.partial == 0 && bytes.first().is_none_or(|b| is_blank(*b)))
        {
            return 0;
        }
        let room = LINE_MAX - usize::from(self.partial);
        let at = self.room_at();
        let slots = self.bytes.get_mut(at..).unwrap_or(&mut []);
        let slots = slots.get_mut(..room.min(slots.len())).unwrap_or(&mut []);
        let count = copy_printing(bytes, slots);
        self.returned &= count == 0;
        self.partial += count;
        count
    }

    /// Takes a byte. Returns true when it completes a line.
    #[inline(never)]
    pub fn put(&mut self, byte: u8) -> bool {
        let returned = core::mem::replace(&mut self.returned, byte == b'\r');
        if byte == b'\n' && returned {
            return false;
        }
        if byte == b'\n' || byte == b'\r' {
            return self.end_line();
        }
        if self.fault.is_some() || (self.partial == 0 && is_blank(byte)) {
            return false;
        }
        let at = self.room_at();
        match self.bytes.get_mut(at) {
            Some(slot) if usize::from(self.partial) < LINE_MAX => {
                *slot = byte;
                self.partial += 1;
            }
            _ => self.spoil(Status::InputTooLong),
        }
        false
    }

    /// Where the next byte goes. When the lines have reached the end of the buffer they all move to its
    /// beginning, which with short lines happens once in thirty.
    #[inline(always)]
    fn room_at(&mut self) -> usize {
        let at = usize::from(self.end) + usize::from(self.partial);
        if at < POOL || self.start == 0 {
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

    /// Gives up the line that is coming in: it will be answered with `status`.
    pub fn spoil(&mut self, status: Status) {
        self.partial = 0;
        self.fault = Some(status);
    }

    /// Forgets the line that is coming in.
    pub fn forget(&mut self) {
        self.partial = 0;
        self.fault = None;
    }

    /// Whether what comes next is in a comment.
    pub fn aside(&self) -> Aside {
        let text = self.slice(usize::from(self.end), self.partial);
        text.iter().fold(Aside::None, |aside, byte| aside.after(*byte))
    }

    /// Whether a data line waits, or a fault.
    pub fn has_data(&self) -> bool {
        self.entries.len() > usize::from(self.controls)
    }

    /// Drops all data lines: they will be answered with [`Status::Terminated`].
    #[inline(never)]
    pub fn terminate(&mut self) {
        for entry in &mut self.entries {
            if entry.class == Class::Data {
                entry.class = Class::Fault(Status::Terminated);
            }
        }
    }

    /// The same for the line that is coming in.
    #[inline(never)]
    pub fn terminate_partial(&mut self) {
        let text = self.slice(usize::from(self.end), self.partial);
        if !text.is_empty() && classify(text) == Class::Data {
            self.spoil(Status::Terminated);
        }
    }

    /// The next byte follows a carriage return, or does not.
    pub fn follow(&mut self, returned: bool) {
        self.returned = returned;
    }

    /// Takes the end of a line; `returned` if it was a carriage return. Returns true if that was a line.
    pub fn end(&mut self, returned: bool) -> bool {
        self.returned = returned;
        self.end_line()
    }

    fn end_line(&mut self) -> bool {
        let len = self.partial;
        let class = match self.fault.take() {
            Some(status) => Class::Fault(status),
            None if len == 0 && !self.keep_empty => return false,
            None => classify(self.slice(usize::from(self.end), len)),
        };
        self.partial = 0;
        if self.entries.push(Entry { len, class }).is_ok() {
            self.end += u16::from(len);
            self.controls += u8::from(class == Class::Control);
        }
        true
    }

    fn slice(&self, start: usize, len: u8) -> &[u8] {
        self.bytes.get(start..start + usize::from(len)).unwrap_or(&[])
    }

    /// The line to process next; data lines (and faults, which keep their place among them) only if
    /// `data` is wanted.
    pub fn next(&self, data: bool) -> Option<(LineId, Class)> {
        let index = match self.controls {
            0 if !data => return None,
            0 => 0,
            _ => self.entries.iter().position(|e| e.class == Class::Control)?,
        };
        self.entries.get(index).map(|e| (LineId(index as u8), e.class))
    }

    /// The text of the oldest line, if that is next, and data.
    pub fn oldest(&self) -> Option<&[u8]> {
        match self.entries.first() {
            Some(Entry { len, class: Class::Data }) if self.controls == 0 => {
                Some(self.slice(self.start.into(), *len))
            }
            _ => None,
        }
    }

    /// Removes it.
    pub fn remove_oldest(&mut self) {
        self.remove(LineId(0));
    }

    /// The text of a line.
    pub fn text(&self, id: LineId) -> &[u8] {
        let index = usize::from(id.0);
        match self.entries.get(index) {
            Some(entry) => self.slice(self.start_of(index), entry.len),
            None => &[],
        }
    }

    fn start_of(&self, index: usize) -> usize {
        if index == 0 {
            return self.start.into();
        }
        let before = self.entries.iter().take(index);
        before.fold(usize::from(self.start), |at, e| at + usize::from(e.len))
    }

    /// Removes a line. The oldest costs next to nothing, any other about 8 cycles for each byte behind it.
    pub fn remove(&mut self, id: LineId) {
        let index = usize::from(id.0);
        let Some(Entry { len, class }) = self.entries.get(index).copied() else {
            return;
        };
        if index == 0 {
            self.start += u16::from(len);
        } else {
            self.close_gap(self.start_of(index), len);
        }
        self.controls -= u8::from(class == Class::Control);
        self.entries.remove(index);
        if self.entries.is_empty() && self.partial == 0 {
            (self.start, self.end) = (0, 0);
        }
    }

    fn close_gap(&mut self, start: usize, len: u8) {
        let behind = start + usize::from(len);
        let end = usize::from(self.end) + usize::from(self.partial);
        if behind <= end && end <= POOL {
            self.bytes.copy_within(behind..end, start);
        }
        self.end -= u16::from(len);
    }
}

impl Default for LinePool {
    fn default() -> Self {
        Self::new()
    }
}

fn is_blank(byte: u8) -> bool {
    byte == b' ' || byte == b'\t'
}

/// Control lines are those whose first character says so; JSON that wraps G-code is data.
fn classify(line: &[u8]) -> Class {
    match line.first() {
        Some(b'$' | b'?') => Class::Control,
        Some(b'{') if !wraps_gcode(line) => Class::Control,
        Some(b'h' | b'H') if asks_help(line) => Class::Control,
        _ => Class::Data,
    }
}

fn wraps_gcode(line: &[u8]) -> bool {
    let mut name =
        line.iter().skip(1).filter(|b| !is_blank(**b) && **b != b'"').map(u8::to_ascii_lowercase);
    (name.next(), name.next(), name.next()) == (Some(b'g'), Some(b'c'), Some(b':'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn feed(pool: &mut LinePool, text: &[u8]) {
        for &byte in text {
            assert!(pool.ready());
            pool.put(byte);
        }
    }

    fn take(pool: &mut LinePool, data: bool) -> Option<(std::vec::Vec<u8>, Class)> {
        let (id, class) = pool.next(data)?;
        let text = pool.text(id).to_vec();
        pool.remove(id);
        Some((text, class))
    }

    #[test]
    fn control_overtakes_data_and_order_holds_within_each() {
        let mut pool = LinePool::new();
        feed(&mut pool, b"g1x1\r\n  {a:n}\n\ng1x2\n{\"gc\":\"g0\"}\n?\n");
        assert_eq!(pool.free(), 3);
        assert_eq!(take(&mut pool, false), Some((b"{a:n}".to_vec(), Class::Control)));
        assert_eq!(take(&mut pool, true), Some((b"?".to_vec(), Class::Control)));
        assert_eq!(take(&mut pool, false), None);
        for line in [&b"g1x1"[..], b"g1x2", b"{\"gc\":\"g0\"}"] {
            assert_eq!(take(&mut pool, true), Some((line.to_vec(), Class::Data)));
        }
        assert_eq!(pool.free(), 8);
    }

    #[test]
    fn a_line_that_is_coming_in_survives_removals() {
        let mut pool = LinePool::new();
        feed(&mut pool, b"first\nsecond\nthi");
        take(&mut pool, true);
        feed(&mut pool, b"rd\n");
        assert_eq!(take(&mut pool, true).map(|l| l.0), Some(b"second".to_vec()));
        assert_eq!(take(&mut pool, true).map(|l| l.0), Some(b"third".to_vec()));
    }

    #[test]
    fn long_and_damaged_lines_become_one_fault_each() {
        let mut pool = LinePool::new();
        feed(&mut pool, &[b'x'; 300]);
        feed(&mut pool, b"\ngood\nbad");
        pool.spoil(Status::BufferFull);
        feed(&mut pool, b"more\nok\n");
        assert_eq!(take(&mut pool, true).map(|l| l.1), Some(Class::Fault(Status::InputTooLong)));
        assert_eq!(take(&mut pool, true).map(|l| l.0), Some(b"good".to_vec()));
        assert_eq!(take(&mut pool, true).map(|l| l.1), Some(Class::Fault(Status::BufferFull)));
        assert_eq!(take(&mut pool, true).map(|l| l.0), Some(b"ok".to_vec()));
    }

    #[test]
    fn empty_lines_count_where_they_are_wanted() {
        let mut pool = LinePool::new();
        feed(&mut pool, b"\r\n\n");
        assert_eq!(pool.free(), 8);
        pool.keep_empty(true);
        feed(&mut pool, b"?\r\n\r\n\n");
        assert_eq!(pool.free(), 5);
        assert_eq!(take(&mut pool, true), Some((b"?".to_vec(), Class::Control)));
        assert_eq!(take(&mut pool, true), Some((b"".to_vec(), Class::Data)));
    }

    #[test]
    fn text_in_pieces_is_text_byte_by_byte() {
        let (mut pieces, mut bytes) = (LinePool::new(), LinePool::new());
        for round in 0..200 {
            let long = "(".repeat(round * 7 % 300);
            let line = std::format!("  N{round} X1.5\tY2{long}\r\n\n \x01x\ny\r");
            let mut rest = line.as_bytes();
            while !rest.is_empty() {
                assert!(pieces.ready());
                let count = usize::from(pieces.put_text(&rest[..rest.len().min(round % 9 + 1)]));
                rest = &rest[count..];
                if count == 0 {
                    pieces.put(rest[0]);
                    rest = &rest[1..];
                }
            }
            feed(&mut bytes, line.as_bytes());
            for _ in 0..4 {
                assert_eq!(take(&mut pieces, true), take(&mut bytes, true));
            }
        }
    }

    #[test]
    fn dropped_lines_keep_their_place_and_control_lines_are_none_of_them() {
        let mut pool = LinePool::new();
        feed(&mut pool, b"g1x1\n{a:n}\ng1x2\ng1x");
        pool.terminate_partial();
        pool.terminate();
        feed(&mut pool, b"3\ng1x4\n{b:");
        pool.terminate_partial();
        feed(&mut pool, b"n}\n");
        let dropped = Class::Fault(Status::Terminated);
        let classes = [Class::Control, Class::Control, dropped, dropped, dropped, Class::Data];
        for class in classes {
            assert_eq!(take(&mut pool, true).map(|line| line.1), Some(class));
        }
        assert!(!pool.has_data());
        // Between two lines there is none to drop.
        pool.terminate_partial();
        feed(&mut pool, b"\n");
        assert_eq!(pool.free(), 8);
    }

    #[test]
    fn comments_are_known() {
        for (text, aside) in [
            ("g1 (x", Aside::Parentheses),
            ("g1 (x; (", Aside::Parentheses),
            ("g1 (x) y", Aside::None),
            ("g1 ; (x)", Aside::Rest),
            ("(x)\n;y\ng1", Aside::None),
        ] {
            let mut pool = LinePool::new();
            feed(&mut pool, text.as_bytes());
            assert_eq!(pool.aside(), aside, "{text}");
            let ahead = text.bytes().fold(Aside::None, Aside::after);
            assert_eq!(ahead, aside, "{text}");
        }
    }

    #[test]
    fn a_full_pool_is_not_ready() {
        let mut pool = LinePool::new();
        feed(&mut pool, b"1\n2\n3\n4\n5\n6\n7\n8\n");
        assert!(!pool.ready());
        take(&mut pool, true);
        assert!(pool.ready());
    }
}
