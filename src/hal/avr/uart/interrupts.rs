//! The interrupts of a serial port, in assembly; each port has its own, made from the same text.
//!
//! The receive interrupt picks real-time characters off wherever they stand and never queues them.
//!
//! Interrupts stay off from the first cycle to the last. A tick need not wait so long: the
//! handlers look at the timer's flag again and again, half-way for a usual byte, and call the step interrupt's handler if it is set. That costs
//! two cycles, where masking the port's own interrupt, holding exec off and `sei` cost 26. So neither handler nests in itself, bytes keep their
//! order, and exec, which would run far too long in the midst of a byte, waits for its end. Other interrupts wait for all of it: 60 cycles, 130
//! for a byte that is lost.
//!
//! A USART that the board does not use has interrupts that return at once, and nothing enables them.

use core::arch::asm;
use core::mem::offset_of;

use avr_embassy::assembly;

use super::super::{step_isr, stepper, watchdog};
use super::{
    AUX_SHARED, Flags, HEEDS_CTS, HEEDS_XOFF, PLAIN, STOPPED, Shared, TXC, TXCIE, U2X, UDRIE,
    USB_SHARED,
};
use crate::boards::{Handshake, Pin, Serial, Usart};
use crate::hal::event::Event;
use crate::hal::ring::Ring;
use crate::hal::serial::{
    AUX, AUX_RING, BEHIND_END, CLEAN, CUT, Flow, GO, LINE_END, MARKS, RETURNED, RX_RING, STRAY,
    TX_RING, USB, WAIT_MS, XOFF, XON, batch, hardware, high_water, is_shared,
};
use crate::realtime;

/// Whether the port is on this USART.
const fn is_on(port: u8, usart: Usart) -> bool {
    matches!(hardware(port), Some(serial) if serial.usart as u8 == usart as u8)
}

/// The pin that the other side holds us back with.
const fn cts(port: u8) -> Option<Pin> {
    match hardware(port) {
        Some(Serial { handshake: Some(Handshake { cts, .. }), .. }) => Some(cts),
        _ => None,
    }
}

/// The pin that we hold the other side back with.
const fn rts(port: u8) -> Option<Pin> {
    match hardware(port) {
        Some(Serial { handshake: Some(Handshake { rts, .. }), .. }) => Some(rts),
        _ => None,
    }
}

/// Where a pin of the board is: a PIN register (0), or a PORT register (2), in the I/O space, and the bit.
const fn place(pin: Option<Pin>, register: usize) -> (usize, u8) {
    match pin {
        Some(pin) => (pin.port.address() - 0x22 + register, pin.bit),
        None => (0, 0),
    }
}

/// The pin that enables the driver of a port.
const fn driver(port: u8) -> Option<Pin> {
    match hardware(port) {
        Some(serial) => serial.driver_enable,
        None => None,
    }
}

/// Behind a tick that a handler below has had made: one of which the interrupt is off would have been lost, and the motors crawl from byte to byte.
/// It is never off while the firmware is well: otherwise the machine is stopped as by the watchdog.
extern "C" fn check_step_interrupt() -> ! {
    // SAFETY: it restores the register that it changes, and returns to where the handler goes on, or not at all. Interrupts are off.
    unsafe {
        asm!(
            "push r24",
            "lds  r24, {mask}",
            "sbrs r24, {tick}",
            "jmp  {starved}",
            "pop  r24",
            "ret",
            mask = const stepper::MASK,
            tick = const stepper::DUE,
            starved = sym watchdog::__vector_12,
            options(noreturn),
        )
    }
}

