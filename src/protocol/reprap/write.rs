//! Numbers and texts of this dialect.

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
#[inline(never)]
#[small]
pub fn int(out: &mut impl Out, value: i32) {
    fixed(out, Fixed::int(value));
}

/// A length in units of a `Length`, in millimetres with three decimals.
#[inline(never)]
#[small]
pub fn length(out: &mut impl Out, units: i32) {
    fixed(out, Fixed { value: units, decimals: 4 }.rounded(3));
}

/// The end of a line.
pub fn line_end(out: &mut impl Out) {
    out.put(b'\n');
}
