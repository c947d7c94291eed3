//! The SD card's lines: an SPI of the chip, and the pin that selects the card. Thread mode.
//!
//! The pins are data of the board, so the registers of the SPI are used instead of `embassy-rp`'s driver, whose pins are
//! types. Nothing else is on the SPI. On a board without a card the input line reads high.

use embassy_rp::pac::{SPI0, SPI1, spi::Spi};

use super::gpio::{self, Unit};
use crate::boards::{ACTIVE, SdCard};
use crate::hal::{Boot, Thread};

const _: () = assert!(
    match &ACTIVE.card {
        Some(card) => !gpio::is_behind(card.select),
        None => true,
    },
    "the pin that selects the card is one of the chip"
);

/// The divider of the clock before the card is initialized, and then: 252 kHz and 12.8 MHz at 128 MHz.
const SLOW: (u8, u8) = (254, 1);
const FAST: (u8, u8) = (2, 4);
/// Bytes that the SPI can hold.
const FIFO: usize = 8;
/// Eight bits to a byte.
const BITS: u8 = 7;

/// Returns the SPI that has the card's pins (RP2040 data sheet, 2.19.2).
fn spi(card: &SdCard) -> Spi {
    if card.bus[0].bit / 8 % 2 == 0 { SPI0 } else { SPI1 }
}

/// Connects the pins, with no card selected.
pub(super) fn start(_: &Boot) {
    let Some(card) = &ACTIVE.card else { return };
    gpio::set(card.select, true);
    gpio::output(card.select);
    let [clock, to, from] = card.bus;
    gpio::connect_output(clock, Unit::Spi);
    gpio::connect_output(to, Unit::Spi);
    // Without a card the line would float.
    gpio::connect_pulled(from, Unit::Spi);
    set_clock(false);
}

/// Selects the card.
pub fn select(_: Thread) {
    if let Some(card) = &ACTIVE.card {
        gpio::set(card.select, false);
    }
}

/// Deselects the card, then sends one more byte, during which the card releases its data line.
pub fn release(thread: Thread) {
    if let Some(card) = &ACTIVE.card {
        gpio::set(card.select, true);
    }
    exchange(thread, 0xFF);
}

/// Sets the clock: 12.8 MHz if `fast`, else 252 kHz.
pub fn set_fast(_: Thread, fast: bool) {
    set_clock(fast);
}

fn set_clock(fast: bool) {
    let Some(card) = &ACTIVE.card else { return };
    let (prescaler, divider) = if fast { FAST } else { SLOW };
    let spi = spi(card);
    spi.cr1().write(|w| w.set_sse(false));
    spi.cpsr().write(|w| w.set_cpsdvsr(prescaler));
    spi.cr0().write(|w| {
        w.set_dss(BITS);
        w.set_scr(divider);
    });
    spi.cr1().write(|w| w.set_sse(true));
}

/// Sends a byte and returns the byte received meanwhile.
pub fn exchange(_: Thread, byte: u8) -> u8 {
    let Some(card) = &ACTIVE.card else { return 0xFF };
    let spi = spi(card);
    spi.dr().write(|w| w.set_data(byte.into()));
    while !spi.sr().read().rne() {}
    spi.dr().read().data() as u8
}

/// Reads a block. Bytes follow each other without a pause, because the SPI holds eight of them.
pub fn read(_: Thread, block: &mut [u8; 512]) {
    let Some(card) = &ACTIVE.card else { return block.fill(0xFF) };
    let spi = spi(card);
    let send = |_| spi.dr().write(|w| w.set_data(0xFF));
    (0..FIFO).for_each(send);
    let mut left = block.len() - FIFO;
    for place in block {
        while !spi.sr().read().rne() {}
        *place = spi.dr().read().data() as u8;
        if left > 0 {
            left -= 1;
            send(0);
        }
    }
}

/// Whether another device waits for the lines: never.
pub fn is_wanted(_: Thread) -> bool {
    false
}
