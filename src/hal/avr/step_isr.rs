//! The step interrupt, in assembly: [`Dda::tick`](crate::motion::dda::Dda::tick) on the board's pins.
//!
//! Rust's own translation of that function takes 340 cycles, most of them saving registers and copying
//! between them; this one takes 138 with four motors on ports A to G, entry and return included, and
//! 5 more for each step pin on ports H to L. Every 4 ms or so it calls [`stepper::load`], which is Rust
//! and takes about 300 more.
//!
//! It saves what it uses: r24 to r26, r30, r31 and SREG; for the call also all that a called function
//! may use.

use core::arch::asm;
use core::mem::offset_of;

use super::stepper;
use crate::boards::{ACTIVE, Pin, Timer};
use crate::motion::dda::Dda;

const _: () = assert!(matches!(ACTIVE.step_timer, Timer::T1), "vector 17 is timer 1, compare A");

const fn port(motor: usize) -> usize {
    ACTIVE.motors[motor].step.port.address()
}

const fn bit(motor: usize) -> u8 {
    let Pin { bit, .. } = ACTIVE.motors[motor].step;
    bit
}

/// TIMER1_COMPA.
///
/// Its body is one assembly block that uses no operand in a register, so the compiler adds nothing
/// before or behind it: a naked function, on every toolchain.
#[unsafe(no_mangle)]
extern "C" fn __vector_17() -> ! {
    // SAFETY: every register it changes is restored but r0 and r1 within the call it makes, which it
    // saves too; it returns by `reti` with the stack as it was.
    unsafe {
        asm!(
            // Raises the step pin of a motor if its bit of r26 is set. Ports above 0x3F have no `sbi`.
            ".macro KERF_RISE motor, port, bit",
            ".if \\port < 0x40",
            "    sbrc r26, \\motor",
            "    sbi  \\port - 0x20, \\bit",
            ".else",
            "    sbrs r26, \\motor",
            "    rjmp .Lkerf_low_\\motor",
            "    lds  r24, \\port",
            "    ori  r24, 1 << \\bit",
            "    sts  \\port, r24",
            ".Lkerf_low_\\motor:",
            ".endif",
            ".endm",
            ".macro KERF_FALL port, bit",
            ".if \\port < 0x40",
            "    cbi  \\port - 0x20, \\bit",
            ".else",
            "    lds  r24, \\port",
            "    andi r24, 0xFF - (1 << \\bit)",
            "    sts  \\port, r24",
            ".endif",
            ".endm",
            // Adds the increment to a phase; bit 15 of the sum becomes the motor's bit of r26.
            ".macro KERF_ADD motor",
            "    lds  r30, {state} + {phase} + 2 * \\motor",
            "    lds  r31, {state} + {increment} + 2 * \\motor",
            "    add  r30, r31",
            "    sts  {state} + {phase} + 2 * \\motor, r30",
            "    lds  r30, {state} + {phase} + 2 * \\motor + 1",
            "    lds  r31, {state} + {increment} + 2 * \\motor + 1",
            "    adc  r30, r31",
            "    bst  r30, 7",
            "    bld  r26, \\motor",
            "    andi r30, 0x7F",
            "    sts  {state} + {phase} + 2 * \\motor + 1, r30",
            ".endm",
            "    push r24",
            "    in   r24, 0x3F",
            "    push r24",
            "    push r25",
            "    push r26",
            "    push r30",
            "    push r31",
            "    lds  r26, {state} + {due}",
            "    KERF_RISE 0, {port0}, {bit0}",
            "    KERF_RISE 1, {port1}, {bit1}",
            "    KERF_RISE 2, {port2}, {bit2}",
            "    KERF_RISE 3, {port3}, {bit3}",
            "    lds  r24, {state} + {ticks}",
            "    lds  r25, {state} + {ticks} + 1",
            "    sbiw r24, 1",
            "    brcc 1f",
            "    rjmp 3f",
            "1:",
            "    sts  {state} + {ticks}, r24",
            "    sts  {state} + {ticks} + 1, r25",
            "    KERF_ADD 0",
            "    KERF_ADD 1",
            "    KERF_ADD 2",
            "    KERF_ADD 3",
            "    sts  {state} + {due}, r26",
            "2:",
            "    KERF_FALL {port0}, {bit0}",
            "    KERF_FALL {port1}, {bit1}",
            "    KERF_FALL {port2}, {bit2}",
            "    KERF_FALL {port3}, {bit3}",
            "    pop  r31",
            "    pop  r30",
            "    pop  r26",
            "    pop  r25",
            "    pop  r24",
            "    out  0x3F, r24",
            "    pop  r24",
            "    reti",
            // The segment is used up.
            "3:",
            "    push r0",
            "    push r1",
            "    push r18",
            "    push r19",
            "    push r20",
            "    push r21",
            "    push r22",
            "    push r23",
            "    push r27",
            "    clr  r1",
            "    call {load}",
            "    mov  r26, r24",
            "    sbrs r26, 0",
            "    call {halt}",
            "    pop  r27",
            "    pop  r23",
            "    pop  r22",
            "    pop  r21",
            "    pop  r20",
            "    pop  r19",
            "    pop  r18",
            "    pop  r1",
            "    pop  r0",
            "    lds  r24, {state} + {ticks}",
            "    lds  r25, {state} + {ticks} + 1",
            "    sbiw r24, 1",
            "    brcs 4f",
            "    rjmp 1b",
            "4:",
            // None was left: nothing is due.
            "    clr  r26",
            "    sts  {state} + {due}, r26",
            "    rjmp 2b",
            state = sym stepper::STATE,
            phase = const offset_of!(Dda, phase),
            increment = const offset_of!(Dda, increment),
            ticks = const offset_of!(Dda, ticks),
            due = const offset_of!(Dda, due),
            port0 = const port(0),
            port1 = const port(1),
            port2 = const port(2),
            port3 = const port(3),
            bit0 = const bit(0),
            bit1 = const bit(1),
            bit2 = const bit(2),
            bit3 = const bit(3),
            load = sym stepper::load,
            halt = sym stepper::halt,
            options(noreturn),
        );
    }
}
