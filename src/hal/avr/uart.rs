//! USART0: bytes between the serial line and two rings.
//!
//! The receive interrupt picks real-time characters off wherever they stand and never queues them.
//! Where bytes are lost, because the ring was full or the hardware overran, a mark says so to the
//! reader: see [`serial`](crate::hal::serial).
//!
//! Both interrupts mask their own source and then let all others in: they do not nest in themselves, so
//! bytes keep their order, and the step interrupt waits for no more than their first and last cycles.
//! Exec would run far too long inside the receive interrupt, so that holds it off (`exec::HOLD`); inside
//! the transmit interrupt it only makes bytes wait.

use core::arch::asm;

use super::exec;
use crate::baud;
use crate::hal::byte::SharedByte;
use crate::hal::event::Event;
use crate::hal::ring::Ring;
use crate::hal::serial::{
    BATCH, BEHIND_END, CLEAN, CUT, GO, MARKS, Outgoing, RETURNED, RING, Received,
};
use crate::realtime;

type ByteRing = Ring<u8, RING>;

static RX: ByteRing = Ring::new();
static TX: ByteRing = Ring::new();
/// Counts line ends that were lost, low byte first. The receive interrupt writes it.
static LOST_ENDS: [SharedByte; 2] = [const { SharedByte::new(0) }; 2];
static REALTIME: SharedByte = SharedByte::new(0);

/// A byte to send before all others, and whether these are held back.
static AHEAD: SharedByte = SharedByte::new(0);
static HELD: SharedByte = SharedByte::new(0);

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

/// Ends the line of which a part has been sent; what else the ring holds is never sent.
///
/// # Safety
/// Thread mode; interrupts are off, and stay so.
pub unsafe fn end_line() {
    if TX.taken_last() == Some(b'\n') {
        return;
    }
    let uart = super::peripherals().USART0;
    while uart.ucsr0a().read().udre0().bit_is_clear() {}
    uart.udr0().write(|w| w.set(b'\n'));
}

/// Leaves the line to others, for good.
///
/// # Safety
/// Interrupts are off, and stay so.
pub unsafe fn stop() {
    // SAFETY: the caller's.
    unsafe { UCSR0B.write_volatile(0) };
}

/// Sends what the ring holds.
pub fn kick() {
    // SAFETY: the register has two values after start-up, written whole.
    unsafe { UCSR0B.write_volatile(RXCIE | UDRIE | RXEN | TXEN) };
}

/// Sends a byte, not 0, before what the ring holds, even while the line is held. Thread mode.
pub fn send_ahead(byte: u8) {
    AHEAD.set(byte);
    kick();
}

/// Holds what the ring holds back, or lets it go. Thread mode.
pub fn hold(held: bool) {
    HELD.set(held.into());
    kick();
}

/// Line ends lost since start-up, modulo 2^16.
pub fn lost_ends() -> u16 {
    let [low, high] = &LOST_ENDS;
    loop {
        let before = high.get();
        let count = u16::from_le_bytes([low.get(), before]);
        if high.get() == before {
            return count;
        }
    }
}

/// Bytes that may come before any is lost, at most 254: one less than the receive ring has room for.
pub fn room() -> u8 {
    (RING - 2).saturating_sub(RX.used()) as u8
}

/// The real-time characters since the last call, as bits (see [`realtime`]).
pub fn take_realtime() -> u8 {
    avr_device::interrupt::free(|_| {
        let bits = REALTIME.get();
        REALTIME.set(0);
        bits
    })
}

