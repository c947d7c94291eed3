//! Recognizes control lines: JSON without G-code, `$`, `?`, and the letter H alone.

use super::help::asks_help;

/// Whether a control line may begin with this byte.
#[inline(always)]
pub fn may_be(first: u8) -> bool {
    matches!(first, b'{' | b'$' | b'?' | b'h' | b'H')
}

/// Whether a line is a control line.
#[inline(always)]
pub fn is(line: &[u8]) -> bool {
    match line.first() {
        _ if is_of_files(line) => false,
        Some(b'$' | b'?') => true,
        Some(b'{') => !holds_gcode(line),
        Some(b'h' | b'H') => asks_help(line),
        _ => false,
    }
}

/// Whether a line does something with files of the SD card. It keeps its place among lines of G-code, because they are
/// written to the file, or run behind it.
#[cfg(feature = "sd")]
#[inline(never)]
fn is_of_files(line: &[u8]) -> bool {
    let mut letters = line.iter().filter(|byte| !matches!(byte, b' ' | b'\t' | b'"'));
    let begins = matches!(letters.next(), Some(b'{' | b'$'));
    let mut next = || letters.next().map_or(0, u8::to_ascii_lowercase);
    begins && [next(), next()] == *b"sd" && matches!(next(), b'l' | b'r' | b'd' | b'w' | b'x')
}

/// Without a card, no line does.
#[cfg(not(feature = "sd"))]
#[inline(always)]
fn is_of_files(_: &[u8]) -> bool {
    false
}

/// Whether the JSON received so far is a `gc`, or a `txt` with anything but a `$` or `?` line. A `tid` may come
/// first.
#[inline(never)]
#[small]
fn holds_gcode(line: &[u8]) -> bool {
    // The last two letters of a name, and whether its value is being read.
    let (mut last, mut before, mut within) = (0, 0, false);
    for byte in line.iter().skip(1) {
        // The OR makes letters lower case. Other bytes that matter here stay as they are; a tab becomes a
        // parenthesis.
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
