//! The frame of a line, as in `N12 G1 X10*34`: its number, its checksum, and the block between them.
//!
//! The checksum is the exclusive or of all bytes before the asterisk. It is checked in a line that begins with N, and
//! in every line of a port that has received numbers and checksums. In other lines an asterisk is plain text. A port
//! that has received numbers and checksums treats a line with only one of the two as damaged, because a transmission
//! error may have changed the other. A line is also damaged if its number cannot be read, or if it has a byte 0,
//! which does not change the checksum. A second asterisk in a numbered line may be a lost line end: the checksums of several
//! lines may match together. In texts and comments it is one if a line number is behind it. Such a line is asked for
//! again, but not for ever, because a text may look like that: after [`DOUBTS`] times it is taken as it is.
//!
//! In a file on the SD card numbers are ignored, and only a checksum of a line with a number is checked.

use super::command::{self, Bytes, split_digits};
use crate::gcode::comment::skip_mark;
use crate::protocol::{Span, is_joined};

/// What a port keeps about its sender.
#[derive(Clone, Copy, Default)]
pub struct Session {
    /// The number of the last line in order.
    pub last: i32,
    /// Lines that have overtaken those before them, and do not come again: bit n is line `last` + 1 + n.
    ahead: u16,
    /// Whether a line with a number and a right checksum has been received.
    pub sums: bool,
    /// The number of lines begun, modulo 256.
    pub lines: u8,
    /// How many times in a row the next line was asked for again, because it may be several lines.
    doubts: u8,
    /// Whether it was too long. Two kinds of doubts about a line are not added up: one of them may be a lost line end.
    cut: bool,
    /// Whether the lines are those of a file on the SD card.
    pub in_file: bool,
}

/// How many times a line is asked for again that has the right checksum, but looks like several lines.
const DOUBTS: u8 = 4;

/// A tenth of the highest line number.
const MOST: i32 = 99_999_999;

/// The state of a line's checksum.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Sum {
    /// There is no checksum.
    None,
    /// The checksum matches.
    Right,
    /// The checksum matches, but the line may be several lines without their ends.
    Doubtful,
    /// The line is too long, so that its checksum has not been kept, and may be several lines.
    Cut,
    /// The checksum does not match.
    Wrong,
}

impl Sum {
    /// Compares the checksum of a text with the stated one, which begins with an asterisk.
    fn of(text: &[u8], stated: &[u8]) -> Self {
        let (mut sum, mut has_zero) = (0, false);
        for byte in text {
            sum ^= byte;
            has_zero |= *byte == 0;
        }
        let stated = stated.get(1..).and_then(|digits| integer(digits.trim_ascii()));
        if stated == Some(sum.into()) && !has_zero { Self::Right } else { Self::Wrong }
    }
}

/// The parts of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Frame {
    /// The number behind N; `None` if there is none or it cannot be read.
    pub number: Option<i32>,
    /// Whether the line begins with N, even if the number cannot be read.
    pub numbered: bool,
    /// The state of the checksum.
    pub sum: Sum,
    /// The block between number and checksum, without blanks at its ends.
    pub block: Span,
}

/// Why a line has to be sent again.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fault {
    /// The checksum does not match.
    Sum,
    /// The checksum is missing, while other lines have one.
    NoSum,
    /// The number is not the expected one.
    Number,
}

