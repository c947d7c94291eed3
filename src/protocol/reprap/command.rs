//! Recognizes the code of a line, and finds its words.

use super::frame::{Frame, Sum, integer};
use crate::config::Number;

/// Returns the code of a block, with its letter in upper case: the first word, if that is G, M or T with a whole
/// number. `None` otherwise.
#[inline(never)]
#[small]
pub fn code(block: &[u8]) -> Option<(u8, u16)> {
    let (letter, rest) = block.split_first()?;
    let letter = letter.to_ascii_uppercase();
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
        Some((b'M', number)) if frame.sum != Sum::Wrong => Some(number),
        _ => None,
    }
}

/// Whether the line is M112.
#[small]
pub fn is_stop(frame: &Frame, line: &[u8]) -> bool {
    whole(frame, line) == Some(112)
}

/// Whether a line overtakes the lines that wait.
#[inline(never)]
#[small]
pub fn overtakes(frame: &Frame, line: &[u8]) -> bool {
    match whole(frame, line) {
        Some(108 | 112) => true,
        Some(105 | 114) => frame.number.is_none(),
        _ => false,
    }
}

/// Whether a code is answered only when it is done, because hosts take its `ok` for the end of the wait.
#[inline(never)]
#[small]
pub fn waits(code: Option<(u8, u16)>) -> bool {
    matches!(code, Some((b'G', 4) | (b'M', 0 | 1 | 109 | 116 | 190)))
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
    in_comment: bool,
}

impl<'a> Bytes<'a> {
    pub fn of(text: &'a [u8]) -> Self {
        Self { rest: text, in_comment: false }
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
            match byte {
                b')' => self.in_comment = false,
                _ if self.in_comment => continue,
                b';' => return None,
                b'(' => self.in_comment = true,
                _ => {}
            }
            return Some(*byte);
        }
    }
}

/// Returns the number behind a letter; `None` if there is none.
#[inline(never)]
#[small]
pub fn number(block: &[u8], letter: u8) -> Option<Number> {
    let text = behind(block, letter)?.trim_ascii();
    let is_digit = |byte: &u8| matches!(byte, b'0'..=b'9' | b'.' | b'-');
    let end = text.iter().position(|byte| !is_digit(byte)).unwrap_or(text.len());
    Number::parse(text.get(..end)?)
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
