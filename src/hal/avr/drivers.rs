//! Drivers that are set up by UART: no board with this chip has any.

use crate::drivers::REGISTERS;

/// Does nothing.
pub fn tell(_motor: u8, _values: &[u32; REGISTERS]) {}
