//! Which lines are control lines: JSON, `$`, `?` and the letter H. JSON that holds G-code is none.

use super::help::asks_help;

/// Whether one may begin so.
#[inline(always)]
pub fn may_be(first: u8) -> bool {
    matches!(first, b'{' | b'$' | b'?' | b'h' | b'H')
}

/// Whether a line is one.
#[inline(always)]
pub fn is(line: &[u8]) -> bool {
    match line.first() {
        Some(b'$' | b'?') => true,
        Some(b'{') => !holds_gcode(line),
        Some(b'h' | b'H') => asks_help(line),
        _ => false,
    }
}

/// Whether a line of JSON is `gc`, or a `txt` that is no line of text mode, as far as it has come. Either may stand behind `tid`.
#[inline(never)]
#[small]
fn holds_gcode(line: &[u8]) -> bool {
    // The last letters of a name, and whether its value is being read.
    let (mut last, mut before, mut within) = (0, 0, false);
    for byte in line.iter().skip(1) {
        // Letters in lower case; others that count here stay as they are, and a tab is a parenthesis.
        let byte = *byte | b' ';
        if matches!(byte, b' ' | b'"' | b')') {
            continue;
        }
        if within {
            if last == b't' {
                return !matches!(byte, b'$' | b'?');
            }
            within = byte != b',';
        } else if byte == b':' {
            match (before, last) {
                (b'g', b'c') => return true,
                (b'x', b't') | (b'i', b'd') => within = true,
                _ => return false,
            }
        } else {
            (before, last) = (last, byte);
        }
    }
    false
}