/// USART0_RX: takes a byte, in 76 cycles.
///
/// Interrupts are off for 25 cycles on the way in and 20 on the way out, or 29 if exec has been held
/// off. The reader is told at the ends
/// of lines and every [`BATCH`] bytes.
#[unsafe(no_mangle)]
extern "C" fn __vector_25() -> ! {
    // SAFETY: every register it changes is restored, and it returns by `reti`. It is the only producer
    // of the receive ring and the only one to write `LOST_ENDS` and to set bits of `REALTIME`; its own
    // source is off, so it does not nest. `UCSR0B` is changed with interrupts off.
    unsafe {
        asm!(
            "push r24",
            "push r25",
            "in   r25, 0x3F",
            "lds  r24, 0xC1",
            "andi r24, {mask}",
            "sts  0xC1, r24",
            "sbi  0x1E, {hold_exec}",
            "push r31",
            // The status goes with the byte that is read after it: nothing comes in between, for an
            // instruction behind `sei` is executed first.
            "lds  r31, 0xC0",
            "sei",
            "lds  r24, 0xC6",
            "push r30",
            // Letters, digits and dots, the most of it, are no real-time characters.
            "cpi  r24, 0x26",
            "brlo 5f",
            "cpi  r24, 0x7E",
            "breq 12f",
            // Queue it, unless a frame error or an overrun says that something was lost.
            "1:",
            "andi r31, 0x18",
            "brne 70f",
            "lds  r30, {rx} + {head}",
            "inc  r30",
            "lds  r31, {rx} + {tail}",
            "cp   r30, r31",
            "breq 80f",
            "sts  {rx} + {head}, r30",
            "mov  r31, r30",
            "andi r31, {batch}",
            "breq 4f",
            "2:",
            "ldi  r31, 0",
            "subi r30, lo8(-({rx} + {slots}))",
            "sbci r31, hi8(-({rx} + {slots}))",
            "st   Z, r24",
            "3:",
            "pop  r30",
            "pop  r31",
            "cli",
            "cbi  0x1E, {hold_exec}",
            "sbic 0x1E, {held_exec}",
            "rjmp 22f",
            "23:",
            "lds  r24, 0xC1",
            "ori  r24, {unmask}",
            "sts  0xC1, r24",
            "out  0x3F, r25",
            "pop  r25",
            "pop  r24",
            "reti",
            // Exec has been asked for meanwhile.
            "22:",
            "cbi  0x1E, {held_exec}",
            "ldi  r24, {pended}",
            "sts  0xD1, r24",
            "rjmp 23b",
            "4:",
            "sbi  0x1E, {received}",
            "rjmp 2b",
            "70:",
            "rjmp 7f",
            "80:",
            "rjmp 8f",
            "12:",
            "ldi  r30, {resume}",
            "rjmp 16f",
            // Up to a percent sign.
            "5:",
            "cpi  r24, 0x20",
            "brsh 6f",
            "cpi  r24, 0x18",
            "breq 13f",
            "cpi  r24, 0x05",
            "breq 14f",
            "cpi  r24, 0x04",
            "breq 15f",
            // A line end, or nearly: the reader is to look.
            "sbi  0x1E, {received}",
            "cpi  r24, {marks}",
            "brsh 1b",
            "rjmp 7f",
            // From blank to percent: special are 0x21 and 0x25, those of odd number with bit 1 clear.
            "6:",
            "sbrs r24, 0",
            "rjmp 1b",
            "sbrc r24, 1",
            "rjmp 1b",
            "ldi  r30, {hold}",
            "sbrc r24, 2",
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
            // A real-time character. What was lost before it is still to be marked.
            "16:",
            "lds  r24, {realtime}",
            // Who says hold does not say resume any more (`realtime::with`).
            "sbrc r30, {hold_bit}",
            "andi r24, {not_resume}",
            "or   r24, r30",
            "sts  {realtime}, r24",
            "sbi  0x1E, {special}",
            // Where it stands counts, of some: queue a mark.
            "ldi  r24, {cut}",
            "sbrc r30, {resume_bit}",
            "ldi  r24, {go}",
            "andi r30, {placed}",
            "breq 24f",
            "sbi  0x1E, {received}",
            "rjmp 1b",
            "24:",
            "ldi  r24, 0",
            "andi r31, 0x18",
            "brne 7f",
            "rjmp 3b",
            // Something was lost: a mark for it, if there is room.
            "7:",
            "push r26",
            "ldi  r26, 0",
            "lds  r30, {rx} + {head}",
            "inc  r30",
            "lds  r31, {rx} + {tail}",
            "cp   r30, r31",
            "breq 9f",
            "sts  {rx} + {head}, r30",
            "rcall 20f",
            "rjmp 10f",
            // The ring is full: the newest byte becomes a mark (`serial::mark`).
            "8:",
            "push r26",
            "9:",
            "lds  r30, {rx} + {head}",
            "rcall 20f",
            "ld   r26, Z",
            "cpi  r26, {marks}",
            "brlo 10f",
            "cpi  r26, 0x0A",
            "ldi  r26, {behind_lf}",
            "breq 10f",
            "ld   r26, Z",
            "cpi  r26, 0x0D",
            "ldi  r26, {behind_cr}",
            "breq 10f",
            "ldi  r26, 0",
            // One more byte is lost (`serial::lose`).
            "10:",
            "sbi  0x1E, {received}",
            "cpi  r24, 0x0D",
            "breq 17f",
            "cpi  r24, 0x0A",
            "breq 18f",
            "andi r26, {behind_end}",
            "rjmp 19f",
            "17:",
            "andi r26, {behind_end}",
            "ori  r26, {clean} | {returned}",
            "rjmp 21f",
            "18:",
            "bst  r26, 2",
            "andi r26, {behind_end}",
            "ori  r26, {clean}",
            "brts 19f",
            "21:",
            "lds  r24, {lost_ends}",
            "inc  r24",
            "sts  {lost_ends}, r24",
            "brne 19f",
            "lds  r24, {lost_ends} + 1",
            "inc  r24",
            "sts  {lost_ends} + 1, r24",
            "19:",
            "st   Z, r26",
            "pop  r26",
            "rjmp 3b",
            // Z to the slot of index r30.
            "20:",
            "ldi  r31, 0",
            "subi r30, lo8(-({rx} + {slots}))",
            "sbci r31, hi8(-({rx} + {slots}))",
            "ret",
            rx = sym RX,
            head = const ByteRing::HEAD,
            tail = const ByteRing::TAIL,
            slots = const ByteRing::SLOTS,
            mask = const !RXCIE,
            hold_exec = const exec::HOLD,
            held_exec = const exec::HELD,
            pended = const exec::PENDED,
            unmask = const RXCIE,
            batch = const BATCH - 1,
            marks = const MARKS,
            behind_end = const BEHIND_END,
            behind_lf = const BEHIND_END | CLEAN,
            behind_cr = const BEHIND_END | CLEAN | RETURNED,
            clean = const CLEAN,
            returned = const RETURNED,
            lost_ends = sym LOST_ENDS,
            realtime = sym REALTIME,
            received = const Event::Received as u8,
            special = const Event::Realtime as u8,
            hold = const realtime::HOLD,
            hold_bit = const realtime::HOLD.trailing_zeros(),
            not_resume = const !realtime::RESUME,
            placed = const realtime::PLACED,
            cut = const CUT,
            go = const GO,
            resume_bit = const realtime::RESUME.trailing_zeros(),
            resume = const realtime::RESUME,
            flush = const realtime::FLUSH,
            reset = const realtime::RESET,
            kill = const realtime::KILL,
            enquiry = const realtime::ENQUIRY,
            options(noreturn),
        );
    }
}

