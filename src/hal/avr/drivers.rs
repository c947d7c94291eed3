//! Drivers that are set up by UART: no board with this chip has any.

use crate::drivers::REGISTERS;
use crate::drivers::watch::Watch;
use crate::hal::Thread;

/// Does nothing.
pub fn tell(_: Thread, _motor: u8, _values: &[u32; REGISTERS]) {}

/// Returns a driver that is well.
pub fn watch(_: Thread, _motor: u8) -> Watch {
    Watch::WELL
}

/// There are no news.
pub fn take_news(_: Thread, _motor: u8) -> u8 {
    0
}
