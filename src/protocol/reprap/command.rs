//! Recognizes the code of a line, and finds its words.

use super::frame::{Frame, Sum, integer};
use crate::capability::Capability;
use crate::card;
use crate::config::Number;
use crate::gcode::comment::Aside;
use crate::machine::{self, Cycle};

/// Returns the code of a block, with its letter in upper case: the first word, if that is G, M or T with a whole
/// number; `$` with 0 for a line about a setting by its name. `None` otherwise.
#[inline(never)]
#[small]
pub fn code(block: &[u8]) -> Option<(u8, u16)> {
    let (letter, rest) = block.split_first()?;
    let letter = letter.to_ascii_uppercase();
    if letter == b'$' {
        return Some((letter, 0));
    }
    if !matches!(letter, b'G' | b'M' | b'T') {
        return None;
    }
    let (digits, rest) = split_digits(rest);
    if rest.first() == Some(&b'.') {
        return None;
    }
    let number = integer(digits)?;
    Some((letter, u16::try_from(number).ok()?))
}

/// Returns the M code of a line; `None` if the line has another code or a wrong checksum.
fn whole(frame: &Frame, line: &[u8]) -> Option<u16> {
    match code(frame.block.of(line)) {
        Some((b'M', number)) if matches!(frame.sum, Sum::None | Sum::Right) => Some(number),
        _ => None,
    }
}

/// Whether the line is M112.
#[small]
pub fn is_stop(frame: &Frame, line: &[u8]) -> bool {
    whole(frame, line) == Some(112)
}

/// Whether the line is M999.
#[small]
pub fn is_clear(frame: &Frame, line: &[u8]) -> bool {
    whole(frame, line) == Some(999)
}

/// Whether a line overtakes the lines that wait: now, because M24 does so at a program stop only, and M25 while a file
/// of the SD card prints.
#[inline(never)]
#[small]
pub fn overtakes(frame: &Frame, line: &[u8]) -> bool {
    match whole(frame, line) {
        Some(108 | 112) => true,
        Some(24) => machine::cycle() == Cycle::Stopped,
        Some(25) => card::prints(),
        Some(105 | 114) => frame.number.is_none(),
        _ => false,
    }
}

/// Whether a code is answered only when it is done, because hosts take its `ok` for the end of the wait.
#[inline(never)]
#[small]
pub fn waits(code: Option<(u8, u16)>) -> bool {
    matches!(code, Some((b'G', 4) | (b'M', 0 | 1 | 109 | 116 | 190 | 226 | 600 | 601)))
}

/// Whether the words of a block are a text for people.
pub fn is_text(block: &[u8]) -> bool {
    matches!(code(block), Some((b'M', 117 | 118)))
}

/// Whether the words of a line have more than its code carries out: another code, or the target of a move.
#[inline(never)]
#[small]
pub fn says_more((letter, number): (u8, u16), block: &[u8]) -> bool {
    let (is_text, takes_axes) = match (letter, number) {
        // Names, texts, and a stop.
        (b'$', _) | (b'M', 23 | 28 | 29 | 30 | 32 | 112 | 117 | 118) => return false,
        (b'M', 0 | 1 | 25 | 226 | 600 | 601) => (true, true),
        (b'G', 10) => (false, has(block, b'P') || has(block, b'L')),
        (b'G', number) => (false, !matches!(number, 4 | 11)),
        (_, 17 | 18 | 84 | 92 | 201..=208 | 420 | 593) => (false, true),
        (_, 569 | 906) => (false, Capability::Drivers.is_built_in()),
        _ => (false, false),
    };
    let mut bytes = Bytes::of(words(block));
    let mut before = b' ';
    while let Some(byte) = bytes.next() {
        let letter = byte.to_ascii_uppercase();
        let code = integer(split_digits(bytes.rest).0);
        let more = match letter {
            _ if before.is_ascii_alphabetic() => false,
            // A text for people may have the name of a screw.
            b'G' if is_text => matches!(code, Some(0..=3)),
            b'G' | b'M' => code.is_some() && !is_text,
            b'X'..=b'Z' => !takes_axes,
            _ => false,
        };
        if more {
            return true;
        }
        before = letter;
    }
    false
}

