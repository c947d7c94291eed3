//! The handlers of edges, INT0 to INT7 and PCINT0 to PCINT2. One macro makes the code of each vector.
//!
//! | handler of | does | cycles |
//! |---|---|---|
//! | a switch's pin | starts a sample of all switches ([`inputs`]) | 20, interrupts off |
//! | an encoder's pin while no encoder is set up | starts a sample of all switches | 25, interrupts off |
//! | an encoder's pin | takes the time of a pulse ([`encoder`](super::encoder)) | at most 106, 119 with a second sync pin; interrupts off for 31 and 25 |
//!
//! A handler of an encoder's pin reads timer 5 first, 20 cycles after it has been entered. It masks the interrupts of
//! both encoder pins, and lets in all other interrupts except exec. So it nests neither in itself nor in the other
//! encoder handler. An edge that comes meanwhile waits for its end. A pulse that is over before its handler reads the
//! pin does not count.

use core::arch::asm;
use core::mem::offset_of;

use avr_embassy::assembly;

use super::encoder::{LINES, Line, SHARED, Shared};
use super::inputs::{self, MASKS};
use crate::boards::{ACTIVE, Encoder, Pin, inputs::COUNT};
use crate::capability::Capability;

/// Vector number of INT0.
const FIRST: u8 = 1;
/// Vector number of PCINT0.
const FIRST_CHANGE: u8 = 9;

/// Returns the encoder pin that a vector is for, and the number of its line: 0 index, 1 sync. `None` if the vector is
/// for switches.
const fn sensor(vector: u8) -> Option<(Pin, u8)> {
    match ACTIVE.encoder {
        Some(encoder) if Capability::Lathe.is_built_in() => {
            let [index, sync] = encoder.vectors();
            if vector == index {
                Some((encoder.index, 0))
            } else if vector == sync {
                Some((encoder.sync, 1))
            } else {
                None
            }
        }
        _ => None,
    }
}

const fn line(vector: u8) -> u8 {
    match sensor(vector) {
        Some((_, line)) => line,
        None => 0,
    }
}

/// Returns the address of the PIN register of the vector's sensor, and its bit there.
const fn place(vector: u8) -> (usize, u8) {
    match sensor(vector) {
        Some((pin, _)) => (pin.port.address() - 2, pin.bit),
        None => (0, 0),
    }
}

/// Returns the bit of the second sync pin, in the port of the first; 8 if there is none.
const fn second(vector: u8) -> u8 {
    match (sensor(vector), ACTIVE.encoder) {
        (Some((_, 1)), Some(Encoder { second: Some(pin), .. })) => pin.bit,
        _ => 8,
    }
}

/// Returns the pins that the vector watches in the port of its sensor. Other pins change without an interrupt, for
/// example a second sync pin.
const fn watched(vector: u8) -> u8 {
    let Some((sensor, _)) = sensor(vector) else { return 0 };
    let mut bits = 1 << sensor.bit;
    let mut i = 0;
    while i < COUNT {
        if let Some(pin) = ACTIVE.inputs[i]
            && pin.port as u8 == sensor.port as u8
        {
            bits |= 1 << pin.bit;
        }
        i += 1;
    }
    bits
}

/// Whether the vector is one of pin changes.
const fn changes(vector: u8) -> bool {
    vector >= FIRST_CHANGE
}

/// Returns the register that masks the sources of the vector, its value while an encoder's handler runs, and its
/// usual value. The handler masks both encoder pins, which are of one kind.
const fn mask(vector: u8) -> (usize, u8, u8) {
    let (mut external, mut change) = (MASKS.0, 0b111);
    if let Some(encoder) = ACTIVE.encoder {
        let mut i = 0;
        while i < 2 {
            let vector = encoder.vectors()[i];
            if changes(vector) {
                change &= !(1 << (vector - FIRST_CHANGE));
            } else {
                external &= !(1 << (vector - FIRST));
            }
            i += 1;
        }
    }
    if changes(vector) { (0x68, change, 0b111) } else { (0x3D, external, MASKS.0) }
}

const _: () = {
    if let Some(encoder) = ACTIVE.encoder {
        let [index, sync] = encoder.vectors();
        assert!(changes(index) == changes(sync), "the sensors of this board are not of one kind");
    }
};

