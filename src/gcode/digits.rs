//! The digits of a plain number, for the fast path: up to four decimals, no blanks, no sign.
//!
//! Cost on AVR: 22 cycles a digit, and 80 for a number. A loop in Rust would take twice as long.

use crate::hal::text::Cursor;

/// Reads a number below 65,530. Returns the whole part, and the decimals as ten-thousandths. Further digits are not
/// read; no word can begin with them. `None` without any digit.
#[inline(always)]
pub fn decimal(cursor: &mut Cursor) -> Option<(u16, u16)> {
    let (mut whole, missing) = cursor.four();
    if missing == 0 && cursor.byte.is_ascii_digit() && whole < u16::MAX / 10 {
        whole = whole * 10 + u16::from(cursor.byte - b'0');
        cursor.step();
    }
    if cursor.byte != b'.' {
        return (missing < 4).then_some((whole, 0));
    }
    cursor.step();
    let (decimals, absent) = cursor.four();
    let frac = match absent {
        0 => decimals,
        1 => decimals * 10,
        2 => decimals * 100,
        3 => decimals * 1_000,
        // A lone point is no number.
        _ if missing == 4 => return None,
        _ => 0,
    };
    Some((whole, frac))
}
