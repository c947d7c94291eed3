//! The hardware, and what stands in for it on the host.
//!
//! Executors, rings, event bits and the ceiling lock are those of [`avr_embassy`]; this module says what Kerf
//! uses them for. `avr` owns all the registers and nearly all the `unsafe`; `host` is the same over
//! mocked time. Exactly one of the two is compiled, under the name [`imp`]. What both have is written down as traits in [`contract`] and
//! [`primitives`]; all other code calls that, as `hal::stepper::go()`, and does not know which it is.

pub use avr_embassy::{Ceiling, Interrupt, Thread, byte, ring};

#[macro_use]
mod place;

pub use contract::{
    TICKS, TIMER_HZ, eeprom, encoder, gpio, inputs, pwm, stepper, system, time, uart, watchdog,
};
pub use place::Never;
pub use primitives::{arithmetic, float, text};

pub mod contract;
pub mod event;
pub mod exec;
pub mod flags;
pub mod primitives;
pub mod progmem;
pub mod resets;
pub mod serial;

#[cfg(target_arch = "avr")]
#[path = "avr/mod.rs"]
pub mod imp;
#[cfg(not(target_arch = "avr"))]
#[path = "host/mod.rs"]
pub mod imp;
