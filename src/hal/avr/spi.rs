//! SPI as a master: one byte out, one byte in.
//!
//! Owned by thread mode; no interrupt. An exchange of a byte waits for it: 8 clocks of [`Clock`], and a few cycles. MISO has a pull-up, so that
//! of nothing ones are read. On a board without anything on SPI nothing happens.

use super::gpio;
use crate::boards::{ACTIVE, SPI};

const SPCR: *mut u8 = 0x4C as *mut u8;
const SPSR: *mut u8 = 0x4D as *mut u8;
const SPDR: *mut u8 = 0x4E as *mut u8;
/// On, as master, with mode 0.
const MASTER: u8 = 1 << 6 | 1 << 4;
const DONE: u8 = 1 << 7;
/// Looks until a byte counts as sent whatever the chip says: the slowest clock takes half as many.
const PATIENCE: u16 = 400;

/// How fast bits go.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Clock {
    /// 4 MHz: 4 cycles a bit.
    Mhz4 = 0b00,
    /// A MHz: 16 cycles a bit.
    Mhz1 = 0b01,
    /// 250 kHz: 64 cycles a bit.
    Khz250 = 0b10,
}

/// Makes outputs of the pins. Start-up.
pub fn start() {
    if !ACTIVE.has_spi() {
        return;
    }
    let [select, clock, out, input] = SPI;
    gpio::high(select);
    gpio::output(select);
    gpio::output(clock);
    gpio::output(out);
    gpio::high(input);
}

/// Has the exchanges that follow use a clock. Thread mode.
pub fn set_clock(clock: Clock) {
    // SAFETY: the registers are this module's.
    unsafe { SPCR.write_volatile(MASTER | clock as u8) };
}

/// Sends a byte; what came meanwhile. Thread mode. Cost: 8 bits and 30 cycles.
#[inline(never)]
#[small]
pub fn exchange(byte: u8) -> u8 {
    // SAFETY: the registers are this module's.
    unsafe {
        SPDR.write_volatile(byte);
        for _ in 0..PATIENCE {
            if SPSR.read_volatile() & DONE != 0 {
                break;
            }
        }
        SPDR.read_volatile()
    }
}
