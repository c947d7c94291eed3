//! The interrupts of a serial port, in assembly. Each port has its own copies, made by one macro.
//!
//! The receive interrupt takes real-time characters out of the stream wherever they stand, and never queues them.
//!
//! Interrupts stay off from the first cycle to the last. A tick of the step timer need not wait that long: the
//! handlers test the timer's flag several times on their way, for a usual byte once half-way, and call the handler of
//! the step interrupt if the flag is set. Each test costs two cycles; masking the port's own interrupt, holding exec
//! off and `sei` would cost 26. Thus neither handler nests in itself, bytes keep their order, and exec, which runs
//! far too long for the middle of a byte, waits for the end of the handler. Other interrupts wait for the whole
//! handler: 60 cycles, 130 for a byte that is lost.
//!
//! For a USART that the board does not use the handlers return at once, and nothing enables these interrupts.

use core::arch::asm;
use core::mem::offset_of;

use avr_embassy::assembly;

use super::super::{step_isr, stepper};
use super::{
    AHEAD, AUX_SHARED, Flags, HEEDS_CTS, HEEDS_XOFF, PLAIN, STOPPED, Shared, TXC, TXCIE, U2X,
    UDRIE, USB_SHARED,
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

/// Returns the pin with which the other side stops us.
const fn cts(port: u8) -> Option<Pin> {
    match hardware(port) {
        Some(Serial { handshake: Some(Handshake { cts, .. }), .. }) => Some(cts),
        _ => None,
    }
}

/// Returns the pin with which we stop the other side.
const fn rts(port: u8) -> Option<Pin> {
    match hardware(port) {
        Some(Serial { handshake: Some(Handshake { rts, .. }), .. }) => Some(rts),
        _ => None,
    }
}

/// Returns where a pin of the board is: the address in the I/O space of its PIN register (`register` 0) or of its
/// PORT register (`register` 2), and its bit.
const fn place(pin: Option<Pin>, register: usize) -> (usize, u8) {
    match pin {
        Some(pin) => (pin.port.address() - 0x22 + register, pin.bit),
        None => (0, 0),
    }
}

/// Returns the pin that enables the driver of a port.
const fn driver(port: u8) -> Option<Pin> {
    match hardware(port) {
        Some(serial) => serial.driver_enable,
        None => None,
    }
}

macro_rules! interrupts {
    (
        $port:ident on $usart:ident: $shared:ident, $ring:ident,
        $rx:ident, $empty:ident, $complete:ident
    ) => {
        /// USARTn_RX: takes a byte, in 60 cycles; a line end in 70.
        ///
        /// A tick waits for at most 40 of these cycles. The reader is woken at the ends of lines and every `batch`
        /// bytes.
        #[unsafe(no_mangle)]
        extern "C" fn $rx() -> ! {
            // SAFETY: every register it changes is restored, and it returns by `reti`. It is the only producer of the
            // receive ring, and it alone writes `lost_ends` and sets bits of `realtime`. Interrupts are off, so it
            // does not nest in itself. The handler of the step interrupt also restores every register. Its `reti`
            // lets interrupts in, but none comes before the instruction after it, which is `cli`. The timer's flag is
            // cleared before the call, as the chip does when it enters that handler.
            unsafe {
                asm!(
                    ".if {here}",
                    "push r24",
                    "in   r24, 0x3F",
                    "push r24",
                    "push r30",
                    "push r31",
                    // The status belongs to the byte that is read after it, so it is read first.
                    "lds  r31, {status}",
                    "lds  r24, {data}",
                    // Letters, digits and dots, most of the input, are not real-time characters.
                    "cpi  r24, 0x26",
                    "brlo 61f",
                    "cpi  r24, 0x7E",
                    "brsh 12f",
                    // A frame error or an overrun means that something was lost.
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
                    // Where the ring is short, the reader may come too late to stop the sender: this interrupt sets
                    // RTS.
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
                    // A tick is due: clear the flag and call the step interrupt's handler.
                    "68:",
                    "sbi  {step_flags}, {due}",
                    "call {step}",
                    "cli",
                    "ret",
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
                    // Bytes up to a percent sign. Blanks and line ends take the shortest ways.
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
                    // A line end or another control character: wake the reader.
                    "67:",
                    "sbi  {flags}, {received}",
                    "rjmp 60b",
                    "54:",
                    "ldi  r24, {stray}",
                    "rjmp 67b",
                    "52:",
                    "rjmp 50f",
                    // From a blank to a percent sign. Special are 0x21 and 0x25: the bytes with bit 0 set and bit 1
                    // clear.
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
                    // A real-time character. A loss that came with it is still to be marked.
                    "16:",
                    "sbic {step_flags}, {due}",
                    "rcall 68b",
                    "lds  r24, {shared} + {realtime}",
                    // A hold takes back a resume that is pending (`realtime::with`).
                    "sbrc r30, {hold_bit}",
                    "andi r24, {not_resume}",
                    "or   r24, r30",
                    "sts  {shared} + {realtime}, r24",
                    "sbi  {flags}, {special}",
                    // For some of them the position in the stream matters: queue a mark.
                    "ldi  r24, {cut}",
                    "sbrc r30, {resume_bit}",
                    "ldi  r24, {go}",
                    "andi r30, {placed}",
                    "breq 24f",
                    "sbi  {flags}, {received}",
                    "rjmp 60b",
                    // Nothing is left to do.
                    "3:",
                    "rjmp 66b",
                    "24:",
                    "ldi  r24, 0",
                    "andi r31, 0x18",
                    "breq 3b",
                    "rjmp 71f",
                    // XON or XOFF, if flow control is by characters.
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
                    // Something was lost: queue a mark, if there is room.
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
                    // A resume is not marked then, so that no byte is lost for it.
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
                    // Sets Z to the slot of index r30.
                    "20:",
                    "ldi  r31, 0",
                    "subi r30, lo8(-({shared} + {slots}))",
                    "sbci r31, hi8(-({shared} + {slots}))",
                    "ret",
                    // A tilde, or a byte above it: an override or the end of a jog (`realtime::Asked`), unless the
                    // byte is damaged or part of a letter.
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
                    // Adds one more step, r24, to the percentage r30. r31 is the bit that says "from 100 %".
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

        /// USARTn_UDRE: sends a byte, in 56 cycles, 60 on a bus; when there is none, it disables itself. While XOFF
        /// or XON waits, or the other side may stop us, it takes 85.
        ///
        /// A tick waits for at most 35 of these cycles.
        #[unsafe(no_mangle)]
        extern "C" fn $empty() -> ! {
            // SAFETY: every register it changes is restored, and it returns by `reti`. It is the only consumer of the
            // transmit ring. Interrupts are off, so it does not nest in itself, and no other code changes UCSRnB
            // meanwhile. The handler of the step interrupt is called as in the receive interrupt.
            unsafe {
                asm!(
                    ".if {here}",
                    "push r24",
                    "in   r24, 0x3F",
                    "push r24",
                    "push r30",
                    "push r31",
                    "lds  r24, {shared} + {held}",
                    "andi r24, {holds} | {before}",
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
                    // Clears TXC, so that "complete" means this byte, not one before it. No time may pass between the
                    // two stores.
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
                    // A tick is due: clear the flag and call the step interrupt's handler.
                    "25:",
                    "sbi  {step_flags}, {due}",
                    "call {step}",
                    "cli",
                    "ret",
                    // Nothing may be sent now: the interrupt stays masked until `kick`.
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
                    // A byte goes before all others, if its wait is over or the byte sent last ends a line.
                    "20:",
                    "lds  r24, {shared} + {ahead}",
                    "tst  r24",
                    "breq 12f",
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
                    // No byte is to go ahead any more: clear `AHEAD`.
                    "12:",
                    "sbic {step_flags}, {due}",
                    "rcall 25b",
                    "lds  r24, {shared} + {held}",
                    "andi r24, {not_before}",
                    "sts  {shared} + {held}, r24",
                    // The other side has stopped us by XOFF, or may do so by a pin.
                    "5:",
                    "sbic {step_flags}, {due}",
                    "rcall 25b",
                    "lds  r24, {shared} + {held}",
                    "andi r24, {holds}",
                    "brne 26f",
                    "rjmp 6b",
                    "26:",
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
                    before = const AHEAD,
                    not_before = const !AHEAD,
                    mask = const !UDRIE,
                    flags = const assembly::FLAGS,
                    when_complete = const TXCIE,
                    complete = const U2X | TXC,
                    transmitted = const Event::Transmitted as u8,
                    options(noreturn),
                );
            }
        }

        /// USARTn_TX: the last byte has been sent, so it releases the bus. Interrupts are off for 15 cycles.
        #[unsafe(no_mangle)]
        extern "C" fn $complete() -> ! {
            // SAFETY: it changes no register, and returns by `reti`. The bit of the pin is changed in one
            // instruction; `uart::kick` keeps this interrupt away while it sets that bit.
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
