//! Kerf: motion-control firmware in async Rust on Embassy, for 8-bit AVR boards and the RP2040.
//!
//! This library is the whole firmware except the image's entry point. It is `no_std` and runs on
//! the ATmega2560, the RP2040 and, for tests and tools, on the host. `ARCHITECTURE.md` is a guided tour of the code.
//!
//! # The path of a line
//!
//! A line of G-code arrives as bytes and leaves as steps. Each stage is a task or an interrupt, and a bounded channel
//! joins it to the next stage ([`tasks::links`] lists the channels):
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
//! Other tasks work beside these stages: [`tasks::control`] carries out real-time characters, [`tasks::reporter`]
//! reports changes, [`tasks::storage`] writes settings to EEPROM, [`tasks::power`] switches motors on and off.
//!
//! # The other modules
//!
//! - [`machine`]: what the machine is doing, as one state with a table of transitions.
//! - [`config`]: the settings, each a row in [`config::groups`]; [`store`] keeps them in EEPROM.
//! - [`boards`]: pins and chips as data; [`hal`]: the chip, behind one interface for AVR, RP2040 and host.
//! - [`units`], [`math`], [`status`], [`baud`]: definitions that all other modules share.
#![no_std]
// An image has no `std`, and needs these unstable features of the compiler.
#![cfg_attr(not(feature = "std"), feature(asm_experimental_arch, optimize_attribute))]
// Some chips do not use all of these features.
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
