//! USART0: bytes between the serial line and two rings.
//!
//! The receive interrupt picks real-time characters off wherever they stand and never queues them.
//! Where bytes were lost, because the ring was full or the hardware overran, the next byte that fits is
//! replaced by [`LOSS`]: it marks the damaged line, which the reader refuses.

use core::arch::asm;

use crate::baud;
use crate::hal::byte::SharedByte;
use crate::hal::event::Event;
use crate::hal::ring::Ring;
use crate::hal::serial::{LOSS, LOSS_AT_END, Outgoing, RING, Received};
use crate::realtime;

type ByteRing = Ring<u8, RING>;

static RX: ByteRing = Ring::new();
static TX: ByteRing = Ring::new();
/// Bytes were lost since the last one queued. The receive interrupt's own.
static LOST: SharedByte = SharedByte::new(0);
static REALTIME: SharedByte = SharedByte::new(0);

const UCSR0B: *mut u8 = 0xC1 as *mut u8;
const RXCIE: u8 = 1 << 7;
const UDRIE: u8 = 1 << 5;
const RXEN: u8 = 1 << 4;
const TXEN: u8 = 1 << 3;

/// Starts the line at `rate` bits a second, 8N1. Before interrupts are on; `None` after the first time.
pub fn start(rate: u32) -> Option<(Received, Outgoing)> {
    let (rx_in, rx_out) = RX.split()?;
    let (tx_in, tx_out) = TX.split()?;
    // From now on those two ends are the interrupts', which push and pop in assembly.
    let (_, _) = (rx_in, tx_out);
    let uart = super::peripherals().USART0;
    uart.ubrr0().write(|w| w.set(baud::divisor(rate)));
    uart.ucsr0a().write(|w| w.u2x0().set_bit());
    // SAFETY: start-up.
    unsafe { UCSR0B.write_volatile(RXCIE | RXEN | TXEN) };
    Some((rx_out, tx_in))
}

