//! What both sides of the serial line agree on: the rings, and the marks of lost bytes.

use super::ring::{Consumer, Producer};

/// Size of each ring.
pub const RING: usize = 256;

/// What stands where bytes were lost. No line of text has it.
pub const LOSS: u8 = 0;
/// The same, where the byte that is replaced ended its line.
pub const LOSS_AT_END: u8 = 1;

/// Bytes received.
pub type Received = Consumer<u8, RING>;
/// Bytes to send. Call `imp::uart::kick` after filling it.
pub type Outgoing = Producer<u8, RING>;
