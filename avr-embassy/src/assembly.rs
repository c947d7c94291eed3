//! What handlers in assembly need of the runtime.
//!
//! **Event bits**: `sbi {FLAGS}, bit` is [`Event::set`](crate::Event::set). **Software interrupt**: to store [`PENDED`] at
//! [`PEND`] is [`interrupt::pend`](crate::interrupt::pend).
//!
//! **Holding the interrupt executor off.** A handler that lets other interrupts in with `sei` can be interrupted by the software interrupt,
//! which may run for long. Two ways to keep it out, both entered with interrupts off:
//!
//! - set bit [`HOLD`] of [`FLAGS`], and at the end clear it; if [`HELD`] is set then, clear it and pend. It is for a handler that no other
//!   user of the bit interrupts.
//! - increment [`CLOSED`], and decrement it at the end; if it is 0 then and [`MISSED`] is not, clear [`MISSED`] and pend. It nests.

use crate::byte::SharedByte;
pub use crate::chip::{FLAGS, PEND, PENDED};

/// Bit of [`FLAGS`]: a handler runs that the interrupt executor must not delay. Never set in thread mode.
pub const HOLD: u8 = 5;
/// Bit of [`FLAGS`]: the executor was asked for meanwhile, and the handler that holds it off pends it at its end.
pub const HELD: u8 = 6;

/// Not 0: the interrupt executor runs, may not run, or has not been started.
pub static CLOSED: SharedByte = SharedByte::new(NOT_STARTED);
/// What [`CLOSED`] is before the interrupt executor is started.
pub(crate) const NOT_STARTED: u8 = 2;
/// Not 0: it was asked for meanwhile.
pub static MISSED: SharedByte = SharedByte::new(0);
