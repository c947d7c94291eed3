//! The step interrupt, in assembly: [`Dda::tick`](crate::dda::Dda::tick) on the board's pins.
//!
//! | a tick in which | cycles, entry and return included |
//! |---|---|
//! | nothing is due, two motors move | 92 |
//! | two motors step | 127, and up to the segment's `settle` |
//! | four motors step | 175, and up to `settle` |
//! | all moving motors step on every tick (lockstep) | 92, and up to `settle` |
//! | a segment is loaded | 100 more, 120 for more than two motors; 20 for each direction that changes |
//!
//! A pin on ports H to L adds 2 cycles for each motor. Step and direction pins are toggled by writing ones to PIN
//! registers. That is one instruction, it disturbs no other pin of the port, and its time does not depend on whether
//! the pin toggles. So the pulses of all motors are as exact as the tick, and their polarity is given by the levels
//! of the pins while nothing moves.
//!
//! Pulses rise when the timer's count reaches `settle`. If the interrupt has time before that, as it mostly has, it
//! counts the tick and advances the first motor before the pulses rise; in a segment's last tick it only counts. The
//! times of the pulses do not depend on whether this work is done before or after them.
//!
//! The interrupts of serial ports call this handler when a tick is due ([`uart`](super::uart)). It expects interrupts
//! off, and its return address on the stack.
//!
//! It saves the registers that it uses: r24 to r27 and SREG, and r30 and r31 when it loads a segment. The count of
//! ticks is in general-purpose I/O registers 1 and 2, which nobody else uses.

use core::arch::asm;
use core::mem::{offset_of, size_of};

use avr_embassy::assembly;

use super::stepper;
use crate::boards::{ACTIVE, Pin, Timer};
use crate::dda::{Dda, SEGMENTS, Segment};
use crate::hal::ring::Ring;

const _: () = assert!(matches!(ACTIVE.step_timer, Timer::T1), "vector 17 is timer 1, compare A");
const _: () = assert!(size_of::<Segment>() == 16, "slots are found by shifting the index by four");
const _: () = assert!(SEGMENTS.is_power_of_two() && SEGMENTS <= 16, "see above");

type Segments = Ring<Segment, SEGMENTS>;

/// Cycles from the first read of the counter to the second, where a tick is counted and a motor is advanced in
/// between. That work is begun only if so much time is left.
const AHEAD: u8 = 38;

const fn pin_register(pin: Pin) -> usize {
    pin.port.address() - 2
}

const fn mask(pin: Pin) -> u8 {
    1 << pin.bit
}

