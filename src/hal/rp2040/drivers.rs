//! TMC2209 drivers on one line of UART1. Their settings are sent again and again, because a driver forgets them when
//! the motors' supply fails.
//!
//! Thread mode calls it each millisecond. It writes a datagram of 8 bytes to the UART's FIFO each [`EVERY_MS`], or each
//! millisecond while a register has a new value. Nothing waits, and nothing is read: a driver that receives nothing
//! works as its pins select. Cost: 300 cycles a datagram.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_rp::pac::UART1;

use super::gpio::{Unit, connect, connect_pulled};
use crate::boards::{ACTIVE, MOTORS};
use crate::drivers::{FIRST, REGISTERS, datagram};

/// Bits a second. The drivers detect the rate.
const RATE: u32 = 115_200;
/// Milliseconds from one datagram to the next while no value is new.
const EVERY_MS: u32 = 4;

/// The values of the registers, motor 1 first. Only thread mode uses them.
static VALUES: [AtomicU32; MOTORS * REGISTERS] = first();
/// The values that are new, as bits.
static NEW: AtomicU32 = AtomicU32::new(0);
const _: () = assert!(MOTORS * REGISTERS <= 32);

const fn first() -> [AtomicU32; MOTORS * REGISTERS] {
    let mut values = [const { AtomicU32::new(0) }; MOTORS * REGISTERS];
    let mut at = 0;
    while at < values.len() {
        values[at] = AtomicU32::new(FIRST[at % REGISTERS]);
        at += 1;
    }
    values
}

/// Connects the UART. Start-up.
pub(super) fn start() {
    let Some(drivers) = ACTIVE.drivers else { return };
    connect(drivers.tx, Unit::Uart);
    connect_pulled(drivers.rx, Unit::Uart);
    let divisor = embassy_rp::clocks::clk_peri_freq() * 4 / RATE;
    UART1.uartibrd().write(|w| w.set_baud_divint((divisor >> 6) as u16));
    UART1.uartfbrd().write(|w| w.set_baud_divfrac((divisor & 0x3F) as u8));
    UART1.uartlcr_h().write(|w| {
        w.set_wlen(3);
        w.set_fen(true);
    });
    UART1.uartcr().write(|w| {
        w.set_uarten(true);
        w.set_txe(true);
    });
}

/// Sets the values of the registers of a motor's driver. Thread mode.
pub fn tell(motor: u8, values: &[u32; REGISTERS]) {
    let first = usize::from(motor) * REGISTERS;
    for (at, value) in (first..).zip(values) {
        let Some(told) = VALUES.get(at) else { return };
        if told.load(Ordering::Relaxed) != *value {
            told.store(*value, Ordering::Relaxed);
            NEW.store(NEW.load(Ordering::Relaxed) | 1 << at, Ordering::Relaxed);
        }
    }
}

/// Sends the next datagram, if it is time for one. Thread mode, each millisecond.
pub(super) fn look(now_ms: u32) {
    let Some(drivers) = ACTIVE.drivers else { return };
    let new = NEW.load(Ordering::Relaxed);
    if new == 0 && !now_ms.is_multiple_of(EVERY_MS) || !UART1.uartfr().read().txfe() {
        return;
    }
    let at = match new {
        0 => (now_ms / EVERY_MS) as usize % (drivers.addresses.len() * REGISTERS),
        new => new.trailing_zeros() as usize,
    };
    NEW.store(new & !(1 << at), Ordering::Relaxed);
    let address = drivers.addresses.get(at / REGISTERS);
    let (Some(address), Some(value)) = (address, VALUES.get(at)) else { return };
    for byte in datagram(*address, at % REGISTERS, value.load(Ordering::Relaxed)) {
        UART1.uartdr().write(|w| w.set_data(byte));
    }
}
