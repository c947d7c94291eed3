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
    let rest = rest.trim_ascii_start();
    let digits = rest.iter().position(|byte| !byte.is_ascii_digit()).unwrap_or(rest.len());
    if rest.get(digits) == Some(&b'.') {
        return None;
    }
    let number = integer(rest.get(..digits)?)?;
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
    matches!(code, Some((b'M', 0 | 1 | 109 | 116 | 190)))
}

/// Returns the text behind the code of a block.
#[inline(never)]
#[small]
pub fn words(block: &[u8]) -> &[u8] {
    let rest = block.get(1..).unwrap_or(&[]).trim_ascii_start();
    let digits = rest.iter().position(|byte| !byte.is_ascii_digit()).unwrap_or(rest.len());
    rest.get(digits..).unwrap_or(&[]).trim_ascii()
}

/// Whether a block has a word with this letter behind its code.
#[inline(never)]
#[small]
pub fn has(block: &[u8], letter: u8) -> bool {
    without_comment(block).iter().any(|byte| byte.to_ascii_uppercase() == letter)
}

/// Returns the text behind the code of a block, up to a comment.
#[small]
fn without_comment(block: &[u8]) -> &[u8] {
    words(block).split(|byte| *byte == b';').next().unwrap_or(&[])
}

/// Returns the number behind a letter; `None` if there is none.
#[inline(never)]
#[small]
pub fn number(block: &[u8], letter: u8) -> Option<Number> {
    let text = without_comment(block);
    let at = text.iter().position(|byte| byte.to_ascii_uppercase() == letter)?;
    let text = text.get(at + 1..)?.trim_ascii_start();
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
