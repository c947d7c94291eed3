//! Kerf: motion-control firmware for 8-bit AVR boards, in async Rust on Embassy.
//!
//! This library is the whole firmware but for the image's entry point. It is `no_std` and runs on
//! the ATmega2560 and, for tests and tools, on the host. `ARCHITECTURE.md` is the tour of the house.
#![no_std]
#![cfg_attr(target_arch = "avr", feature(asm_experimental_arch, optimize_attribute))]

#[cfg(feature = "std")]
extern crate std;

#[macro_use(machine_static)]
extern crate avr_embassy;
#[macro_use]
extern crate kerf_macros;

#[macro_use]
pub mod hal;

pub mod app;
pub mod baud;
pub mod boards;
#[cfg(feature = "std")]
pub mod canon;
pub mod capability;
pub mod config;
pub mod gcode;
pub mod jobs;
pub mod machine;
pub mod math;
pub mod motion;
pub mod motors;
pub mod protocol;
pub mod realtime;
pub mod spindle;
pub mod status;
pub mod store;
pub mod switches;
pub mod tasks;
pub mod units;

pub use hal::progmem;
