//! USART0, 8N1 at double speed, polled.

use kerf::baud;

use super::register::Register;

const STATUS: Register = Register::at(0xC0);
const CONTROL: Register = Register::at(0xC1);
const FORMAT: Register = Register::at(0xC2);
const RATE_LOW: Register = Register::at(0xC4);
const RATE_HIGH: Register = Register::at(0xC5);
const DATA: Register = Register::at(0xC6);

// STATUS
const RXC: u8 = 1 << 7;
const TXC: u8 = 1 << 6;
const UDRE: u8 = 1 << 5;
/// The stop bit of the byte was low.
pub const FRAMING: u8 = 1 << 4;
/// Bytes before this one were lost.
pub const OVERRUN: u8 = 1 << 3;
const U2X: u8 = 1 << 1;
/// Receiver and transmitter are on. In CONTROL.
const ON: u8 = 1 << 4 | 1 << 3;
/// Eight data bits, a stop bit, no parity. In FORMAT.
const FORMAT_8N1: u8 = 6;

/// Switches the line off.
pub fn stop() {
    CONTROL.put(0);
}

/// Switches the line on, at `rate` bits a second.
pub fn start(rate: u32) {
    set_rate(rate);
    STATUS.put(U2X);
    FORMAT.put(FORMAT_8N1);
    CONTROL.put(ON);
}

/// Sets the rate, and returns the divisor that makes it.
pub fn set_rate(rate: u32) -> u16 {
    let divisor = baud::divisor(rate);
    let [low, high] = divisor.to_le_bytes();
    RATE_HIGH.put(high);
    RATE_LOW.put(low);
    divisor
}

/// Whether a byte has come.
#[inline(always)]
pub fn has_byte() -> bool {
    STATUS.get() & RXC != 0
}

/// Takes the byte that has come, with [`FRAMING`] and [`OVERRUN`]; `None` if there is none.
#[inline(always)]
pub fn take() -> Option<(u8, u8)> {
    let status = STATUS.get();
    (status & RXC != 0).then(|| (DATA.get(), status & (FRAMING | OVERRUN)))
}

/// Waits for a byte.
pub fn next() -> u8 {
    loop {
        if let Some((byte, _)) = take() {
            return byte;
        }
    }
}

/// Whether a byte may be sent.
#[inline(always)]
pub fn is_ready() -> bool {
    STATUS.get() & UDRE != 0
}

/// Sends a byte. Requires [`is_ready`].
#[inline(always)]
pub fn put(byte: u8) {
    DATA.put(byte);
    // The flag that the last bit has been sent is cleared by a one. This byte's last bit is far off.
    STATUS.put(U2X | TXC);
}

/// Waits until there is room, and sends a byte.
#[inline(never)]
pub fn send(byte: u8) {
    while !is_ready() {}
    put(byte);
}

/// Waits until the last bit of what was sent has been sent.
pub fn flush() {
    while STATUS.get() & TXC == 0 {}
}
