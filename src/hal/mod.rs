//! The hardware, and what stands in for it on the host.
//!
//! Executors, rings, event bits and the ceiling lock come from [`avr_embassy`]; this module says what Kerf uses them
//! for. `avr` and `rp2040` own all registers of their chips and contain nearly all the `unsafe`. `host` provides the
//! same functions over mocked time. Exactly one of the three is compiled, under the name [`imp`]. The traits in
//! [`contract`] and [`primitives`] say what each of them provides. All other code calls those functions, for example
//! `hal::stepper::go()`, and does not know which chip it runs on.

pub use avr_embassy::{Boot, Ceiling, Exclusive, Interrupt, Level, Thread, byte, ring};

#[macro_use]
mod place;

pub use contract::{
    BLEND_S_MIN, BLOCK_S_MIN, LINE_BYTES, LINES, LOOK_AHEAD, PULSE_US, SAMPLE_MS, SHORT_SHARE,
    STAGE, TICKS, TIMER_HZ, card, drivers, eeprom, encoder, gpio, heaters, inputs, pwm, stepper,
    system, time, uart, watchdog,
};
pub use place::Never;
pub use primitives::{arithmetic, float, text};

/// Waits for `ms` milliseconds. How long a tick of `embassy-time` is depends on the chip.
#[inline(always)]
pub fn after_ms(ms: u64) -> embassy_time::Timer {
    embassy_time::Timer::after_ticks(ms * (embassy_time::TICK_HZ / 1_000))
}

pub mod contract;
pub mod event;
pub mod exec;
pub mod flags;
pub mod primitives;
pub mod progmem;
pub mod resets;
pub mod segments;
pub mod serial;

#[cfg(feature = "chip-atmega2560")]
#[path = "avr/mod.rs"]
pub mod imp;
#[cfg(feature = "chip-rp2040")]
#[path = "rp2040/mod.rs"]
pub mod imp;
#[cfg(not(target_os = "none"))]
#[path = "host/mod.rs"]
pub mod imp;

#[cfg(all(target_os = "none", not(any(feature = "chip-atmega2560", feature = "chip-rp2040"))))]
compile_error!("an image needs a board, whose feature names the chip: `board-NAME`");

/// The parts of `rp2040` that are plain Rust, compiled here for their tests.
#[cfg(test)]
#[path = "rp2040/pieces/mod.rs"]
mod pieces;
#[cfg(test)]
#[allow(dead_code)]
#[path = "rp2040/stepper/words.rs"]
mod words;
