//! Outputs that are not steps.

use super::Local;
use crate::boards::ACTIVE;

machine_static! {
    fn wanted() -> Local<u8> = Local::new(0);
}

machine_static! {
    fn switched() -> Local<u8> = Local::new(0);
}

/// Switches the outputs of M3 to M9, bits of [`outputs`](crate::boards::outputs).
pub fn set_outputs(on: u8) {
    switched().set(on);
}

/// Which outputs are on when they are low: of no account here, where outputs are counted before the pins.
pub fn set_low(_outputs: u8, on: u8) {
    set_outputs(on);
}

/// What [`set_outputs`] was told last.
pub fn outputs() -> u8 {
    switched().get()
}

/// Switches the drivers of these motors (bits) on, and the others off as far as the board can.
pub fn power(motors: u8) {
    wanted().set(motors);
}

/// The motors whose drivers are on, as bits.
pub fn powered() -> u8 {
    ACTIVE.powered(wanted().get())
}
