//! Numbers and texts of this dialect.

use crate::config::Fixed;
use crate::protocol::Out;
use crate::text;

pub use crate::protocol::write::{fixed, int, text};

/// Writes a length given in units of a `Length`, in millimetres with three decimals.
#[inline(never)]
#[small]
pub fn length(out: &mut impl Out, units: i32) {
    fixed(out, Fixed { value: units, decimals: 4 }.rounded(3));
}

/// Writes a line end.
pub fn line_end(out: &mut impl Out) {
    out.put(b'\n');
}

/// Reports that filament is too cold to be moved.
#[small]
pub fn cold(out: &mut impl Out) {
    text(out, text!("echo: cold extrusion prevented\n"));
}
