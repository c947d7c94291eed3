//! SPI as a master: one byte out, one byte in.
//!
//! Owned by thread mode; no interrupt. An exchange waits for its byte: 8 clocks of [`Clock`], and a few cycles. MISO
//! has a pull-up, so ones are read when nothing is connected. On a board without anything on SPI nothing happens.

use super::gpio;
use crate::boards::{ACTIVE, SPI};
use crate::hal::{Boot, Thread};

const SPCR: *mut u8 = 0x4C as *mut u8;
const SPSR: *mut u8 = 0x4D as *mut u8;
const SPDR: *mut u8 = 0x4E as *mut u8;
/// Switched on, as master, with mode 0.
const MASTER: u8 = 1 << 6 | 1 << 4;
const DONE: u8 = 1 << 7;
/// Timeout of an exchange, in polls of its end. The slowest clock takes half as many.
const PATIENCE: u16 = 400;

/// The clock of SPI.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Clock {
    /// 4 MHz: 4 cycles a bit.
    Mhz4 = 0b00,
    /// 1 MHz: 16 cycles a bit.
    Mhz1 = 0b01,
    /// 250 kHz: 64 cycles a bit.
    Khz250 = 0b10,
}

/// Sets the pins up.
pub fn start(boot: &Boot) {
    if !ACTIVE.has_spi() {
        return;
    }
    let [select, clock, out, input] = SPI;
    gpio::high(select);
    gpio::output(boot.exclusive(), select);
    gpio::output(boot.exclusive(), clock);
    gpio::output(boot.exclusive(), out);
    gpio::high(input);
}

/// Sets the clock of the exchanges that follow.
pub fn set_clock(_: Thread, clock: Clock) {
    // SAFETY: the registers are this module's.
    unsafe { SPCR.write_volatile(MASTER | clock as u8) };
}

/// Sends a byte and returns the byte received meanwhile. Cost: 8 bits and 30 cycles.
#[inline(never)]
#[small]
pub fn exchange(_: Thread, byte: u8) -> u8 {
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