macro_rules! edges {
    ($($name:ident = $vector:literal;)+) => {$(
        #[unsafe(no_mangle)]
        extern "C" fn $name() -> ! {
            // SAFETY: it restores every register it changes (T with the status), and returns by `reti`. A handler
            // with a sensor is the only one to write the sensor's `Line`, except `quiet`, which thread mode and exec
            // set with interrupts off. The mask that it changes is written by handlers of sensors only, which do not
            // nest. Only they set and clear `HOLD`.
            unsafe {
                asm!(
                    ".if {sensor} == 0",
                    "push r24",
                    "ldi  r24, {run}",
                    "sts  {start}, r24",
                    "pop  r24",
                    "reti",
                    ".else",
                    "push r24",
                    "lds  r24, {state} + {in_use}",
                    "sbrs r24, {line}",
                    "rjmp 7f",
                    "push r25",
                    "in   r25, 0x3F",
                    "ldi  r24, {masked}",
                    "sts  {mask}, r24",
                    // TCNT5. Reading its low byte latches the high byte in a register of the timer, which nobody else
                    // reads meanwhile.
                    "lds  r24, 0x124",
                    // If an outer handler holds exec off, that one lets exec in again at its end. Bit 7 of the saved
                    // status, which is clear in a handler, is set to note this.
                    "sbic {flags}, {hold}",
                    "ori  r25, 0x80",
                    "sbi  {flags}, {hold}",
                    "sei",
                    "push r30",
                    "lds  r30, 0x125",
                    "push r31",
                    "push r26",
                    "push r27",
                    "lds  r31, {pins}",
                    ".if {shared}",
                    // Finds out which pins of the port have changed: others may be switches.
                    "lds  r27, {state} + {levels}",
                    "sts  {state} + {levels}, r31",
                    "eor  r27, r31",
                    "andi r27, {watched}",
                    "cpi  r27, 1 << {bit}",
                    "breq 1f",
                    "ldi  r26, {run}",
                    "sts  {start}, r26",
                    "sbrs r27, {bit}",
                    "rjmp 5f",
                    "1:",
                    ".endif",
                    ".if {second} < 8",
                    // With a second sync pin, the level of that pin says whether the edge counts, and the first pin's
                    // own level says which way.
                    "clt",
                    "lds  r26, {state} + {in_use}",
                    "sbrs r26, 2",
                    "rjmp 3f",
                    "bst  r31, {bit}",
                    "andi r31, 0xFF - (1 << {bit})",
                    "sbrs r31, {second}",
                    "ori  r31, 1 << {bit}",
                    "3:",
                    ".endif",
                    // Computes how long ago the last edge was.
                    "lds  r26, {state} + {place} + {edge}",
                    "lds  r27, {state} + {place} + {edge} + 1",
                    "sts  {state} + {place} + {edge}, r24",
                    "sts  {state} + {place} + {edge} + 1, r30",
                    // A pulse begins when the pin goes low.
                    "sbrc r31, {bit}",
                    "rjmp 4f",
                    "mov  r31, r24",
                    "sub  r31, r26",
                    "mov  r26, r30",
                    "sbc  r26, r27",
                    "lds  r27, {state} + {bounce}",
                    "cp   r31, r27",
                    "lds  r27, {state} + {bounce} + 1",
                    "cpc  r26, r27",
                    "brsh 2f",
                    "lds  r27, {state} + {place} + {quiet}",
                    "tst  r27",
                    "breq 4f",
                    "2:",
                    "sts  {state} + {place} + {at}, r24",
                    "sts  {state} + {place} + {at} + 1, r30",
                    ".if {line} == 0",
                    "lds  r26, {state} + {sync} + {count}",
                    "sts  {state} + {at_index}, r26",
                    "lds  r26, {state} + {sync} + {count} + 1",
                    "sts  {state} + {at_index} + 1, r26",
                    ".endif",
                    "lds  r26, {state} + {place} + {count}",
                    "lds  r27, {state} + {place} + {count} + 1",
                    "adiw r26, 1",
                    ".if {second} < 8",
                    "brtc 3f",
                    "sbiw r26, 2",
                    "3:",
                    ".endif",
                    "sts  {state} + {place} + {count}, r26",
                    "sts  {state} + {place} + {count} + 1, r27",
                    "4:",
                    "ldi  r26, 0",
                    "sts  {state} + {place} + {quiet}, r26",
                    "5:",
                    "pop  r27",
                    "pop  r26",
                    "pop  r31",
                    "pop  r30",
                    "ldi  r24, {unmasked}",
                    "cli",
                    "sts  {mask}, r24",
                    "sbrc r25, 7",
                    "rjmp 9f",
                    "cbi  {flags}, {hold}",
                    "sbic {flags}, {held}",
                    "rjmp 8f",
                    "6:",
                    "out  0x3F, r25",
                    "pop  r25",
                    "pop  r24",
                    "reti",
                    // No encoder is set up: the pin is a switch's.
                    "7:",
                    "ldi  r24, {run}",
                    "sts  {start}, r24",
                    "pop  r24",
                    "reti",
                    // Exec has been requested meanwhile: pend it.
                    "8:",
                    "cbi  {flags}, {held}",
                    "ldi  r24, {pended}",
                    "sts  {pend}, r24",
                    "out  0x3F, r25",
                    "pop  r25",
                    "pop  r24",
                    "reti",
                    // An outer handler still holds exec off.
                    "9:",
                    "andi r25, 0x7F",
                    "rjmp 6b",
                    ".endif",
                    sensor = const sensor($vector).is_some() as u8,
                    shared = const changes($vector) as u8,
                    line = const line($vector),
                    pins = const place($vector).0,
                    bit = const place($vector).1,
                    watched = const watched($vector),
                    second = const second($vector),
                    mask = const mask($vector).0,
                    masked = const mask($vector).1,
                    unmasked = const mask($vector).2,
                    state = sym SHARED,
                    levels = const offset_of!(Shared, levels) + line($vector) as usize,
                    in_use = const offset_of!(Shared, in_use),
                    bounce = const offset_of!(Shared, bounce),
                    at_index = const offset_of!(Shared, at_index),
                    place = const LINES[line($vector) as usize],
                    sync = const LINES[1],
                    edge = const offset_of!(Line, edge),
                    at = const offset_of!(Line, at),
                    count = const offset_of!(Line, count),
                    quiet = const offset_of!(Line, quiet),
                    run = const inputs::STARTED,
                    start = const inputs::START,
                    flags = const assembly::FLAGS,
                    hold = const assembly::HOLD,
                    held = const assembly::HELD,
                    pend = const assembly::PEND,
                    pended = const assembly::PENDED,
                    options(noreturn),
                );
            }
        }
    )+};
}

edges! {
    __vector_1 = 1;
    __vector_2 = 2;
    __vector_3 = 3;
    __vector_4 = 4;
    __vector_5 = 5;
    __vector_6 = 6;
    __vector_7 = 7;
    __vector_8 = 8;
    __vector_9 = 9;
    __vector_10 = 10;
    __vector_11 = 11;
}
