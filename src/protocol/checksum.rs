//! The checksum of a response for senders that count characters, as TinyG computes it.
//!
//! h = 31 h + byte, modulo 2^32, over every byte from the first brace up to the comma before the checksum. The
//! response tells h modulo 9999. Cost on AVR: 30 cycles a byte.

use crate::hal::arithmetic::times;

/// A running checksum.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct Checksum(u32);

impl Checksum {
    /// Adds a byte.
    pub fn add(&mut self, byte: u8) {
        self.0 = times(self.0, 31).wrapping_add(byte.into());
    }

    /// Returns the checksum of the bytes added so far.
    pub fn value(self) -> u16 {
        (self.0 % 9_999) as u16
    }
}
