//! The handlers of edges: INT0 to INT7 and PCINT0 to PCINT2, each vector made from the same text.
//!
//! | handler of | does | cycles |
//! |---|---|---|
//! | a switch's pin | has someone look at all switches ([`inputs`]) | 20, interrupts off |
//! | an encoder's pin, none set up | the same | 25, interrupts off |
//! | an encoder's pin | takes the time of a pulse ([`encoder`](super::encoder)) | 106 at most, 119 with a second one of sync, interrupts off for 31 and 25 |
//!
//! A handler of an encoder's pin reads timer 5 first, 20 cycles after it has been entered. It masks both pins of the encoder and lets
//! all other interrupts in but exec: it nests neither in itself nor in the other. An edge that comes
//! meanwhile waits for its end. A pulse that is over before its handler reads the pin is none.

use core::arch::asm;
use core::mem::offset_of;

use avr_embassy::assembly;

use super::encoder::{LINES, Line, SHARED, Shared};
use super::inputs::{self, MASKS};
use crate::boards::{ACTIVE, Encoder, Pin, inputs::COUNT};
use crate::capability::Capability;

/// INT0.
const FIRST: u8 = 1;
/// PCINT0.
const FIRST_CHANGE: u8 = 9;

/// The pin of the encoder that a vector is for, and its number: 0 index, 1 sync.
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

/// The address of its PIN register, and its bit.
const fn place(vector: u8) -> (usize, u8) {
    match sensor(vector) {
        Some((pin, _)) => (pin.port.address() - 2, pin.bit),
        None => (0, 0),
    }
}

/// The bit of the second pin of sync in the port of the first; 8 without one.
const fn second(vector: u8) -> u8 {
    match (sensor(vector), ACTIVE.encoder) {
        (Some((_, 1)), Some(Encoder { second: Some(pin), .. })) => pin.bit,
        _ => 8,
    }
}

/// The pins that the vector watches in the port of its sensor. Others change without an interrupt, as a second pin of sync does.
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

/// Whether the vectors of the encoder are those of pin changes.
const fn changes(vector: u8) -> bool {
    vector >= FIRST_CHANGE
}

/// The register that masks the sources of the vector, and what is in it while an encoder's handler runs: all else. An encoder's pins are
/// both of one kind.
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
            // SAFETY: it restores every register it changes, T with the status, and returns by `reti`. With a sensor it is the only one to write the
            // sensor's `Line`, but for `quiet`, which thread mode and exec set with interrupts off; the mask that it changes is
            // written by handlers of sensors alone, which do not nest. `HOLD` is set and cleared by them alone.
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
                    // TCNT5. Its high byte waits in a register of the timer, which nobody reads meanwhile.
                    "lds  r24, 0x124",
                    // Whoever holds exec off already lets it in, too. In here that bit of the status is clear.
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
                    // Which pins of the port have changed: others may be switches.
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
                    // With a second pin that one's level says whether the edge counts, and the pin's own which way.
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
                    // How long ago the last edge was.
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
                    // No encoder: a switch.
                    "7:",
                    "ldi  r24, {run}",
                    "sts  {start}, r24",
                    "pop  r24",
                    "reti",
                    // Exec has been asked for meanwhile.
                    "8:",
                    "cbi  {flags}, {held}",
                    "ldi  r24, {pended}",
                    "sts  {pend}, r24",
                    "out  0x3F, r25",
                    "pop  r25",
                    "pop  r24",
                    "reti",
                    // Exec is held off still.
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
