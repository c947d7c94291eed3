//! TMC2209 drivers on one line of UART1: what they are told, again and again, for they forget it when the motors' supply fails.
//!
//! Called by thread mode each millisecond. A datagram of 8 bytes goes to the UART's FIFO each [`EVERY_MS`]; nothing waits, and nothing is read: a driver that does not hear keeps what its pins
//! say. Cost: 300 cycles a datagram.
//!
//! Registers and datagrams: TMC2209 data sheet, 4.1 (UART datagram structure), 5.1 and 5.5 (register map).

use embassy_rp::pac::UART1;

use super::gpio::{Unit, connect, connect_pulled};
use crate::boards::{ACTIVE, Tmc2209};

/// Bits a second. Drivers find the rate out by themselves.
const RATE: u32 = 115_200;
/// Milliseconds from a datagram to the next.
const EVERY_MS: u32 = 4;

/// GCONF: by UART, not by pins; microsteps from CHOPCONF; pulses filtered; stealthChop; the current not from the pin VREF.
const GCONF: (u8, u32) = (0x00, 1 << 6 | 1 << 7 | 1 << 8);
/// CHOPCONF: 8 microsteps, made 256 by the driver; the low range of the current; as after a reset otherwise.
const CHOPCONF: (u8, u32) = (0x6C, 1 << 28 | 5 << 24 | 1 << 17 | 1 << 16 | 0x53);
/// IHOLD_IRUN: an eighth of a second and more from the current of motion to that of rest.
const IHOLD_IRUN: u8 = 0x10;
const HOLD_DELAY: u32 = 8 << 16;

/// Registers that each driver is told.
const REGISTERS: usize = 3;

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

/// Sends a datagram, if it is time for one. Thread mode, each millisecond.
pub(super) fn look(now_ms: u32) {
    let Some(drivers) = ACTIVE.drivers else { return };
    if !now_ms.is_multiple_of(EVERY_MS) || !UART1.uartfr().read().txfe() {
        return;
    }
    let turn = (now_ms / EVERY_MS) as usize % (drivers.addresses.len() * REGISTERS);
    let Some(address) = drivers.addresses.get(turn / REGISTERS) else { return };
    for byte in datagram(*address, register(&drivers, turn % REGISTERS)) {
        UART1.uartdr().write(|w| w.set_data(byte));
    }
}

/// A register and its value.
fn register(drivers: &Tmc2209, number: usize) -> (u8, u32) {
    match number {
        0 => GCONF,
        1 => CHOPCONF,
        _ => {
            let currents = u32::from(drivers.run) << 8 | u32::from(drivers.hold);
            (IHOLD_IRUN, HOLD_DELAY | currents)
        }
    }
}

/// What writes a register.
fn datagram(address: u8, (register, value): (u8, u32)) -> [u8; 8] {
    let [a, b, c, d] = value.to_be_bytes();
    let mut datagram = [0x05, address, register | 0x80, a, b, c, d, 0];
    datagram[7] = checksum(&datagram[..7]);
    datagram
}

/// CRC of x^8 + x^2 + x + 1, the lowest bit of each byte first.
fn checksum(bytes: &[u8]) -> u8 {
    let mut crc = 0u8;
    for byte in bytes {
        for bit in 0..8 {
            let over = (crc >> 7) ^ (byte >> bit & 1);
            crc = crc << 1 ^ if over != 0 { 0x07 } else { 0 };
        }
    }
    crc
}