/// USART0_UDRE: sends a byte, in 68 cycles, or stops asking when there is none.
///
/// Interrupts are off for 19 cycles on the way in and 16 on the way out.
#[unsafe(no_mangle)]
extern "C" fn __vector_26() -> ! {
    // SAFETY: every register it changes is restored, and it returns by `reti`. It is the only consumer
    // of the transmit ring; its own source is off, so it does not nest. `UCSR0B` is changed with
    // interrupts off.
    unsafe {
        asm!(
            "push r24",
            "push r25",
            "in   r25, 0x3F",
            "lds  r24, 0xC1",
            "andi r24, {mask}",
            "sts  0xC1, r24",
            "sei",
            "push r30",
            "push r31",
            "lds  r24, {ahead}",
            "tst  r24",
            "brne 3f",
            "lds  r24, {held}",
            "tst  r24",
            "brne 2f",
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
            "4:",
            "sts  0xC6, r24",
            "sbi  0x1E, {transmitted}",
            "pop  r31",
            "pop  r30",
            "cli",
            "lds  r24, 0xC1",
            "ori  r24, {unmask}",
            "sts  0xC1, r24",
            "1:",
            "out  0x3F, r25",
            "pop  r25",
            "pop  r24",
            "reti",
            // It stays masked until there is something to send.
            "2:",
            "pop  r31",
            "pop  r30",
            "cli",
            "rjmp 1b",
            // A byte that goes before all others.
            "3:",
            "ldi  r30, 0",
            "sts  {ahead}, r30",
            "rjmp 4b",
            ahead = sym AHEAD,
            held = sym HELD,
            tx = sym TX,
            head = const ByteRing::HEAD,
            tail = const ByteRing::TAIL,
            slots = const ByteRing::SLOTS,
            mask = const !UDRIE,
            unmask = const UDRIE,
            transmitted = const Event::Transmitted as u8,
            options(noreturn),
        );
    }
}