impl Frame {
    /// Splits a line into its parts. Cost on AVR: 12 cycles a byte and 500.
    #[inline(never)]
    #[small]
    pub fn of(line: &[u8]) -> Self {
        let star = asterisk(line);
        let (text, stated) =
            line.split_at_checked(star.unwrap_or(line.len())).unwrap_or((line, &[]));
        let mut sum = if star.is_some() { Sum::of(text, stated) } else { Sum::None };
        let mut rest = text.trim_ascii();
        let mut number = None;
        let numbered = matches!(rest.first(), Some(b'N' | b'n'));
        if numbered {
            let signed = rest.get(1..).unwrap_or(&[]).trim_ascii();
            let unsigned = signed.strip_prefix(b"-");
            let (digits, behind) = split_digits(unsigned.unwrap_or(signed));
            // A number with a fraction, or with a sign inside, is not a line number.
            if !matches!(behind.first(), Some(b'.' | b'-')) {
                number =
                    integer(digits).map(|number| if unsigned.is_some() { -number } else { number });
            }
            if number.is_some() {
                rest = behind;
            }
        }
        // A mark at the beginning of the file: some hosts number its first line like any other.
        let rest = skip_mark(rest.trim_ascii()).trim_ascii();
        let mut words = Bytes::of(if command::is_text(rest) { &[] } else { rest });
        if sum == Sum::Right && numbered && (words.any(|byte| byte == b'*') || is_joined(text)) {
            sum = Sum::Doubtful;
        }
        let start = rest.as_ptr().addr().wrapping_sub(line.as_ptr().addr());
        let end = start.wrapping_add(rest.len());
        Self { number, numbered, sum, block: Span { start: start as u8, end: end as u8 } }
    }

    /// Returns the text between number and checksum. If the asterisk is plain text: everything behind the number.
    #[small]
    pub fn text(&self, line: &[u8]) -> Span {
        let Span { start, end } = self.block;
        let end = if self.sum == Sum::Wrong { line.trim_ascii_end().len() as u8 } else { end };
        Span { start, end }
    }
}

/// Returns where the checksum begins: at the last asterisk, if only digits follow it. In a line that begins with N
/// other bytes may follow it, because the checksum may be damaged.
fn asterisk(line: &[u8]) -> Option<usize> {
    let at = line.iter().rposition(|byte| *byte == b'*')?;
    let (digits, behind) = split_digits(line.get(at + 1..).unwrap_or(&[]));
    let numbered = matches!(line.trim_ascii().first(), Some(b'N' | b'n'));
    let ends = !digits.is_empty() && behind.is_empty();
    (ends || numbered).then_some(at)
}

/// Parses digits; `None` for other text or a number that is too large.
#[inline(never)]
#[small]
pub fn integer(digits: &[u8]) -> Option<i32> {
    let mut value = 0i32;
    for byte in digits {
        let digit = byte.wrapping_sub(b'0');
        if digit > 9 || value > MOST {
            return None;
        }
        value = value * 10 + i32::from(digit);
    }
    (!digits.is_empty()).then_some(value)
}

#[small]
impl Session {
    /// Returns the session of a line of a file on the SD card.
    pub fn in_file() -> Self {
        Self { in_file: true, ..Self::default() }
    }

    /// Takes a line, or returns why it has to be sent again. `sets`: the number to continue from, by M110.
    /// `overtakes`: whether the line has come before lines that wait.
    #[inline(never)]
    pub fn take(&mut self, frame: &Frame, sets: Option<i32>, overtakes: bool) -> Result<(), Fault> {
        self.lines = self.lines.wrapping_add(1);
        if self.in_file {
            let wrong = frame.numbered && frame.sum == Sum::Wrong;
            return if wrong { Err(Fault::Sum) } else { Ok(()) };
        }
        let counts = frame.numbered || self.sums;
        if counts && self.is_damaged(frame) {
            return Err(Fault::Sum);
        }
        if frame.number.is_some() && frame.sum == Sum::None && self.sums {
            return Err(Fault::NoSum);
        }
        if let Some(set) = sets {
            (self.last, self.ahead, self.doubts) = (set, 0, 0);
        } else if let Some(number) = frame.number {
            self.count(number, overtakes)?;
        } else if frame.numbered || (counts && frame.sum != Sum::None) {
            return Err(Fault::Number);
        }
        self.sums |= frame.number.is_some() && frame.sum != Sum::None;
        Ok(())
    }

    /// Whether the checksum says that a line is damaged. Doubts about the next line are counted.
    fn is_damaged(&mut self, frame: &Frame) -> bool {
        if !matches!(frame.sum, Sum::Doubtful | Sum::Cut) {
            return frame.sum == Sum::Wrong;
        }
        let cut = frame.sum == Sum::Cut;
        if frame.number != Some(self.last.wrapping_add(1)) {
            return true;
        }
        if self.cut != cut {
            (self.cut, self.doubts) = (cut, 0);
        }
        let is_damaged = self.doubts < DOUBTS;
        self.doubts += u8::from(is_damaged);
        is_damaged
    }

