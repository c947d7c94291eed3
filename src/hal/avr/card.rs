//! The SD card's lines: SPI, and the pin that selects it. Thread mode.
//!
//! While the card is selected nobody else speaks on SPI ([`is_free`]).

use super::{gpio, spi};
use crate::boards::ACTIVE;
use crate::hal::byte::SharedByte;

static TAKEN: SharedByte = SharedByte::new(0);
static WANTED: SharedByte = SharedByte::new(0);
static FAST: SharedByte = SharedByte::new(0);

/// Selects the card.
#[small]
pub fn select() {
    TAKEN.set(1);
    spi::set_clock(if FAST.get() != 0 { spi::Clock::Mhz4 } else { spi::Clock::Khz250 });
    if let Some(pin) = ACTIVE.card {
        gpio::set(pin, false);
    }
}

/// Lets it go, with a byte more in which it lets go of the line.
#[small]
pub fn release() {
    if let Some(pin) = ACTIVE.card {
        gpio::set(pin, true);
    }
    spi::exchange(0xFF);
    TAKEN.set(0);
}

/// Whether the lines are free for somebody else, who has to wait until the card is let go otherwise.
pub(super) fn is_free() -> bool {
    WANTED.set(TAKEN.get());
    TAKEN.get() == 0
}

/// Whether somebody waits for the lines.
pub fn is_wanted() -> bool {
    WANTED.get() != 0
}

/// 4 MHz, or 250 kHz, from the next time on that it is selected.
pub fn set_fast(fast: bool) {
    FAST.set(fast.into());
}

/// Sends a byte; what came meanwhile.
#[small]
pub fn exchange(byte: u8) -> u8 {
    spi::exchange(byte)
}

/// Reads a block. Cost: 30 cycles a byte.
#[inline(never)]
pub fn read(block: &mut [u8; 512]) {
    for byte in block {
        *byte = spi::exchange(0xFF);
    }
}