/// Whether one of the numbers that the codes of [`host`](super::host) read cannot be read.
#[inline(never)]
#[small]
pub fn has_bad_number(code: (u8, u16), block: &[u8]) -> bool {
    let reads = matches!(code, (b'M', 26 | 92..=114 | 130..));
    let decimals = if code.1 == 26 { 0 } else { 4 };
    let is_bad = |letter| has(block, letter) && value(block, letter, decimals).is_none();
    reads && b"SPFCU".iter().any(|letter| is_bad(*letter))
}

/// Whether a block may move the machine or its origin: it has G0 to G3 or G92, or begins with the word of an axis.
#[inline(never)]
#[small]
pub fn may_move(block: &[u8]) -> bool {
    if block.first() == Some(&b'$') {
        // The name of a setting is no word.
        return false;
    }
    let mut bytes = Bytes::of(block);
    let (mut before, mut is_first) = (b' ', true);
    while let Some(byte) = bytes.next() {
        let letter = byte.to_ascii_uppercase();
        let code = integer(split_digits(bytes.rest).0);
        let moves = match letter {
            b'G' => !before.is_ascii_alphabetic() && matches!(code, Some(0..=3 | 92)),
            b'X'..=b'Z' => is_first,
            // Words of other languages begin with E, too.
            b'E' => is_first && !bytes.rest.first().is_some_and(u8::is_ascii_alphabetic),
            _ => false,
        };
        if moves {
            return true;
        }
        is_first &= !letter.is_ascii_alphabetic();
        before = letter;
    }
    false
}

/// Returns the text behind the code of a block.
#[inline(never)]
#[small]
pub fn words(block: &[u8]) -> &[u8] {
    split_digits(block.get(1..).unwrap_or(&[])).1.trim_ascii()
}

/// Splits a text behind its leading digits. Blanks at the ends of the text are left out.
#[inline(never)]
#[small]
pub fn split_digits(text: &[u8]) -> (&[u8], &[u8]) {
    let text = text.trim_ascii();
    let end = text.iter().position(|byte| !byte.is_ascii_digit()).unwrap_or(text.len());
    text.split_at_checked(end).unwrap_or((text, &[]))
}

/// Whether a block has a word with this letter behind its code.
#[inline(never)]
#[small]
pub fn has(block: &[u8], letter: u8) -> bool {
    behind(block, letter).is_some()
}

/// Returns the text behind a letter that is in no comment.
#[inline(never)]
#[small]
fn behind(block: &[u8], letter: u8) -> Option<&[u8]> {
    let mut bytes = Bytes::of(words(block));
    bytes.find(|byte| byte.to_ascii_uppercase() == letter)?;
    Some(bytes.rest)
}

/// The bytes of a text that are in no comment. Parentheses count as outside.
pub struct Bytes<'a> {
    rest: &'a [u8],
    aside: Aside,
}

impl<'a> Bytes<'a> {
    pub fn of(text: &'a [u8]) -> Self {
        Self { rest: text, aside: Aside::NONE }
    }

    /// Whether no number comes next, but another word or the end.
    pub fn is_bare(&self) -> bool {
        let next = self.rest.trim_ascii_start().first();
        next.is_none_or(|next| *next == b';' || next.is_ascii_alphabetic())
    }

    /// Takes the number that comes next; `None` if there is none.
    #[inline(never)]
    #[small]
    pub fn take_number(&mut self) -> Option<Number> {
        let text = self.rest.trim_ascii_start();
        let is_digit = |byte: &u8| matches!(byte, b'0'..=b'9' | b'.' | b'-');
        let end = text.iter().position(|byte| !is_digit(byte)).unwrap_or(text.len());
        let (number, rest) = text.split_at_checked(end)?;
        self.rest = rest;
        Number::parse(number)
    }

    /// Takes the number that comes next, if it is 0. Returns whether it is.
    #[small]
    pub fn take_zero(&mut self) -> bool {
        let mut behind = Self { rest: self.rest, aside: self.aside };
        let is_zero = behind.take_number().is_some_and(|number| number.fixed(4, false) == Some(0));
        if is_zero {
            *self = behind;
        }
        is_zero
    }
}

impl Iterator for Bytes<'_> {
    type Item = u8;

    #[inline(never)]
    #[small]
    fn next(&mut self) -> Option<u8> {
        loop {
            let (byte, rest) = self.rest.split_first()?;
            self.rest = rest;
            let before = self.aside;
            self.aside = before.after(*byte);
            if before == Aside::NONE && *byte == b';' {
                return None;
            }
            if before == Aside::NONE || self.aside == Aside::NONE {
                return Some(*byte);
            }
        }
    }
}