    /// Counts the number of a line. A line that `overtakes` may have a later number than the next one.
    fn count(&mut self, number: i32, overtakes: bool) -> Result<(), Fault> {
        let bit = match number.wrapping_sub(self.last) {
            1 => 1,
            by @ 2..=16 if overtakes => 1 << (by - 1),
            _ => 0,
        };
        if bit == 0 || self.ahead & bit != 0 {
            return Err(Fault::Number);
        }
        self.ahead |= bit;
        self.doubts = 0;
        while self.ahead & 1 != 0 {
            self.last = self.last.wrapping_add(1);
            self.ahead >>= 1;
        }
        Ok(())
    }
}

/// Takes a line in a usual form: one that does not begin with a capital N, or one with the next number and the right
/// checksum. `None`, without any change, for all other lines. Blanks are left in the block. Does what [`Frame::of`]
/// and [`Session::take`] do, in a fifth of the time. Cost on AVR: 12 cycles a byte and 150.
#[inline(never)]
pub fn fast_path(line: &[u8], session: &mut Session) -> Option<Span> {
    let mut end = line.len();
    let Some((b'N', numbered)) = line.split_first() else {
        session.lines = session.lines.wrapping_add(1);
        return Some(Span { start: 0, end: end as u8 });
    };
    let (mut sum, mut behind) = (b'N', numbered);
    let stated = loop {
        let (byte, rest) = behind.split_first()?;
        match *byte {
            b'*' => break rest,
            0 => return None,
            byte => sum ^= byte,
        }
        behind = rest;
    };
    end -= stated.len() + 1;
    // In 16 bits, because on AVR a checked 8-bit product does not detect its overflow.
    let mut says = 0u16;
    for byte in stated {
        let digit = byte.wrapping_sub(b'0');
        if digit > 9 || says > u16::from(u8::MAX) {
            return None;
        }
        says = says * 10 + u16::from(digit);
    }
    // A long number may wrap. The check of `start` below rejects numbers of more than seven digits.
    let (mut number, mut start) = (0u32, 1u8);
    let mut digits = numbered;
    while let Some((byte, rest)) = digits.split_first() {
        let digit = byte.wrapping_sub(b'0');
        if digit > 9 {
            break;
        }
        number = number.wrapping_mul(10).wrapping_add(digit.into());
        (digits, start) = (rest, start.wrapping_add(1));
    }
    let ends = matches!(digits.first(), Some(b' ' | b'G'));
    let is_next = (2..=8).contains(&start) && number as i32 == session.last.wrapping_add(1);
    if stated.is_empty() || says != u16::from(sum) || !ends || !is_next || session.ahead != 0 {
        return None;
    }
    (session.last, session.doubts) = (number as i32, 0);
    session.sums = true;
    session.lines = session.lines.wrapping_add(1);
    Some(Span { start, end: end as u8 })
}

