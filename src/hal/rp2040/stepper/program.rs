//! The programs of the state machine. Both take the same entries ([`words`](super::words)); either fits into the memory of
//! the PIO, at address 0.
//!
//! In Y are the pins between pulses, in ISR is the length of a pulse.

use core::ops::RangeInclusive;

use embassy_rp::pio::program::{Program, RP2040_MAX_PROGRAM_SIZE, pio_asm};

/// Where a program is in an entry, by the address of the instruction that comes next.
pub(super) struct Layout {
    /// The first word has been taken, and not carried out.
    pub half_taken: [RangeInclusive<u8>; 2],
    /// Both words have been taken, and the pulse has not begun.
    pub taken: RangeInclusive<u8>,
}

/// The layout of [`direct`].
pub(super) const OF_DIRECT: Layout = Layout { half_taken: [1..=4, 10..=12], taken: 13..=13 };
/// The layout of [`shifted`].
pub(super) const OF_SHIFTED: Layout = Layout { half_taken: [1..=4, 11..=13], taken: 14..=16 };

/// A program.
pub(super) type Code = Program<RP2040_MAX_PROGRAM_SIZE>;

/// Returns the program that sets pins of the chip.
pub(super) fn direct() -> Code {
    let program = pio_asm!(
        ".origin 0",
        ".wrap_target",
        "start:",
        "    pull block",
        "    out x, 1",
        "    jmp !x tick",
        // Pins change.
        "    out x, 1",
        "    pull block",
        "    out y, 32",
        "    mov pins, y",
        "    jmp !x start",
        "    irq nowait 0",
        "    jmp start",
        "tick:",
        "    out x, 31",
        "rest:",
        "    jmp x-- rest",
        "    pull block",
        "    out pins, 32",
        "    mov x, isr",
        "pulse:",
        "    jmp x-- pulse",
        "    mov pins, y",
        ".wrap",
    );
    program.program
}

/// Returns the program that sends eight pins to a shift register. Side-set bit 0 is the clock, bit 1 the latch.
///
/// The clock is low for four cycles, while the data are set up, and high for four: 16 MHz at 128 MHz. The pulse begins in
/// the one cycle in which `mov x, isr` raises the latch, so the address of the instruction tells whether it has begun. A
/// state machine that is stopped in the midst of eight bits begins anew with eight whole ones, before it raises the latch.
pub(super) fn shifted() -> Code {
    let program = pio_asm!(
        ".origin 0",
        ".side_set 2",
        ".wrap_target",
        "start:",
        "    pull block            side 0",
        "    out x, 1              side 0",
        "    jmp !x tick           side 0",
        // Pins change.
        "    out x, 1              side 0",
        "    pull block            side 0",
        "    mov y, osr            side 0",
        "changed:",
        "    out pins, 1           side 0 [3]",
        "    jmp !osre changed     side 1 [3]",
        "    jmp !x start          side 2 [3]",
        "    irq nowait 0          side 0",
        "    jmp start             side 0",
        "tick:",
        "    out x, 31             side 0",
        "rest:",
        "    jmp x-- rest          side 0",
        "    pull block            side 0",
        "raised:",
        "    out pins, 1           side 0 [3]",
        "    jmp !osre raised      side 1 [3]",
        "    mov x, isr            side 2",
        "pulse:",
        "    jmp x-- pulse         side 2",
        "    mov osr, y            side 0",
        "lowered:",
        "    out pins, 1           side 0 [3]",
        "    jmp !osre lowered     side 1 [3]",
        "    nop                   side 2 [3]",
        ".wrap",
    );
    program.program
}
