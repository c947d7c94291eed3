//! Outputs that are not steps.

use super::Local;
use crate::boards::ACTIVE;
use crate::hal::Exclusive;

machine_static! {
    fn wanted() -> Local<u8> = Local::new(0);
}

machine_static! {
    fn switched() -> Local<u8> = Local::new(0);
}

/// Switches the outputs of M3 to M9, bits of [`outputs`](crate::boards::outputs).
pub fn set_outputs(_: Exclusive<'_>, on: u8) {
    switched().set(on);
}

/// Sets the outputs to `on`. Which outputs are active low has no effect here, because no pins are modelled.
pub fn set_low(alone: Exclusive<'_>, _outputs: u8, on: u8) {
    set_outputs(alone, on);
}

/// Returns the outputs that [`set_outputs`] has set.
pub fn outputs() -> u8 {
    switched().get()
}

/// Switches the drivers of these motors (bits) on and the others off, as far as the board can.
pub fn power(_: Exclusive<'_>, motors: u8) {
    wanted().set(motors);
}

/// Returns the motors whose drivers are on, as bits.
pub fn powered() -> u8 {
    ACTIVE.powered(wanted().get())
}