/// Whether a line is valid in this dialect alone: one with a number and a checksum, or M105, M110, M115.
#[inline(never)]
#[small]
pub fn is_own(line: &[u8]) -> bool {
    let frame = Frame::of(line);
    if !matches!(frame.sum, Sum::None | Sum::Right) {
        return false;
    }
    (frame.number.is_some() && frame.sum == Sum::Right)
        || matches!(super::command::code(frame.block.of(line)), Some((b'M', 105 | 110 | 115)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(line: &str) -> (Option<i32>, Sum, &str) {
        let frame = Frame::of(line.as_bytes());
        let block = std::str::from_utf8(frame.block.of(line.as_bytes())).unwrap();
        (frame.number, frame.sum, block)
    }

    #[test]
    fn numbers_and_checksums() {
        assert_eq!(parts("N-1 M110 N-1*125"), (Some(-1), Sum::Right, "M110 N-1"));
        assert_eq!(parts("N0 M110 N0*125"), (Some(0), Sum::Right, "M110 N0"));
        assert_eq!(parts("N -7 G1\t"), (Some(-7), Sum::None, "G1"));
        assert_eq!(parts("N--7 G1"), (None, Sum::None, "N--7 G1"));
        assert_eq!(parts("N5-3 G1"), (None, Sum::None, "N5-3 G1"));
        assert_eq!(parts(" n2G28 *18 "), (Some(2), Sum::Wrong, "G28"));
        assert_eq!(parts("N2 G28*17"), (Some(2), Sum::Right, "G28"));
        assert_eq!(parts("N2 G28*1j"), (Some(2), Sum::Wrong, "G28"));
        assert_eq!(parts("M117 5*x"), (None, Sum::None, "M117 5*x"));
        assert_eq!(parts("  "), (None, Sum::None, ""));
        assert_eq!(parts("\u{FEFF}G28 X"), (None, Sum::None, "G28 X"));
        assert_eq!(parts("N2 \u{FEFF}; made by*154"), (Some(2), Sum::Right, "; made by"));
        assert_eq!(parts("N M105"), (None, Sum::None, "N M105"));
        assert_eq!(parts("N1.5 M105"), (None, Sum::None, "N1.5 M105"));
        assert_eq!(parts("N2 G28\0*17").1, Sum::Wrong);
        // Three lines without their ends have the checksum of one.
        assert_eq!(parts("N2 G28*17N2 G28*17N2 G28*17").1, Sum::Doubtful);
        assert_eq!(parts("N2 G28*17N2 G28*17N2 G28*18").1, Sum::Wrong);
        assert_eq!(parts("N2 G28 (2*3) ;2*3*43"), (Some(2), Sum::Right, "G28 (2*3) ;2*3"));
        // By chance the second line with its checksum does not change that of the first.
        for joined in ["N2 G28 ;*43N3 G1*12", "N2 M117 *43?N3 G1*63"] {
            assert_eq!(parts(joined).1, Sum::Doubtful);
        }
        assert_eq!(parts("N2 M117 2*3*45"), (Some(2), Sum::Right, "M117 2*3"));
    }

    #[test]
    fn lines_are_taken_once() {
        let mut session = Session::default();
        let frame = |number, sum| Frame {
            number: Some(number),
            numbered: true,
            sum,
            block: Span::default(),
        };
        assert_eq!(session.take(&frame(-1, Sum::Right), Some(-1), false), Ok(()));
        assert_eq!(session.take(&frame(0, Sum::Right), None, false), Ok(()));
        assert_eq!(session.take(&frame(0, Sum::Right), None, false), Err(Fault::Number));
        assert_eq!(session.take(&frame(2, Sum::Right), None, false), Err(Fault::Number));
        assert_eq!(session.take(&frame(1, Sum::None), None, false), Err(Fault::NoSum));
        assert_eq!(session.take(&frame(1, Sum::Wrong), None, false), Err(Fault::Sum));
        assert_eq!(session.take(&frame(3, Sum::Right), None, true), Ok(()));
        assert_eq!(session.take(&frame(1, Sum::Right), None, false), Ok(()));
        assert_eq!(session.take(&frame(2, Sum::Right), None, false), Ok(()));
        assert_eq!(session.take(&frame(3, Sum::Right), None, false), Err(Fault::Number));
        assert_eq!(session.take(&frame(4, Sum::Right), None, false), Ok(()));
    }

    #[test]
    fn doubts_end() {
        let mut session = Session::default();
        let of = |number, sum| Frame {
            number: Some(number),
            numbered: true,
            sum,
            block: Span::default(),
        };
        let doubtful = |number| of(number, Sum::Doubtful);
        for _ in 0..2 {
            for _ in 0..DOUBTS {
                let next = session.last + 1;
                assert_eq!(session.take(&doubtful(next + 1), None, false), Err(Fault::Sum));
                assert_eq!(session.take(&doubtful(next), None, false), Err(Fault::Sum));
            }
            let next = session.last + 1;
            assert_eq!(session.take(&doubtful(next + 1), None, false), Err(Fault::Sum));
            let mut cut = session;
            assert_eq!(session.take(&doubtful(next), None, false), Ok(()));
            assert_eq!(session.last, next);
            // Lost line ends may make a line too long that was doubted before.
            for _ in 0..DOUBTS {
                assert_eq!(cut.take(&of(next, Sum::Cut), None, false), Err(Fault::Sum));
            }
            assert_eq!(cut.take(&of(next, Sum::Cut), None, false), Ok(()));
        }
    }

    #[test]
    fn lines_that_overtake_are_taken_once() {
        let mut session = Session { last: 5, ..Session::default() };
        let mut take = |number, sets, overtakes| {
            let frame = Frame { number, numbered: true, sum: Sum::Right, block: Span::default() };
            session.take(&frame, sets, overtakes)
        };
        for overtaking in [7, 9, 8, 21] {
            assert_eq!(take(Some(overtaking), None, true), Ok(()), "{overtaking}");
        }
        for refused in [7, 9, 5, 22] {
            assert_eq!(take(Some(refused), None, true), Err(Fault::Number), "{refused}");
        }
        assert_eq!(take(Some(6), None, false), Ok(()));
        for again in 7..=9 {
            assert_eq!(take(Some(again), None, false), Err(Fault::Number), "{again}");
        }
        assert_eq!(take(Some(10), None, false), Ok(()));
        assert_eq!(take(Some(12), None, true), Ok(()));
        // M110, with a line number or without, begins anew.
        for number in [Some(20), None] {
            assert_eq!(take(number, Some(10), false), Ok(()));
            for next in 11..=13 {
                assert_eq!(take(Some(next), None, false), Ok(()), "{next}");
            }
            assert_eq!(take(Some(15), None, true), Ok(()));
        }
    }

    #[test]
    fn usual_lines_are_taken_as_others_are() {
        let with_sum = |text: &str| {
            let sum = text.bytes().fold(0, |sum, byte| sum ^ byte);
            std::format!("{text}*{sum}")
        };
        let mut lines: std::vec::Vec<_> = [
            "N7 G1 X1",
            "N7G1 X1",
            "N6 G1 X1",
            "N8 G1",
            "N G1",
            "N-7 G1",
            "N7.5 G1",
            "N0000000007 G1",
            "N07 G1 X2",
        ]
        .map(with_sum)
        .into();
        let others = [
            "G1 X1",
            "N7 G1 X1",
            "N7 G1 X1*",
            "N7 G1*1 ",
            "N7 G1*300",
            "N7 G1 X1*358",
            "N7*",
            "N",
            "",
        ];
        lines.extend(others.map(std::string::String::from));
        for (ahead, sums) in [(0, false), (0, true), (4, true)] {
            let before = Session { last: 6, ahead, sums, lines: 255, ..Session::default() };
            let mut usual_ones = 0;
            for line in &lines {
                let (mut fast, mut slow) = (before, before);
                let Some(block) = super::fast_path(line.as_bytes(), &mut fast) else {
                    assert_eq!(fast.lines, 255);
                    continue;
                };
                usual_ones += 1;
                let frame = Frame::of(line.as_bytes());
                assert_eq!(slow.take(&frame, None, false), Ok(()), "{line}");
                let of =
                    |session: Session| (session.last, session.ahead, session.sums, session.lines);
                assert_eq!(of(fast), of(slow), "{line}");
                assert_eq!(block.of(line.as_bytes()).trim_ascii(), frame.block.of(line.as_bytes()));
            }
            // Two lines without a number, and if no line has overtaken also three with a number.
            assert_eq!(usual_ones, if ahead == 0 { 5 } else { 2 });
        }
    }

    #[test]
    fn what_only_hosts_say() {
        for own in ["M105", "m110 N0", "N0 M110 N0*125", "M115", "N2 G28*17"] {
            assert!(is_own(own.as_bytes()), "{own}");
        }
        for other in ["", "G1 X1", "N5 G1 X1", "{sr:n}", "$$", "N2 G28*18", "M1050", "M3"] {
            assert!(!is_own(other.as_bytes()), "{other}");
        }
    }
}
