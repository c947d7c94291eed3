//! Numbers and texts of dialects that are not JSON.

use crate::config::{Digits, Fixed};
use crate::progmem::Text;
use crate::protocol::Out;

/// A text.
#[inline(never)]
#[small]
pub fn text(out: &mut impl Out, text: Text) {
    text.bytes().for_each(|byte| out.put(byte));
}

/// A number, all its decimals.
#[inline(never)]
#[small]
pub fn fixed(out: &mut impl Out, fixed: Fixed) {
    let mut digits = Digits::default();
    out.put_all(fixed.render(&mut digits).iter().copied());
}

/// An integer.
pub fn int(out: &mut impl Out, value: i32) {
    fixed(out, Fixed::int(value));
}
