//! Drivers that are told by UART: no board with this chip has them.

use crate::drivers::REGISTERS;

/// Nobody is told.
pub fn tell(_motor: u8, _values: &[u32; REGISTERS]) {}
