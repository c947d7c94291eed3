//! The tasks. Each is a thin `async fn` around a part that knows nothing of tasks; `links` lists everything that
//! connects them.
//!
//! The future of an `async fn` stores the arguments beside what the function makes of them, for as long as it runs.
//! Where that costs too much RAM, `run` is a function that returns an async block instead: its future stores only what
//! the block uses.

pub mod alarm;
#[cfg(feature = "sd")]
pub mod card;
pub mod common;
pub mod control;
pub mod drivers;
pub mod exec;
pub mod health;
pub mod heat;
pub mod hold;
mod homing;
mod jog;
mod lent;
pub mod lines;
pub mod links;
mod origin;
pub mod overrides;
mod overtake;
pub mod parser;
pub mod planner;
pub mod ports;
pub mod power;
pub mod reader;
mod realtime;
pub mod reporter;
mod row;
pub mod setup;
pub mod shaper;
pub mod spindle;
mod stop;
pub mod storage;
mod surface;
pub mod switches;
pub mod turning;
pub mod tx;
pub mod view;
pub mod wake;

pub use crate::hal::Never;

/// Tasks that wait for a time. `xtask/src/layers.rs` checks that the list is complete.
pub const WAIT_FOR_TIME: [&str; 4] = ["planner/merge", "power", "reporter", "storage"];
const _: () = assert!(
    WAIT_FOR_TIME.len() <= avr_embassy::timers::TIMERS,
    "more tasks wait for a time than the runtime has timers, and would poll: turn on the feature `timers-8` of avr-embassy in Cargo.toml"
);
