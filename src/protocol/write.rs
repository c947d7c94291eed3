//! Numbers and texts, for the dialects that are not JSON.

use crate::config::{Digits, Fixed};
use crate::progmem::Text;
use crate::protocol::Out;

/// Writes a text.
#[inline(never)]
#[small]
pub fn text(out: &mut impl Out, text: Text) {
    text.bytes().for_each(|byte| out.put(byte));
}

/// Writes a number with all its decimals.
#[inline(never)]
#[small]
pub fn fixed(out: &mut impl Out, fixed: Fixed) {
    let mut digits = Digits::default();
    out.put_all(fixed.render(&mut digits).iter().copied());
}

/// Writes an integer.
pub fn int(out: &mut impl Out, value: i32) {
    fixed(out, Fixed::int(value));
}