/// Goes on at `rate` bits a second. A byte on the line meanwhile, in either direction, is spoilt. Thread
/// mode.
pub fn set_rate(rate: u32) {
    super::peripherals().USART0.ubrr0().write(|w| w.set(baud::divisor(rate)));
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

/// USART0_RX: takes a byte.
///
/// Interrupts are off for 60 cycles at most. They are on again while registers are restored: the data
/// register has been read, so this interrupt comes again for the next byte only, and nests three deep
/// at most.
#[unsafe(no_mangle)]
extern "C" fn __vector_25() -> ! {
    // SAFETY: every register it changes is restored, and it returns by `reti`. It is the only producer
    // of the receive ring and the only one to touch `LOST` and to set bits of `REALTIME`.
    unsafe {
        asm!(
            "push r24",
            "in   r24, 0x3F",
            "push r24",
            "push r30",
            "push r31",
            // The status goes with the byte that is read after it.
            "lds  r31, 0xC0",
            "lds  r24, 0xC6",
            // Letters, digits and dots, the most of it, are no real-time characters.
            "cpi  r24, 0x26",
            "brlo 5f",
            "cpi  r24, 0x7E",
            "breq 12f",
            // Queue it. Frame error or overrun: something was lost.
            "1:",
            "andi r31, 0x18",
            "lds  r30, {lost}",
            "or   r31, r30",
            "brne 4f",
            "2:",
            "lds  r30, {rx} + {head}",
            "inc  r30",
            "lds  r31, {rx} + {tail}",
            "cp   r30, r31",
            "breq 8f",
            "sts  {rx} + {head}, r30",
            "ldi  r31, 0",
            "subi r30, lo8(-({rx} + {slots}))",
            "sbci r31, hi8(-({rx} + {slots}))",
            // What follows `sei` comes before any other interrupt.
            "sei",
            "st   Z, r24",
            "sbi  0x1E, {received}",
            "3:",
            "pop  r31",
            "pop  r30",
            "pop  r24",
            "out  0x3F, r24",
            "pop  r24",
            "reti",
            "12:",
            "ldi  r30, {resume}",
            "rjmp 16f",
            // Bytes were lost before this one: a mark takes its place.
            "4:",
            "cpi  r24, 0x0A",
            "breq 40f",
            "cpi  r24, 0x0D",
            "breq 40f",
            "ldi  r24, {loss}",
            "rjmp 41f",
            "40:",
            "ldi  r24, {loss_at_end}",
            "41:",
            "ldi  r30, 0",
            "sts  {lost}, r30",
            "rjmp 2b",
            // Up to a percent sign.
            "5:",
            "cpi  r24, 0x20",
            "brsh 6f",
            "cpi  r24, 0x0A",
            "breq 1b",
            "cpi  r24, 0x18",
            "breq 13f",
            "cpi  r24, 0x05",
            "breq 14f",
            "cpi  r24, 0x04",
            "breq 15f",
            "rjmp 1b",
            // From blank to percent: special are 0x21 and 0x25, those of odd number with bit 1 clear.
            "6:",
            "sbrs r24, 0",
            "rjmp 1b",
            "sbrc r24, 1",
            "rjmp 1b",
            "sbrc r24, 2",
            "rjmp 11f",
            "rjmp 10f",
            // The ring is full.
            "8:",
            "ldi  r30, 1",
            "sts  {lost}, r30",
            "sei",
            "sbi  0x1E, {received}",
            "rjmp 3b",
            "10:",
            "ldi  r30, {hold}",
            "rjmp 16f",
            "11:",
            "ldi  r30, {flush}",
            "rjmp 16f",
            "13:",
            "ldi  r30, {reset}",
            "rjmp 16f",
            "14:",
            "ldi  r30, {enquiry}",
            "rjmp 16f",
            "15:",
            "ldi  r30, {kill}",
            "16:",
            "andi r31, 0x18",
            "breq 17f",
            "sts  {lost}, r31",
            "17:",
            "lds  r31, {realtime}",
            "or   r31, r30",
            "sts  {realtime}, r31",
            "sei",
            "sbi  0x1E, {special}",
            "rjmp 3b",
            rx = sym RX,
            head = const ByteRing::HEAD,
            tail = const ByteRing::TAIL,
            slots = const ByteRing::SLOTS,
            lost = sym LOST,
            realtime = sym REALTIME,
            loss = const LOSS,
            loss_at_end = const LOSS_AT_END,
            received = const Event::Received as u8,
            special = const Event::Realtime as u8,
            hold = const realtime::HOLD,
            resume = const realtime::RESUME,
            flush = const realtime::FLUSH,
            reset = const realtime::RESET,
            kill = const realtime::KILL,
            enquiry = const realtime::ENQUIRY,
            options(noreturn),
        );
    }
}

/// USART0_UDRE: sends a byte, or stops asking when there is none.
///
/// Interrupts are off for 40 cycles, and on again while registers are restored. It may come again then
/// at once, for the transmitter holds two bytes; it nests no deeper.
#[unsafe(no_mangle)]
extern "C" fn __vector_26() -> ! {
    // SAFETY: every register it changes is restored, and it returns by `reti`. It is the only consumer
    // of the transmit ring.
    unsafe {
        asm!(
            "push r24",
            "in   r24, 0x3F",
            "push r24",
            "push r30",
            "push r31",
            "lds  r30, {tx} + {tail}",
            "lds  r31, {tx} + {head}",
            "cp   r30, r31",
            "breq 2f",
            "inc  r30",
            "sts  {tx} + {tail}, r30",
            "ldi  r31, 0",
            "subi r30, lo8(-({tx} + {slots}))",
            "sbci r31, hi8(-({tx} + {slots}))",
            "ld   r24, Z",
            "sts  0xC6, r24",
            "1:",
            "sbi  0x1E, {transmitted}",
            "sei",
            "pop  r31",
            "pop  r30",
            "pop  r24",
            "out  0x3F, r24",
            "pop  r24",
            "reti",
            "2:",
            "ldi  r24, {quiet}",
            "sts  0xC1, r24",
            "rjmp 1b",
            tx = sym TX,
            head = const ByteRing::HEAD,
            tail = const ByteRing::TAIL,
            slots = const ByteRing::SLOTS,
            quiet = const RXCIE | RXEN | TXEN,
            transmitted = const Event::Transmitted as u8,
            options(noreturn),
        );
    }
}
