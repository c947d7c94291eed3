//! The protocol layer: the interface that tasks use to talk to senders, and the dialects behind it.
//!
//! A received line becomes a [`Request`]. The parser task steps the request until the line is answered. What the
//! machine reports without being asked is a [`Notice`]; a notice becomes a [`Telling`], which is stepped in the same
//! way. Requests and tellings query the [`Machine`] and write to an [`Out`]. No step waits, keeps a reference,
//! allocates or recurses. No step writes more than [`CHUNK`] bytes.
//!
//! | module | contents |
//! |---|---|
//! | [`dialect`] | [`Dialect`], the interface of a dialect, and the table of dialects |
//! | [`line`](mod@line) | parts of a received line, and what the caller does next with it |
//! | [`machine`], [`value`] | what dialects ask of the machine |
//! | [`notice`] | what the machine reports without being asked |
//! | [`out`] | where dialects write to |
//! | [`tinyg`], [`grbl`], `reprap` | the dialects of TinyG, of grbl, and of printing hosts |
//! | `files` | shared by the dialects of TinyG and grbl: files of an SD card |
//! | `write`, `steps`, `by_name` | shared by grbl's dialect and that of printing hosts: numbers and texts, steps per millimetre, settings by name |
//!
//! Everything outside the dialects is neutral: the [`Status`](crate::status::Status), the names of settings and
//! values, and what the machine is [doing](crate::machine::Doing). A dialect spells them out for its senders. Each
//! dialect is a Cargo feature. In an image with a single dialect nothing is chosen at run time, and the choice costs
//! nothing.

#[cfg(any(feature = "dialect-grbl", feature = "dialect-reprap"))]
mod by_name;
pub mod checksum;
pub mod dialect;
#[cfg(all(feature = "sd", any(feature = "dialect-tinyg", feature = "dialect-grbl")))]
mod files;
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
    Answers, Dialect, Intervals, Memory, Remembers, Request, Speech, Telling, Tells, asks_alarm,
    ends_alarm, is_control, jog, may_be_control,
};
pub use line::{Ending, Next, Span, is_joined};
pub use machine::{Cold, Extruder, Hold, Level, Machine, STARTUP_MAX, Store, Warning};
pub use notice::{Notice, Occasion};
pub use out::Out;
pub use value::{Value, thousandths};

/// The most bytes that one step writes.
pub const CHUNK: usize = 64;

/// A block after [`Dialect::rewrite`].
pub type Rewritten = heapless::Vec<u8, 96>;

/// The longest line that may raise an alarm on arrival: see [`asks_alarm`].
pub const STOP_MAX: usize = 32;
