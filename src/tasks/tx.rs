//! The transmitter of a port: whole responses and reports, one after the other.
//!
//! Owned by the task that holds `Port::tx`, for the time of one line, so that lines never mix. Call [`Tx::room`] before
//! each piece of at most [`PIECE`] bytes; it waits until the transmit ring has room.

use crate::hal::Thread;
use crate::hal::event::wait_transmitted;
use crate::hal::serial::{Outgoing, TX_RING};
use crate::hal::uart;
use crate::progmem::Plain;
use crate::protocol::Checksum;

/// Most bytes written between two calls of [`Tx::room`].
pub const PIECE: usize = 64;
/// The most bytes of a report that wait to leave when its next piece is put. An answer that comes in between waits for
/// these bytes: 2 ms at 115,200 baud.
const AHEAD: usize = 24;
/// The bits of two bytes, times the milliseconds of a second.
const TWO_BYTES_MS: u32 = 20 * 1_000;

/// The transmit ring's filling end.
pub struct Tx {
    thread: Thread,
    ring: Outgoing,
    port: u8,
    /// Bits a second.
    rate: u32,
    /// The checksum of the response under way, if the response ends with one.
    sum: Option<Checksum>,
}

impl Tx {
    /// Takes over the ring of a port whose line runs at `rate` bits a second.
    pub fn new(thread: Thread, ring: Outgoing, port: u8, rate: u32) -> Self {
        Self { thread, ring, port, rate, sum: None }
    }

    /// Waits until the next piece of a report may be put.
    pub fn room(&mut self) -> impl Future<Output = ()> {
        let is_due = || self.is_low().then_some(());
        wait_transmitted(self.thread, self.port, is_due)
    }

    /// Whether the next piece of a report may be put now.
    pub fn is_low(&self) -> bool {
        self.ring.free() >= TX_RING - 1 - AHEAD
    }

    /// Whether a piece fits now.
    pub fn has_room(&self) -> bool {
        self.ring.free() >= PIECE
    }

    /// Sends what has been put.
    pub fn flush(&mut self) {
        uart::kick(self.thread.level(), self.port);
    }

    /// Continues at `rate` bits a second. All queued bytes must have been sent at the old rate. Bytes received
    /// meanwhile may be damaged.
    pub fn set_rate(&mut self, rate: u32) {
        uart::set_rate(self.thread, self.port, rate);
        self.rate = rate;
    }

    /// Whether the ring is empty.
    pub fn is_empty(&self) -> bool {
        self.ring.free() == TX_RING - 1
    }

    /// Returns how long, ms, what has been put may take to leave after the ring is empty. The transmitter holds two
    /// bytes more. It has a flag for their end, but that flag may be left from a pause in the middle of the line; the
    /// time of two bytes is certain.
    pub fn last_ms(&self) -> u16 {
        (TWO_BYTES_MS / self.rate) as u16 + 2
    }

    /// Puts bytes up to the ring's end. Returns the bytes that are left.
    #[inline(always)]
    fn fill(&mut self, bytes: Plain) -> Plain {
        let count = self.ring.fill(|slots| bytes.copy(slots));
        bytes.behind(count)
    }

    /// Puts the bytes that are left behind the ring's end: there is room at its beginning.
    #[inline(never)]
    fn fill_again(&mut self, bytes: Plain) {
        self.fill(bytes);
    }

    /// Takes what has been put behind a slot of the ring into the checksum, if the response under way ends with one.
    #[inline(always)]
    fn sum_behind(&mut self, slot: u8) {
        if let Some(sum) = &mut self.sum {
            add_all(&self.ring, slot, sum);
        }
    }
}

/// Takes what has been put behind a slot of the ring into a checksum.
#[inline(never)]
fn add_all(ring: &Outgoing, slot: u8, sum: &mut Checksum) {
    let mut all = *sum;
    ring.behind(slot).for_each(|byte| all.add(*byte));
    *sum = all;
}

impl crate::protocol::Out for Tx {
    fn put(&mut self, byte: u8) {
        let before = self.ring.filled();
        // Room was made by `room`; a byte beyond it is a defect that tests of `protocol` exclude.
        let _ = self.ring.push(byte);
        self.sum_behind(before);
    }

    // Not inlined, because it is called in many places.
    #[inline(never)]
    fn put_plain(&mut self, bytes: Plain) {
        let before = self.ring.filled();
        let left = self.fill(bytes);
        if !left.is_empty() {
            self.fill_again(left);
        }
        self.sum_behind(before);
        // The next computation takes longer than sending these bytes.
        uart::kick(self.thread.level(), self.port);
    }

    fn put_all(&mut self, bytes: impl Iterator<Item = u8>) {
        let before = self.ring.filled();
        self.ring.push_all(bytes);
        self.sum_behind(before);
    }

    fn begin_sum(&mut self) {
        self.sum = Some(Checksum::default());
    }

    fn take_sum(&mut self) -> u16 {
        self.sum.take().unwrap_or_default().value()
    }
}