macro_rules! interrupts {
    (
        $port:ident on $usart:ident: $shared:ident, $ring:ident,
        $rx:ident, $empty:ident, $complete:ident
    ) => {
        /// USARTn_RX: takes a byte, in 60 cycles, a line end in 70.
        ///
        /// A tick waits for 40 of them at most. The reader is told at the ends of lines and every `batch` bytes.
        #[unsafe(no_mangle)]
        extern "C" fn $rx() -> ! {
            // SAFETY: every register it changes is restored, and it returns by `reti`. It is the only producer
            // of the receive ring and the only one to write `lost_ends` and to set bits of `realtime`. Interrupts are off, so it
            // does not nest in itself. The handler of the step interrupt restores every register as well; its `reti` lets interrupts
            // in, but none comes before the instruction behind it, which is `cli`. The flag that it is called for is cleared, as the chip does on the way there.
            unsafe {
                asm!(
                    ".if {here}",
                    "push r24",
                    "in   r24, 0x3F",
                    "push r24",
                    "push r30",
                    "push r31",
                    // The status goes with the byte that is read after it.
                    "lds  r31, {status}",
                    "lds  r24, {data}",
                    // Letters, digits and dots, the most of it, are no real-time characters.
                    "cpi  r24, 0x26",
                    "brlo 61f",
                    "cpi  r24, 0x7E",
                    "brsh 12f",
                    // A frame error or an overrun says that something was lost.
                    "60:",
                    "andi r31, 0x18",
                    "brne 64f",
                    "lds  r30, {shared} + {head}",
                    "inc  r30",
                    ".if {last} < 255",
                    "andi r30, {last}",
                    ".endif",
                    "lds  r31, {shared} + {tail}",
                    "cp   r30, r31",
                    "breq 63f",
                    "sbic {step_flags}, {due}",
                    "rcall 68f",
                    "sts  {shared} + {head}, r30",
                    "mov  r31, r30",
                    "andi r31, {batch}",
                    "breq 62f",
                    "65:",
                    "ldi  r31, 0",
                    "subi r30, lo8(-({shared} + {slots}))",
                    "sbci r31, hi8(-({shared} + {slots}))",
                    "st   Z, r24",
                    "66:",
                    "pop  r31",
                    "pop  r30",
                    "pop  r24",
                    "out  0x3F, r24",
                    "pop  r24",
                    "reti",
                    "62:",
                    "sbi  {flags}, {received}",
                    ".if {rts_there}",
                    // The reader may come too late to stop the sender, where the ring is short.
                    "sbic {step_flags}, {due}",
                    "rcall 68f",
                    "lds  r31, {shared} + {held}",
                    "sbrs r31, 1",
                    "rjmp 65b",
                    "lds  r31, {shared} + {tail}",
                    "sub  r31, r30",
                    "neg  r31",
                    "andi r31, {last}",
                    "cpi  r31, {high}",
                    "brlo 65b",
                    "sbi  {rts_register}, {rts_bit}",
                    ".endif",
                    "rjmp 65b",
                    // A tick is due.
                    "68:",
                    "sbi  {step_flags}, {due}",
                    "call {step}",
                    "cli",
                    "jmp  {check}",
                    "63:",
                    "rjmp 8f",
                    "64:",
                    "rjmp 7f",
                    "12:",
                    ".if {has_plain}",
                    "lds  r30, {shared} + {held}",
                    "sbrc r30, {plain}",
                    "rjmp 60b",
                    ".endif",
                    "rjmp 40f",
                    // Up to a percent sign. A blank or a line end comes at once.
                    "61:",
                    "sbic {step_flags}, {due}",
                    "rcall 68b",
                    "cpi  r24, 0x20",
                    "brsh 6f",
                    "cpi  r24, 0x0A",
                    "breq 67f",
                    "cpi  r24, 0x0D",
                    "breq 67f",
                    "cpi  r24, 0x18",
                    "breq 13f",
                    "cpi  r24, 0x05",
                    "breq 14f",
                    "cpi  r24, 0x04",
                    "breq 15f",
                    "cpi  r24, {xon}",
                    "breq 52f",
                    "cpi  r24, {xoff}",
                    "breq 52f",
                    "53:",
                    "cpi  r24, {marks}",
                    "brlo 54f",
                    // A line end, or nearly: the reader is to look.
                    "67:",
                    "sbi  {flags}, {received}",
                    "rjmp 60b",
                    "54:",
                    "ldi  r24, {stray}",
                    "rjmp 67b",
                    "52:",
                    "rjmp 50f",
                    // From blank to percent: special are 0x21 and 0x25, those of odd number with bit 1 clear.
                    "6:",
                    "sbrs r24, 0",
                    "rjmp 60b",
                    "sbrc r24, 1",
                    "rjmp 60b",
                    ".if {has_plain}",
                    "lds  r30, {shared} + {held}",
                    "sbrc r30, {plain}",
                    "rjmp 60b",
                    ".endif",
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
                    "sbic {step_flags}, {due}",
                    "rcall 68b",
                    "lds  r24, {shared} + {realtime}",
                    // Who says hold does not say resume any more (`realtime::with`).
                    "sbrc r30, {hold_bit}",
                    "andi r24, {not_resume}",
                    "or   r24, r30",
                    "sts  {shared} + {realtime}, r24",
                    "sbi  {flags}, {special}",
                    // Where it stands counts, of some: queue a mark.
                    "ldi  r24, {cut}",
                    "sbrc r30, {resume_bit}",
                    "ldi  r24, {go}",
                    "andi r30, {placed}",
                    "breq 24f",
                    "sbi  {flags}, {received}",
                    "rjmp 60b",
                    // All is done.
                    "3:",
                    "rjmp 66b",
                    "24:",
                    "ldi  r24, 0",
                    "andi r31, 0x18",
                    "breq 3b",
                    "rjmp 71f",
                    // XON or XOFF, if they count.
                    "50:",
                    "lds  r30, {shared} + {held}",
                    "sbrs r30, {heeds_xoff}",
                    "rjmp 53b",
                    "sbic {step_flags}, {due}",
                    "rcall 68b",
                    "ori  r30, {stopped}",
                    "cpi  r24, {xoff}",
                    "breq 51f",
                    "andi r30, {not_stopped}",
                    "lds  r24, {shared} + {realtime}",
                    "ori  r24, {let_go}",
                    "sts  {shared} + {realtime}, r24",
                    "sbi  {flags}, {special}",
                    "51:",
                    "sts  {shared} + {held}, r30",
                    "rjmp 24b",
                    // Something was lost: a mark for it, if there is room.
                    "7:",
                    "sbic {step_flags}, {due}",
                    "rcall 68b",
                    "71:",
                    "push r26",
                    "ldi  r26, 0",
                    "lds  r30, {shared} + {head}",
                    "inc  r30",
                    ".if {last} < 255",
                    "andi r30, {last}",
                    ".endif",
                    "lds  r31, {shared} + {tail}",
                    "cp   r30, r31",
                    "breq 9f",
                    "sts  {shared} + {head}, r30",
                    "rcall 20f",
                    "rjmp 10f",
                    // The ring is full: the newest byte becomes a mark (`serial::mark`).
                    "8:",
                    "sbic {step_flags}, {due}",
                    "rcall 68b",
                    // A resume goes without its place: nothing is lost for it.
                    "cpi  r24, {go}",
                    "brne 81f",
                    "lds  r24, {shared} + {realtime}",
                    "ori  r24, {unplaced}",
                    "sts  {shared} + {realtime}, r24",
                    "rjmp 3b",
                    "81:",
                    "push r26",
                    "9:",
                    "lds  r30, {shared} + {head}",
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
                    "sbic {step_flags}, {due}",
                    "rcall 68b",
                    "sbi  {flags}, {received}",
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
                    "mov  r24, r26",
                    "andi r26, {behind_end}",
                    "ori  r26, {clean}",
                    "sbrc r24, 2",
                    "rjmp 19f",
                    "21:",
                    "lds  r24, {shared} + {lost_ends}",
                    "inc  r24",
                    "sts  {shared} + {lost_ends}, r24",
                    "brne 19f",
                    "lds  r24, {shared} + {lost_ends} + 1",
                    "inc  r24",
                    "sts  {shared} + {lost_ends} + 1, r24",
                    "19:",
                    "st   Z, r26",
                    "pop  r26",
                    "rjmp 3b",
                    // Z to the slot of index r30.
                    "20:",
                    "ldi  r31, 0",
                    "subi r30, lo8(-({shared} + {slots}))",
                    "sbci r31, hi8(-({shared} + {slots}))",
                    "ret",
                    // A tilde, or above: an override, or the end of a jog (`realtime::Asked`), unless it is damaged, or a
                    // part of a letter.
                    "40:",
                    "sbic {step_flags}, {due}",
                    "rcall 68b",
                    "brne 39f",
                    "ldi  r30, {resume}",
                    "rjmp 16b",
                    "39:",
                    "cpi  r24, {jog_end}",
                    "breq 38f",
                    "mov  r30, r24",
                    "subi r30, {first}",
                    "cpi  r30, 0x0E",
                    "brsh 41f",
                    "cpi  r30, 8",
                    "breq 41f",
                    "38:",
                    "sbic {step_flags}, {due}",
                    "rcall 68b",
                    "mov  r30, r31",
                    "andi r30, 0x18",
                    "brne 41f",
                    "push r26",
                    "mov  r26, r31",
                    "lds  r30, {shared} + {head}",
                    "rcall 20b",
                    "ld   r30, Z",
                    "mov  r31, r26",
                    "pop  r26",
                    "sbrs r30, 7",
                    "rjmp 42f",
                    "41:",
                    "rjmp 60b",
                    "42:",
                    "sbic {step_flags}, {due}",
                    "rcall 68b",
                    "sbi  {flags}, {special}",
                    "lds  r30, {shared} + {asked} + 2",
                    "cpi  r24, {jog_end}",
                    "brne 37f",
                    "ori  r30, {no_jog}",
                    "rjmp 36f",
                    "37:",
                    "subi r24, {first}",
                    "cpi  r24, 5",
                    "brlo 43f",
                    "cpi  r24, 8",
                    "brlo 44f",
                    "subi r24, 9",
                    "lds  r30, {shared} + {asked} + 1",
                    "ldi  r31, 2",
                    "rcall 45f",
                    "sts  {shared} + {asked} + 1, r30",
                    "rjmp 3b",
                    "43:",
                    "lds  r30, {shared} + {asked}",
                    "ldi  r31, 1",
                    "rcall 45f",
                    "sts  {shared} + {asked}, r30",
                    "rjmp 3b",
                    "44:",
                    "subi r24, 4",
                    "lsl  r24",
                    "lsl  r24",
                    "andi r30, {not_traverse}",
                    "or   r30, r24",
                    "36:",
                    "sts  {shared} + {asked} + 2, r30",
                    "rjmp 3b",
                    // The percent r30 with one more step, r24; r31 is the bit for one from 100 %.
                    "45:",
                    "cpi  r24, 1",
                    "brlo 47f",
                    "ldi  r31, 10",
                    "cpi  r24, 3",
                    "brlo 46f",
                    "ldi  r31, 1",
                    "46:",
                    "sbrs r24, 0",
                    "neg  r31",
                    "add  r30, r31",
                    "brvc 48f",
                    "ldi  r30, 0x7F",
                    "sbrs r24, 0",
                    "ldi  r30, 0x80",
                    "48:",
                    "ret",
                    "47:",
                    "lds  r30, {shared} + {asked} + 2",
                    "or   r30, r31",
                    "sts  {shared} + {asked} + 2, r30",
                    "ldi  r30, 0",
                    "ret",
                    ".else",
                    "reti",
                    ".endif",
                    here = const is_on($port, Usart::$usart) as u8,
                    status = const Usart::$usart.address(),
                    data = const Usart::$usart.address() + 6,
                    shared = sym $shared,
                    last = const $ring - 1,
                    head = const offset_of!(Shared<$ring>, rx) + Ring::<u8, $ring>::HEAD,
                    tail = const offset_of!(Shared<$ring>, rx) + Ring::<u8, $ring>::TAIL,
                    slots = const offset_of!(Shared<$ring>, rx) + Ring::<u8, $ring>::SLOTS,
                    lost_ends = const offset_of!(Shared<$ring>, flags) + offset_of!(Flags, lost_ends),
                    step_flags = const stepper::FLAGS,
                    due = const stepper::DUE,
                    step = sym step_isr::__vector_17,
                    check = sym check_step_interrupt,
                    realtime = const offset_of!(Shared<$ring>, flags) + offset_of!(Flags, realtime),
                    rts_there = const rts($port).is_some() as u8,
                    rts_register = const place(rts($port), 2).0,
                    rts_bit = const place(rts($port), 2).1,
                    high = const high_water(Flow::Pins, $ring),
                    held = const offset_of!(Shared<$ring>, flags) + offset_of!(Flags, held),
                    heeds_xoff = const HEEDS_XOFF.trailing_zeros(),
                    stopped = const STOPPED,
                    has_plain = const cfg!(feature = "dialect-reprap") as u8,
                    plain = const PLAIN.trailing_zeros(),
                    not_stopped = const !STOPPED,
                    xon = const XON,
                    xoff = const XOFF,
                    let_go = const realtime::LET_GO,
                    flags = const assembly::FLAGS,
                    batch = const batch($ring) - 1,
                    marks = const MARKS,
                    stray = const STRAY,
                    behind_end = const BEHIND_END,
                    behind_lf = const BEHIND_END | CLEAN,
                    behind_cr = const BEHIND_END | CLEAN | RETURNED,
                    clean = const CLEAN,
                    returned = const RETURNED,
                    received = const Event::Received as u8,
                    special = const Event::Realtime as u8,
                    hold = const realtime::HOLD,
                    first = const realtime::FIRST,
                    jog_end = const realtime::JOG_END,
                    no_jog = const realtime::NO_JOG,
                    not_traverse = const !realtime::TRAVERSE,
                    asked = const offset_of!(Shared<$ring>, flags) + offset_of!(Flags, asked),
                    hold_bit = const realtime::HOLD.trailing_zeros(),
                    not_resume = const !realtime::RESUME,
                    placed = const realtime::PLACED,
                    unplaced = const realtime::UNPLACED,
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

        /// USARTn_UDRE: sends a byte, in 59 cycles, 63 on a bus, or stops asking when there is none. While XOFF or XON waits, or the other
        /// side may hold us back, 85.
        ///
        /// A tick waits for 35 of them at most.
        #[unsafe(no_mangle)]
        extern "C" fn $empty() -> ! {
            // SAFETY: every register it changes is restored, and it returns by `reti`. It is the only consumer
            // of the transmit ring. Interrupts are off, so it does not nest in itself, and UCSRnB is changed in one piece. The step
            // interrupt's handler is called as in the receive interrupt.
            unsafe {
                asm!(
                    ".if {here}",
                    "push r24",
                    "in   r24, 0x3F",
                    "push r24",
                    "push r30",
                    "push r31",
                    "lds  r24, {shared} + {ahead}",
                    "lds  r30, {shared} + {held}",
                    "andi r30, {holds}",
                    "or   r24, r30",
                    "brne 20f",
                    "6:",
                    "lds  r30, {shared} + {tail}",
                    "lds  r31, {shared} + {head}",
                    "cp   r30, r31",
                    "breq 24f",
                    "sbic {step_flags}, {due}",
                    "rcall 25f",
                    "inc  r30",
                    "andi r30, {last}",
                    "sts  {shared} + {tail}, r30",
                    "ldi  r31, 0",
                    "subi r30, lo8(-({shared} + {slots}))",
                    "sbci r31, hi8(-({shared} + {slots}))",
                    "ld   r24, Z",
                    "4:",
                    "sts  {data}, r24",
                    ".if {bus}",
                    // Complete is this byte, not one before it: no time may pass between the two.
                    "ldi  r24, {complete}",
                    "sts  {status}, r24",
                    ".endif",
                    "sbi  {flags}, {transmitted}",
                    "23:",
                    "pop  r31",
                    "pop  r30",
                    "pop  r24",
                    "out  0x3F, r24",
                    "pop  r24",
                    "reti",
                    // A tick is due.
                    "25:",
                    "sbi  {step_flags}, {due}",
                    "call {step}",
                    "cli",
                    "jmp  {check}",
                    // It stays masked until there is something to send.
                    "24:",
                    "sbic {step_flags}, {due}",
                    "rcall 25b",
                    "lds  r24, {control}",
                    "andi r24, {mask}",
                    ".if {bus}",
                    "ori  r24, {when_complete}",
                    ".endif",
                    "sts  {control}, r24",
                    "rjmp 23b",
                    // A byte goes before all others, if it waits no more, or the byte sent last ends a line.
                    "20:",
                    "lds  r24, {shared} + {ahead}",
                    "tst  r24",
                    "breq 5f",
                    "cpi  r24, {wait}",
                    "brlo 11f",
                    "lds  r30, {shared} + {tail}",
                    "ldi  r31, 0",
                    "subi r30, lo8(-({shared} + {slots}))",
                    "sbci r31, hi8(-({shared} + {slots}))",
                    "ld   r31, Z",
                    "cpi  r31, {line_end}",
                    "brsh 5f",
                    "andi r24, {wait} - 1",
                    "11:",
                    "ldi  r30, 0",
                    "sts  {shared} + {ahead}, r30",
                    "rjmp 4b",
                    // The other side has said that it holds us back, or may say so by a pin.
                    "5:",
                    "sbic {step_flags}, {due}",
                    "rcall 25b",
                    "lds  r24, {shared} + {held}",
                    "andi r24, {holds}",
                    "breq 6b",
                    ".if {cts_mask}",
                    "sbrc r24, 0",
                    "rjmp 24b",
                    "sbis {cts_register}, {cts_bit}",
                    "rjmp 6b",
                    ".endif",
                    "rjmp 24b",
                    ".else",
                    "reti",
                    ".endif",
                    here = const is_on($port, Usart::$usart) as u8,
                    bus = const is_shared($port) as u8,
                    cts_mask = const cts($port).is_some() as u8,
                    cts_register = const place(cts($port), 0).0,
                    cts_bit = const place(cts($port), 0).1,
                    step_flags = const stepper::FLAGS,
                    due = const stepper::DUE,
                    step = sym step_isr::__vector_17,
                    check = sym check_step_interrupt,
                    status = const Usart::$usart.address(),
                    control = const Usart::$usart.address() + 1,
                    data = const Usart::$usart.address() + 6,
                    shared = sym $shared,
                    last = const TX_RING - 1,
                    head = const offset_of!(Shared<$ring>, tx) + Ring::<u8, TX_RING>::HEAD,
                    tail = const offset_of!(Shared<$ring>, tx) + Ring::<u8, TX_RING>::TAIL,
                    slots = const offset_of!(Shared<$ring>, tx) + Ring::<u8, TX_RING>::SLOTS,
                    ahead = const offset_of!(Shared<$ring>, flags) + offset_of!(Flags, ahead),
                    held = const offset_of!(Shared<$ring>, flags) + offset_of!(Flags, held),
                    wait = const WAIT_MS,
                    line_end = const LINE_END,
                    holds = const STOPPED | HEEDS_CTS,
                    mask = const !UDRIE,
                    flags = const assembly::FLAGS,
                    when_complete = const TXCIE,
                    complete = const U2X | TXC,
                    transmitted = const Event::Transmitted as u8,
                    options(noreturn),
                );
            }
        }

        /// USARTn_TX: the last byte has left; lets go of the bus. Interrupts are off for 15 cycles.
        #[unsafe(no_mangle)]
        extern "C" fn $complete() -> ! {
            // SAFETY: it changes no register, and returns by `reti`. The bit of the pin is changed in one
            // instruction; `uart::kick` keeps this away while it sets it.
            unsafe {
                asm!(
                    ".if {bus}",
                    "cbi  {register}, {bit}",
                    ".endif",
                    "reti",
                    bus = const (is_on($port, Usart::$usart) && is_shared($port)) as u8,
                    register = const place(driver($port), 2).0,
                    bit = const place(driver($port), 2).1,
                    options(noreturn),
                );
            }
        }
    };
}

interrupts! { USB on U0: USB_SHARED, RX_RING, __vector_25, __vector_26, __vector_27 }
interrupts! { AUX on U1: AUX_SHARED, AUX_RING, __vector_36, __vector_37, __vector_38 }
interrupts! { AUX on U3: AUX_SHARED, AUX_RING, __vector_54, __vector_55, __vector_56 }
