//! The SD card's lines: SPI, and the pin that selects it. Thread mode.
//!
//! While the card is selected nobody else uses SPI ([`is_free`]).

use super::{gpio, spi};
use crate::boards::{ACTIVE, SdCard};
use crate::hal::Thread;
use crate::hal::byte::SharedByte;

static TAKEN: SharedByte = SharedByte::new(0);
static WANTED: SharedByte = SharedByte::new(0);
static FAST: SharedByte = SharedByte::new(0);

/// Selects the card.
#[small]
pub fn select(thread: Thread) {
    TAKEN.set(1);
    spi::set_clock(thread, if FAST.get() != 0 { spi::Clock::Mhz4 } else { spi::Clock::Khz250 });
    if let Some(SdCard { select, .. }) = ACTIVE.card {
        gpio::set(select, false);
    }
}

/// Deselects the card, then sends one more byte, during which the card releases its data line.
#[small]
pub fn release(thread: Thread) {
    if let Some(SdCard { select, .. }) = ACTIVE.card {
        gpio::set(select, true);
    }
    spi::exchange(thread, 0xFF);
    TAKEN.set(0);
}

/// Whether the lines are free for another device. If they are not, records that a device waits for them: see
/// [`is_wanted`].
pub(super) fn is_free() -> bool {
    WANTED.set(TAKEN.get());
    TAKEN.get() == 0
}

/// Whether another device waits for the lines.
pub fn is_wanted(_: Thread) -> bool {
    WANTED.get() != 0
}

/// Sets the clock from the next [`select`] on: 4 MHz if `fast`, else 250 kHz.
pub fn set_fast(_: Thread, fast: bool) {
    FAST.set(fast.into());
}

/// Sends a byte and returns the byte received meanwhile.
#[small]
pub fn exchange(thread: Thread, byte: u8) -> u8 {
    spi::exchange(thread, byte)
}

/// Reads a block. Cost: 30 cycles a byte.
#[inline(never)]
pub fn read(thread: Thread, block: &mut [u8; 512]) {
    for byte in block {
        *byte = spi::exchange(thread, 0xFF);
    }
}
