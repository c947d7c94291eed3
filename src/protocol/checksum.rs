//! The checksum of a response for senders that count characters: TinyG's.
//!
//! h = 31 h + byte, modulo 2^32, over every byte from the first brace up to the comma before the checksum; what is told is
//! h modulo 9999. Cost on AVR: 30 cycles a byte.

use crate::hal::arithmetic::times;

/// A checksum being made.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct Checksum(u32);

impl Checksum {
    /// Takes a byte.
    pub fn add(&mut self, byte: u8) {
        self.0 = times(self.0, 31).wrapping_add(byte.into());
    }

    /// What it has come to.
    pub fn value(self) -> u16 {
        (self.0 % 9_999) as u16
    }
}
