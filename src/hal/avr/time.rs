//! Time: the millisecond tick of [`avr_embassy::time`], on timer 0. Timers are for thread-mode tasks only.

use avr_embassy::time;

use crate::boards::{ACTIVE, Timer};
use crate::hal::Boot;

pub use avr_embassy::time::millis;

const _: () = assert!(matches!(ACTIVE.tick_timer, Timer::T0), "the tick is on timer 0");

/// Starts the tick.
pub fn start(_: &Boot) {
    time::start::<{ ACTIVE.clock_hz }>();
}