/// TIMER1_COMPA.
///
/// Its body is one assembly block without an operand in a register, so the compiler adds nothing before or after the
/// block: a naked function, on every toolchain.
#[unsafe(no_mangle)]
pub(super) extern "C" fn __vector_17() -> ! {
    // SAFETY: every register it changes is restored; it returns by `reti` with the stack as it was. While interrupts
    // are on, nothing else touches the generator's state or takes segments.
    unsafe {
        asm!(
            // Toggles a pin if the motor's bit is set; 3 cycles, or 4 on ports that need `sts`.
            ".macro KERF_TOGGLE bits, motor, pin, mask",
            "    ldi  r24, \\mask",
            "    sbrc \\bits, \\motor",
            ".if \\pin < 0x40",
            "    out  \\pin - 0x20, r24",
            ".else",
            "    sts  \\pin, r24",
            ".endif",
            ".endm",
            ".macro KERF_STEP_TWO_PINS",
            "    KERF_TOGGLE r26, 0, {step0}, {step_mask0}",
            "    KERF_TOGGLE r26, 1, {step1}, {step_mask1}",
            ".endm",
            ".macro KERF_STEP_PINS",
            "    KERF_STEP_TWO_PINS",
            "    KERF_TOGGLE r26, 2, {step2}, {step_mask2}",
            "    KERF_TOGGLE r26, 3, {step3}, {step_mask3}",
            ".endm",
            // Sets r25 to the cycles that are left until the counter is at `settle`; carry if `settle` has passed.
            ".macro KERF_TO_SETTLE",
            "    lds  r25, {state} + {settle}",
            "    lds  r24, 0x84",
            "    sub  r25, r24",
            ".endm",
            // Waits for r25 cycles, exactly.
            ".macro KERF_WAIT",
            // One cycle for bit 0 of r25, two for bit 1, and four for each count of the bits above.
            "    lsr  r25",
            "    brcs 70f",
            "70:",
            "    lsr  r25",
            "    brcc 71f",
            "    nop",
            "    nop",
            "    nop",
            "71:",
            "    subi r25, 1",
            "    brcs 73f",
            "    rjmp 71b",
            "73:",
            ".endm",
            ".macro KERF_SETTLE",
            "    KERF_TO_SETTLE",
            "    brcs 77f",
            // Takes as many cycles as the decision between waiting and working below.
            "    nop",
            "    rjmp 78f",
            "78:",
            "    KERF_WAIT",
            "77:",
            ".endm",
            // Waits for `settle` as well, or jumps to `work`, which uses the time, if there is enough of it.
            ".macro KERF_SETTLE_OR work",
            "    KERF_TO_SETTLE",
            "    brcs 13f",
            "    cpi  r25, {ahead}",
            "    brlo 16f",
            "    rjmp \\work",
            "16:",
            "    KERF_WAIT",
            "13:",
            ".endm",
            // Counts a tick, or jumps to `used_up` at the end of the segment.
            ".macro KERF_COUNT used_up",
            "    in   r24, 0x2A",
            "    in   r25, 0x2B",
            "    sbiw r24, 1",
            "    brcc 75f",
            "    rjmp \\used_up",
            "75:",
            "    out  0x2A, r24",
            "    out  0x2B, r25",
            ".endm",
            // Adds the increment to a phase. Bit 15 of the sum becomes the motor's bit of r27.
            ".macro KERF_ADD motor",
            "    lds  r24, {state} + {phase} + 2 * \\motor",
            "    lds  r25, {state} + {increment} + 2 * \\motor",
            "    add  r24, r25",
            "    sts  {state} + {phase} + 2 * \\motor, r24",
            "    lds  r24, {state} + {phase} + 2 * \\motor + 1",
            "    lds  r25, {state} + {increment} + 2 * \\motor + 1",
            "    adc  r24, r25",
            "    bst  r24, 7",
            "    bld  r27, \\motor",
            "    andi r24, 0x7F",
            "    sts  {state} + {phase} + 2 * \\motor + 1, r24",
            ".endm",
            ".macro KERF_LOAD_INCREMENT motor",
            "    ldd  r24, Z + {s_increment} + 2 * \\motor",
            "    ldd  r25, Z + {s_increment} + 2 * \\motor + 1",
            "    sts  {state} + {increment} + 2 * \\motor, r24",
            "    sts  {state} + {increment} + 2 * \\motor + 1, r25",
            ".endm",
            // Reverses a motor if its bit of r27 is set: toggles the pin, and complements the phase.
            ".macro KERF_TURN motor, pin, mask",
            "    sbrs r27, \\motor",
            "    rjmp 74f",
            "    KERF_TOGGLE r27, \\motor, \\pin, \\mask",
            "    lds  r24, {state} + {phase} + 2 * \\motor",
            "    com  r24",
            "    sts  {state} + {phase} + 2 * \\motor, r24",
            "    lds  r24, {state} + {phase} + 2 * \\motor + 1",
            "    com  r24",
            "    andi r24, 0x7F",
            "    sts  {state} + {phase} + 2 * \\motor + 1, r24",
            "74:",
            ".endm",
            ".macro KERF_WIDEN turns",
            "    lds  r24, \\turns",
            "76:",
            "    dec  r24",
            "    brne 76b",
            ".endm",
            ".macro KERF_RETURN",
            "    pop  r27",
            "    pop  r26",
            "    pop  r25",
            "    pop  r24",
            "    out  0x3F, r24",
            "    pop  r24",
            "    reti",
            ".endm",
            "    push r24",
            "    in   r24, 0x3F",
            "    push r24",
            "    push r25",
            "    push r26",
            "    push r27",
            "    lds  r26, {state} + {due}",
            "    lds  r24, {state} + {mode}",
            "    tst  r24",
            "    breq 10f",
            "    brpl 8f",
            "    rjmp 1f",
            "8:",
            "    rjmp 40f",
            // Two motors at most.
            "10:",
            "    tst  r26",
            "    breq 11f",
            "    KERF_SETTLE_OR 50f",
            "    KERF_STEP_TWO_PINS",
            "11:",
            "    KERF_COUNT 20f",
            "12:",
            "    clr  r27",
            "    KERF_ADD 0",
            "    KERF_ADD 1",
            "    sts  {state} + {due}, r27",
            "    tst  r26",
            "    breq 15f",
            "    KERF_WIDEN {width}",
            "17:",
            "    KERF_STEP_TWO_PINS",
            "15:",
            "    KERF_RETURN",
            // There is enough time until `settle`: half of the work is done before the pulses.
            "50:",
            "    KERF_COUNT 61f",
            "    clr  r27",
            "    KERF_ADD 0",
            "    KERF_SETTLE",
            "    KERF_STEP_TWO_PINS",
            "    KERF_ADD 1",
            "    sts  {state} + {due}, r27",
            "    KERF_WIDEN {short_width}",
            "    rjmp 17b",
            // Lockstep: the motors that were due are due again.
            "1:",
            "    KERF_SETTLE",
            "    KERF_STEP_PINS",
            "    KERF_COUNT 20f",
            "    KERF_WIDEN {lockstep_width}",
            "    KERF_STEP_PINS",
            "    KERF_RETURN",
            // More than two motors.
            "40:",
            "    tst  r26",
            "    breq 41f",
            "    KERF_SETTLE_OR 60f",
            "    KERF_STEP_PINS",
            "41:",
            "    KERF_COUNT 20f",
            "42:",
            "    clr  r27",
            "    KERF_ADD 0",
            "47:",
            "    KERF_ADD 1",
            "    KERF_ADD 2",
            "    KERF_ADD 3",
            "43:",
            "    sts  {state} + {due}, r27",
            "    tst  r26",
            "    breq 45f",
            "    KERF_WIDEN {width}",
            "    KERF_STEP_PINS",
            "45:",
            "    KERF_RETURN",
            "60:",
            "    KERF_COUNT 61f",
            "    clr  r27",
            "    KERF_ADD 0",
            "    KERF_SETTLE",
            "    KERF_STEP_PINS",
            "    rjmp 47b",
            "61:",
            "    KERF_SETTLE",
            "    KERF_STEP_PINS",
            // The segment is used up: take the next one.
            "20:",
            "    push r30",
            "    push r31",
            "    lds  r30, {segments} + {tail}",
            "    lds  r24, {segments} + {head}",
            "    cp   r24, r30",
            "    brne 21f",
            "    rjmp 30f",
            "21:",
            "    inc  r30",
            "    andi r30, {last}",
            "    sts  {segments} + {tail}, r30",
            "    swap r30",
            "    ldi  r31, 0",
            "    subi r30, lo8(-({segments} + {slots}))",
            "    sbci r31, hi8(-({segments} + {slots}))",
            // The period is set first, because the counter is running towards the old top.
            "    ldd  r24, Z + {s_period}",
            "    ldd  r25, Z + {s_period} + 1",
            "    sbiw r24, 1",
            "    sts  0x89, r25",
            "    sts  0x88, r24",
            // If the counter is past the new top already, it restarts at 0. Otherwise it would run on to its highest
            // value.
            "    lds  r27, 0x84",
            "    cp   r24, r27",
            "    lds  r27, 0x85",
            "    cpc  r25, r27",
            "    brcc 22f",
            "    ldi  r24, 0",
            "    sts  0x85, r24",
            "    sts  0x84, r24",
            "22:",
            // A slot is free, which exec may fill.
            "    ldi  r24, {pended}",
            "    sts  {pend}, r24",
            "    ldd  r24, Z + {s_settle}",
            "    sts  {state} + {settle}, r24",
            "    lds  r27, {state} + {backwards}",
            "    ldd  r24, Z + {s_backwards}",
            "    eor  r27, r24",
            "    brne 23f",
            "    rjmp 24f",
            "23:",
            "    sts  {state} + {backwards}, r24",
            "    KERF_TURN 0, {dir0}, {dir_mask0}",
            "    KERF_TURN 1, {dir1}, {dir_mask1}",
            "    KERF_TURN 2, {dir2}, {dir_mask2}",
            "    KERF_TURN 3, {dir3}, {dir_mask3}",
            "24:",
            "    ldd  r24, Z + {s_ticks}",
            "    ldd  r25, Z + {s_ticks} + 1",
            "    sbiw r24, 1",
            "    out  0x2A, r24",
            "    out  0x2B, r25",
            "    ldd  r27, Z + {s_mode}",
            "    sts  {state} + {mode}, r27",
            "    tst  r27",
            "    brmi 25f",
            "    KERF_LOAD_INCREMENT 0",
            "    KERF_LOAD_INCREMENT 1",
            "    tst  r27",
            "    breq 27f",
            "    KERF_LOAD_INCREMENT 2",
            "    KERF_LOAD_INCREMENT 3",
            "    pop  r31",
            "    pop  r30",
            "    rjmp 42b",
            // Lockstep: the low bits of the mode say which motors are due.
            "25:",
            "    andi r27, 0x0F",
            "26:",
            "    pop  r31",
            "    pop  r30",
            "    rjmp 43b",
            // Two motors at most: a short path, so that the tick after this one is not late. The other motors do not
            // move, but their pins may still have to fall.
            "27:",
            "    clr  r27",
            "    sts  {state} + {increment} + 4, r27",
            "    sts  {state} + {increment} + 5, r27",
            "    sts  {state} + {increment} + 6, r27",
            "    sts  {state} + {increment} + 7, r27",
            "    KERF_ADD 0",
            "    KERF_ADD 1",
            "    rjmp 26b",
            // There is no next segment: stop the ticks.
            "30:",
            "    ldi  r24, {halt}",
            "    sts  0x81, r24",
            "    ldi  r24, {pended}",
            "    sts  {pend}, r24",
            "    clr  r27",
            "    sts  {running}, r27",
            "    sts  {state} + {mode}, r27",
            "    out  0x2A, r27",
            "    out  0x2B, r27",
            "    rjmp 26b",
            state = sym stepper::STATE,
            phase = const offset_of!(Dda, phase),
            increment = const offset_of!(Dda, increment),
            due = const offset_of!(Dda, due),
            backwards = const offset_of!(Dda, backwards),
            settle = const offset_of!(Dda, settle),
            mode = const offset_of!(Dda, mode),
            s_increment = const offset_of!(Segment, increment),
            s_ticks = const offset_of!(Segment, ticks),
            s_period = const offset_of!(Segment, period),
            s_backwards = const offset_of!(Segment, backwards),
            s_settle = const offset_of!(Segment, settle),
            s_mode = const offset_of!(Segment, mode),
            segments = sym stepper::SEGMENT_RING,
            slots = const Segments::SLOTS,
            head = const Segments::HEAD,
            tail = const Segments::TAIL,
            last = const SEGMENTS - 1,
            running = sym stepper::RUNNING,
            width = sym stepper::WIDTH,
            short_width = sym stepper::SHORT_WIDTH,
            ahead = const AHEAD,
            lockstep_width = sym stepper::LOCKSTEP_WIDTH,
            halt = const stepper::HALT,
            pend = const assembly::PEND,
            pended = const assembly::PENDED,
            step0 = const pin_register(ACTIVE.motors[0].step),
            step1 = const pin_register(ACTIVE.motors[1].step),
            step2 = const pin_register(ACTIVE.motors[2].step),
            step3 = const pin_register(ACTIVE.motors[3].step),
            step_mask0 = const mask(ACTIVE.motors[0].step),
            step_mask1 = const mask(ACTIVE.motors[1].step),
            step_mask2 = const mask(ACTIVE.motors[2].step),
            step_mask3 = const mask(ACTIVE.motors[3].step),
            dir0 = const pin_register(ACTIVE.motors[0].dir),
            dir1 = const pin_register(ACTIVE.motors[1].dir),
            dir2 = const pin_register(ACTIVE.motors[2].dir),
            dir3 = const pin_register(ACTIVE.motors[3].dir),
            dir_mask0 = const mask(ACTIVE.motors[0].dir),
            dir_mask1 = const mask(ACTIVE.motors[1].dir),
            dir_mask2 = const mask(ACTIVE.motors[2].dir),
            dir_mask3 = const mask(ACTIVE.motors[3].dir),
            options(noreturn),
        );
    }
}
