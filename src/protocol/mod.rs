//! How senders are spoken to: the interface that tasks know, and the dialects behind it.
//!
//! A line that has come becomes a [`Request`], which the parser task steps until it is answered. What the machine tells
//! unasked is a [`Notice`]: it becomes a [`Telling`], which is stepped alike. Both ask the [`Machine`] and write to an [`Out`]. No
//! step waits, keeps a reference, allocates or recurses, and none puts more than [`CHUNK`] bytes.
//!
//! | module | what it has |
//! |---|---|
//! | [`dialect`] | [`Dialect`], what a dialect has to have, and the table of dialects |
//! | [`line`](mod@line) | what comes in: parts of lines, what is to be done next with one |
//! | [`machine`], [`value`] | what dialects ask of the machine |
//! | [`notice`] | what is told unasked |
//! | [`out`] | where dialects write to |
//! | [`tinyg`], [`grbl`], `reprap` | TinyG's dialect, grbl's, and that of printing hosts |
//! | `write`, `steps` | what grbl's dialect and that of printing hosts share: numbers and texts, steps per millimetre |
//!
//! A dialect spells what is neutral here: the numbers and texts of a [`Status`](crate::status::Status), names of settings and values, what
//! the machine is [doing](crate::machine::Doing). Which dialects an image has is a Cargo feature each; where there is one, nothing is left
//! to choose at run time, and the choice costs nothing.

pub mod checksum;
pub mod dialect;
#[cfg(feature = "dialect-grbl")]
pub mod grbl;
pub mod line;
pub mod machine;
pub mod notice;
pub mod out;
#[cfg(feature = "dialect-reprap")]
pub mod reprap;
#[cfg(any(feature = "dialect-grbl", feature = "dialect-reprap"))]
mod steps;
#[cfg(feature = "dialect-tinyg")]
pub mod tinyg;
pub mod value;
#[cfg(any(feature = "dialect-grbl", feature = "dialect-reprap"))]
mod write;

pub use checksum::Checksum;
pub use dialect::{
    Answers, Dialect, Memory, Remembers, Request, Speech, Telling, Tells, asks_alarm, is_control,
    jog, may_be_control,
};
pub use line::{Ending, Next, Span};
pub use machine::{Cold, Extruder, Hold, Level, Machine, STARTUP_MAX, Store, Warning};
pub use notice::{Notice, Occasion};
pub use out::Out;
pub use value::{Value, thousandths};

/// Bytes that one step puts at most.
pub const CHUNK: usize = 64;

/// A block that a dialect has [rewritten](Dialect::rewrite).
pub type Rewritten = heapless::Vec<u8, 96>;

/// Longest line that may begin an alarm when it arrives: see [`asks_alarm`].
pub const STOP_MAX: usize = 32;
