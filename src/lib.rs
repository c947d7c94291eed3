//! Kerf: motion-control firmware in async Rust on Embassy, for 8-bit AVR boards and the RP2040.
//!
//! This library is the whole firmware but for the image's entry point. It is `no_std` and runs on
//! the ATmega2560, the RP2040 and, for tests and tools, on the host. `ARCHITECTURE.md` is the tour of the house.
//!
//! # The way of a line
//!
//! A line of G-code comes in as bytes and leaves as steps; each stage is a task or an interrupt, joined to the next by a bounded channel
//! ([`tasks::links`] lists them all):
//!
//! | stage | level | modules |
//! |---|---|---|
//! | bytes into a ring; real-time characters are taken out | receive interrupt | `hal::avr::uart`, [`realtime`] |
//! | a line into its port's pool | thread | [`tasks::reader`], [`tasks::lines`] |
//! | the line into commands, and its answer | thread | [`tasks::parser`], [`protocol`], [`gcode`] |
//! | commands into blocks, with speeds at their ends | thread | [`tasks::planner`], [`motion::line`], [`motion::queue`] |
//! | blocks into segments of some milliseconds | exec interrupt | [`tasks::exec`], [`motion::governor`], [`motion::prep`] |
//! | segments into steps at pins | step interrupt | [`dda`], `hal::avr::step_isr` |
//!
//! Beside that way: [`tasks::control`] carries out real-time characters, [`tasks::reporter`] tells what changes, [`tasks::storage`] puts
//! settings away, [`tasks::power`] switches motors on and off.
//!
//! # What the rest is
//!
//! - [`machine`]: what the machine is doing, as one state with a table of transitions.
//! - [`config`]: the settings, a row each in [`config::groups`]; [`store`] keeps them in EEPROM.
//! - [`boards`]: pins and chips as data; [`hal`]: the chip, behind one interface for AVR and host.
//! - [`units`], [`math`], [`status`], [`baud`]: what all of these share.
#![no_std]
// An image has no `std`, and needs these of the compiler.
#![cfg_attr(not(feature = "std"), feature(asm_experimental_arch, optimize_attribute))]
// On some chips.
#![cfg_attr(not(feature = "std"), allow(unused_features))]

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
pub mod card;
pub mod config;
pub mod dda;
pub mod drivers;
pub mod encoder;
pub mod gcode;
pub mod heat;
pub mod jobs;
pub mod kinematics;
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
