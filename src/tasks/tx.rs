//! The line to the sender: whole responses and reports, one after the other.
//!
//! Owned by whoever holds `Links::tx`, for as long as one line takes, so lines never mix. Call
//! [`Tx::room`] before each piece of at most [`PIECE`] bytes; it waits until the transmit ring has room.

use crate::hal::event::{Event, wait};
use crate::hal::imp::uart;
use crate::hal::serial::Outgoing;

/// Most bytes written between two calls of [`Tx::room`].
pub const PIECE: usize = 64;

/// The transmit ring's filling end.
pub struct Tx {
    ring: Outgoing,
}

impl Tx {
    /// Takes over the ring.
    pub fn new(ring: Outgoing) -> Self {
        Self { ring }
    }

    /// Waits until a piece fits.
    pub async fn room(&mut self) {
        wait(Event::Transmitted, || self.has_room().then_some(())).await;
    }

    /// Whether a piece fits now.
    pub fn has_room(&self) -> bool {
        self.ring.free() >= PIECE
    }

    /// Sends what has been put.
    pub fn flush(&mut self) {
        uart::kick();
    }
}

impl crate::protocol::Out for Tx {
    fn put(&mut self, byte: u8) {
        // Room was made by `room`; a byte beyond it is a defect that tests of `protocol` exclude.
        let _ = self.ring.push(byte);
    }

    fn put_all(&mut self, bytes: impl Iterator<Item = u8>) {
        self.ring.push_all(bytes);
    }
}
