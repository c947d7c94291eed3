//! Numbers and texts of grbl's dialect.

use crate::config::Fixed;
use crate::plain;
use crate::progmem::Text;
use crate::protocol::Out;

pub use crate::protocol::write::{fixed, int, text};

/// The number of decimals of a `Length`.
const KEPT: u8 = 4;

/// Writes a length given in units of a `Length`: in millimetres with three decimals, or in inches with four.
#[inline(never)]
#[small]
pub fn length(out: &mut impl Out, units: i32, inches: bool) {
    let value = Fixed { value: units, decimals: KEPT };
    fixed(out, if inches { value.inches(KEPT) } else { value.rounded(3) });
}

/// Writes a speed given in thousandths of mm/min: in mm/min without decimals, or in inches/min with one.
#[inline(never)]
#[small]
pub fn speed(out: &mut impl Out, thousandths: i32, inches: bool) {
    let value = Fixed { value: thousandths, decimals: 3 };
    fixed(out, if inches { value.inches(1) } else { value.rounded(0) });
}

/// Writes a line end.
pub fn line_end(out: &mut impl Out) {
    out.put_plain(plain!("\r\n"));
}

/// Closes a bracketed line.
pub fn close(out: &mut impl Out) {
    out.put_plain(plain!("]\r\n"));
}

/// Writes a bracketed line: `[MSG:text]`.
#[inline(never)]
#[small]
pub fn message(out: &mut impl Out, what: Text) {
    text(out, crate::text!("[MSG:"));
    text(out, what);
    close(out);
}
