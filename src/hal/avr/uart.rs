//! USART0: bytes between the serial line and two rings.
//!
//! The receive interrupt picks real-time characters off wherever they stand and never queues them.
//! Where bytes were lost, because the ring was full or the hardware overran, the next byte that fits is
//! replaced by [`LOSS`]: it marks the damaged line, which the reader refuses.

use core::cell::UnsafeCell;

use super::flags;
use crate::boards::ACTIVE;
use crate::hal::byte::SharedByte;
use crate::hal::event::Event;
use crate::hal::ring::{Consumer, Producer, Ring};
use crate::realtime;

/// Size of each ring.
pub const RING: usize = 256;

/// What stands where bytes were lost. No line of text has it.
pub const LOSS: u8 = 0;
/// The same, where the byte that is replaced ended its line.
pub const LOSS_AT_END: u8 = 1;

#[inline(always)]
fn loss_mark(byte: u8) -> u8 {
    if byte == b'\n' || byte == b'\r' { LOSS_AT_END } else { LOSS }
}

/// Bytes received.
pub type Received = Consumer<u8, RING>;
/// Bytes to send. Call [`kick`] after filling it.
pub type Outgoing = Producer<u8, RING>;

static RX: Ring<u8, RING> = Ring::new();
static TX: Ring<u8, RING> = Ring::new();
/// Bytes were lost since the last one queued. The receive interrupt's own.
static LOST: SharedByte = SharedByte::new(0);
static REALTIME: SharedByte = SharedByte::new(0);

/// What an interrupt owns of the rings.
struct Owned<T>(UnsafeCell<Option<T>>);

// SAFETY: written at start-up before interrupts are on, then touched by one interrupt only.
unsafe impl<T> Sync for Owned<T> {}

static RX_END: Owned<Producer<u8, RING>> = Owned(UnsafeCell::new(None));
static TX_END: Owned<Consumer<u8, RING>> = Owned(UnsafeCell::new(None));

const UCSR0B: *mut u8 = 0xC1 as *mut u8;
const RXCIE: u8 = 1 << 7;
const UDRIE: u8 = 1 << 5;
const RXEN: u8 = 1 << 4;
const TXEN: u8 = 1 << 3;

/// Starts the line at `baud`, 8N1. Before interrupts are on; `None` after the first time.
pub fn start(baud: u32) -> Option<(Received, Outgoing)> {
    let (rx_in, rx_out) = RX.split()?;
    let (tx_in, tx_out) = TX.split()?;
    // SAFETY: interrupts are off, nobody else looks.
    unsafe {
        *RX_END.0.get() = Some(rx_in);
        *TX_END.0.get() = Some(tx_out);
    }
    let uart = super::peripherals().USART0;
    uart.ubrr0().write(|w| w.set(divisor(baud)));
    uart.ucsr0a().write(|w| w.u2x0().set_bit());
    // SAFETY: start-up.
    unsafe { UCSR0B.write_volatile(RXCIE | RXEN | TXEN) };
    Some((rx_out, tx_in))
}

/// The divisor nearest to a baud rate, at double speed (data sheet, table 22-1).
const fn divisor(baud: u32) -> u16 {
    let eighth = ACTIVE.clock_hz / 8;
    ((eighth + baud / 2) / baud - 1) as u16
}

/// Sends what the ring holds.
pub fn kick() {
    // SAFETY: the register has two values after start-up, written whole.
    unsafe { UCSR0B.write_volatile(RXCIE | UDRIE | RXEN | TXEN) };
}

/// Whether bytes have been lost since the last one queued: a mark is still to come.
pub fn losing() -> bool {
    LOST.get() != 0
}

/// The real-time characters since the last call, as bits (see [`realtime`]).
pub fn take_realtime() -> u8 {
    avr_device::interrupt::free(|_| {
        let bits = REALTIME.get();
        REALTIME.set(0);
        bits
    })
}

#[avr_device::interrupt(atmega2560)]
fn USART0_RX() {
    const UCSR0A: *const u8 = 0xC0 as *const u8;
    const UDR0: *const u8 = 0xC6 as *const u8;
    const DATA_OVERRUN: u8 = 1 << 3;
    const FRAME_ERROR: u8 = 1 << 4;
    // SAFETY: the status must be read before the data; reading them has no other reader.
    let (status, byte) = unsafe { (UCSR0A.read_volatile(), UDR0.read_volatile()) };
    let special = realtime::bit(byte);
    if special != 0 {
        REALTIME.set(REALTIME.get() | special);
        flags::set(Event::Realtime);
        return;
    }
    let lost = LOST.get() != 0 || status & (DATA_OVERRUN | FRAME_ERROR) != 0;
    let byte = if lost { loss_mark(byte) } else { byte };
    // SAFETY: this interrupt owns it, and does not nest.
    if let Some(ring) = unsafe { &mut *RX_END.0.get() } {
        LOST.set(u8::from(ring.push(byte).is_err()));
    }
    flags::set(Event::Received);
}

#[avr_device::interrupt(atmega2560)]
fn USART0_UDRE() {
    const UDR0: *mut u8 = 0xC6 as *mut u8;
    // SAFETY: this interrupt owns it, and does not nest.
    let byte = match unsafe { &mut *TX_END.0.get() } {
        Some(ring) => ring.pop(),
        None => None,
    };
    // SAFETY: the data register is this interrupt's alone; the control register is written whole.
    unsafe {
        match byte {
            Some(byte) => UDR0.write_volatile(byte),
            None => UCSR0B.write_volatile(RXCIE | RXEN | TXEN),
        }
    }
    flags::set(Event::Transmitted);
}
