//! The interface of the runtime for interrupt handlers in assembly.
//!
//! **Event bits**: `sbi {FLAGS}, bit` is [`Event::set`](crate::Event::set). **Software interrupt**: a store of
//! [`PENDED`] to [`PEND`] is [`interrupt::pend`](crate::interrupt::pend).
//!
//! **Holding the interrupt executor off.** A handler that allows other interrupts with `sei` can be interrupted by the
//! software interrupt, which may run for long. There are two ways to keep it out. Both are entered with interrupts off:
//!
//! - set bit [`HOLD`] of [`FLAGS`], and clear it at the end; if [`HELD`] is set then, clear [`HELD`] and pend. This is
//!   for a handler that no other user of the bit interrupts.
//! - increment [`CLOSED`], and decrement it at the end; if [`CLOSED`] is 0 then and [`MISSED`] is not, clear [`MISSED`]
//!   and pend. This way nests.

use crate::byte::SharedByte;
pub use crate::chip::{FLAGS, PEND, PENDED};

/// Bit of [`FLAGS`]: a handler runs that the interrupt executor must not delay. Never set in thread mode.
pub const HOLD: u8 = 5;
/// Bit of [`FLAGS`]: the interrupt executor was asked for while [`HOLD`] was set. The handler that holds it off pends
/// it at its end.
pub const HELD: u8 = 6;

/// Not 0: the interrupt executor runs, may not run, or has not been started.
pub static CLOSED: SharedByte = SharedByte::new(NOT_STARTED);
/// What [`CLOSED`] is before the interrupt executor is started.
pub(crate) const NOT_STARTED: u8 = 2;
/// Not 0: the interrupt executor was asked for while [`CLOSED`] kept it out.
pub static MISSED: SharedByte = SharedByte::new(0);