/// Returns the number behind a letter; `None` if there is none.
#[inline(never)]
#[small]
pub fn number(block: &[u8], letter: u8) -> Option<Number> {
    Bytes::of(behind(block, letter)?).take_number()
}

/// Returns the number behind a letter, scaled to `decimals` decimals.
#[inline(never)]
#[small]
pub fn value(block: &[u8], letter: u8, decimals: u8) -> Option<i32> {
    number(block, letter)?.fixed(decimals, false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_and_words() {
        assert_eq!(code(b"m105"), Some((b'M', 105)));
        assert_eq!(code(b"G1X10"), Some((b'G', 1)));
        assert_eq!(code(b"G 28 X"), Some((b'G', 28)));
        assert_eq!(code(b"T0"), Some((b'T', 0)));
        assert_eq!(code(b"$1sa=1.8"), Some((b'$', 0)));
        for none in ["", "X1", "G28.2 X0", "Mx", "M99999999"] {
            assert_eq!(code(none.as_bytes()), None, "{none}");
        }
        assert!(has(b"G28 x Y", b'X') && !has(b"G28 X ; Z", b'Z'));
        let comments = b"G28 (home all axes) Y (; Z 3) S5 ; M110";
        for (letter, is_word) in [(b'Y', true), (b'S', true), (b'H', false), (b'X', false)] {
            assert_eq!(has(comments, letter), is_word);
        }
        assert_eq!((value(comments, b'Z', 0), value(comments, b'S', 0)), (None, Some(5)));
        assert!(!has(b"G28 (X Y", b'Y') && !has(comments, b'M'));
        assert_eq!(value(b"M207 S1.5 F1800", b'S', 4), Some(15_000));
        assert_eq!(value(b"M207 S-1.5", b'S', 4), Some(-15_000));
        assert_eq!(value(b"M207 S", b'S', 4), None);
        assert_eq!(words(b"M117 Hello  world "), b"Hello  world");
    }

    #[test]
    fn what_says_more_than_its_code() {
        let more = |line: &str| says_more(code(line.as_bytes()).unwrap(), line.as_bytes());
        for line in [
            "M400 G1 X5",
            "M105 M104 S50",
            "m27g1",
            "M400 X5",
            "T0 G1",
            "G28 X0 G1",
            "M0 then G1 X5",
            "M2 y1",
            "G4 P1 X1",
            "G10 Z1",
            "M84 X M104",
        ] {
            assert!(more(line), "{line}");
        }
        for line in [
            "M400",
            "M117 G1 X5",
            "M23 G1.GCO",
            "$xvm=5",
            "M0 Use M3, G54 and X",
            "M600 X5",
            "M84 X E",
            "M92 X1",
            "M105 ; G1",
            "M112 G1",
            "M105 (G1 X1)",
            "G28 X0",
            "M105 T0",
            "M115 U3.13 MG1",
        ] {
            assert!(!more(line), "{line}");
        }
    }

    #[test]
    fn what_may_move() {
        for line in
            ["G1 X1", "g0", "G 2 I1", "G90 G1 X1", "(a) G01 X", "X1", "y", "E-1", "E 1", "N G1 X"]
        {
            assert!(may_move(line.as_bytes()), "{line}");
        }
        let others = [
            "G28 X",
            "G38.2 Z-1",
            "G10 S1",
            "M104 S200",
            "EXCLUDE_OBJECT NAME=PLUG1",
            "START G4",
            "F100",
        ];
        for line in others.into_iter().chain(["", "; G1 X1", "M117 (G1 X1)", "T1"]) {
            assert!(!may_move(line.as_bytes()), "{line}");
        }
    }

    #[test]
    fn what_overtakes() {
        let of = |line: &str| overtakes(&Frame::of(line.as_bytes()), line.as_bytes());
        for line in ["M105", "M112", "M108", "M114", "N3 M112*34"] {
            assert!(of(line), "{line}");
        }
        for line in ["N3 M105*35", "N3 M112*1", "G1 X1", "M1050", "M400"] {
            assert!(!of(line), "{line}");
        }
    }
}
