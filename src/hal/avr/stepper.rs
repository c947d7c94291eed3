//! The step timer, and the data that the step interrupt works on.
//!
//! Timer 1 counts CPU cycles up to the tick period of the segment (CTC mode), so ticks are exact to the cycle however
//! long the interrupt takes. The interrupt (`step_isr`) is level 0: it runs with interrupts off and owns the step
//! generator and the pins. All other functions here are for thread mode and exec.

use core::cell::UnsafeCell;
use kerf_macros::small;

use super::arithmetic::product;
use super::gpio;
use crate::boards::{ACTIVE, MOTORS, Timer, each_motor};
use crate::dda::Drivers;
use crate::dda::{Dda, SEGMENTS, Segment};
use crate::hal::byte::SharedByte;
use crate::hal::ring::Ring;
use crate::hal::segments::Segments;
use crate::hal::{Boot, Interrupt, Thread};

const _: () = assert!(matches!(ACTIVE.step_timer, Timer::T1), "the step timer is timer 1");

const TCCR1B: *mut u8 = 0x81 as *mut u8;
const TCNT1: *mut u16 = 0x84 as *mut u16;
const OCR1A: *mut u16 = 0x88 as *mut u16;
const TIFR1: *mut u8 = (FLAGS + 0x20) as *mut u8;
const TIMSK1: *mut u8 = 0x6F as *mut u8;
/// General-purpose registers 1 and 2: the ticks that are left of the segment.
const TICKS: [*mut u8; 2] = [0x4A as *mut u8, 0x4B as *mut u8];
/// CTC with OCR1A as top, clock not divided.
const RUN: u8 = 1 << 3 | 1;
/// CTC with OCR1A as top, clock stopped.
pub(super) const HALT: u8 = 1 << 3;
const OCF1A: u8 = 1 << DUE;
/// The timer's flags, in the I/O space.
pub(super) const FLAGS: usize = 0x16;
/// The bit of [`FLAGS`] that says that a tick is due. In [`TIMSK1`] the same bit enables the interrupt.
pub(super) const DUE: u8 = 1;
const GPIOR1: *const u8 = 0x4A as *const u8;
const GPIOR2: *const u8 = 0x4B as *const u8;

/// Cycles from starting the timer to the first tick.
const FIRST_TICK: u16 = 400;

pub(super) static SEGMENT_RING: Ring<Segment, SEGMENTS> = Ring::new();
pub(super) static RUNNING: SharedByte = SharedByte::new(0);
/// Set by [`stop`].
static STOPPED: SharedByte = SharedByte::new(0);

/// Length of a pulse in cycles, without the loop that widens it: in lockstep. [`SHORT_CYCLES`] is the length if one
/// motor is left to advance, [`CYCLES`] the length in all other cases.
const LOCKSTEP_CYCLES: u16 = 21;
/// See [`LOCKSTEP_CYCLES`].
const SHORT_CYCLES: u16 = 26;
/// See [`LOCKSTEP_CYCLES`].
const CYCLES: u16 = 49;

/// Turns of the loop of 3 cycles that widens a pulse, at least 1: in lockstep. [`SHORT_WIDTH`] is for ticks with one
/// motor left to advance, [`WIDTH`] for all others.
pub(super) static LOCKSTEP_WIDTH: SharedByte =
    SharedByte::new(width_turns(Drivers::USUAL.pulse_us, LOCKSTEP_CYCLES));
/// See [`LOCKSTEP_WIDTH`]. [`set_step_output`] sets it at start-up; an initial value would cost flash.
pub(super) static SHORT_WIDTH: SharedByte = SharedByte::new(0);
/// See [`LOCKSTEP_WIDTH`].
pub(super) static WIDTH: SharedByte = SharedByte::new(width_turns(Drivers::USUAL.pulse_us, CYCLES));

/// Returns the turns for pulses of `us` microseconds that last `cycles` without the loop.
const fn width_turns(us: u8, cycles: u16) -> u8 {
    let wanted = us as u16 * (ACTIVE.clock_hz / 1_000_000) as u16;
    let turns = wanted.saturating_sub(cycles).div_ceil(3);
    if turns == 0 { 1 } else { turns as u8 }
}

/// Bit m: motor m's direction pin is inverted.
static INVERTED: SharedByte = SharedByte::new(0);
/// Bit m: motor m's step pin rests high.
static STEP_INVERTED: SharedByte = SharedByte::new(0);

/// The state that the step interrupt owns.
#[repr(transparent)]
pub(super) struct Owned(UnsafeCell<Dda>);

// SAFETY: only the step interrupt touches it, and exec while that interrupt is stopped.
unsafe impl Sync for Owned {}

pub(super) static STATE: Owned = Owned(UnsafeCell::new(Dda::new()));

/// Sets the timer up and returns the filling end of the segment ring. `None` after the first time.
pub fn start(_: &Boot) -> Option<Segments> {
    // The interrupt is the consumer.
    let (producer, _) = SEGMENT_RING.split()?;
    // SAFETY: interrupts are off, nobody else looks.
    unsafe {
        TCCR1B.write_volatile(HALT);
        TIMSK1.write_volatile(1 << DUE);
    }
    // SAFETY: the step interrupt alone reads the ring, and copies each segment.
    Some(unsafe { Segments::new(producer) })
}

/// Whether the interrupt of the ticks is enabled: always true after [`start`].
#[inline(always)]
pub(super) fn is_on() -> bool {
    // SAFETY: only `start` writes this register.
    unsafe { TIMSK1.read_volatile() & 1 << DUE != 0 }
}

/// Starts the ticks if they have stopped. Exec calls it after it has queued a segment.
///
/// It is never inlined, because the bench counts segments by its calls.
#[inline(never)]
pub fn go(_: Interrupt) {
    if RUNNING.get() != 0 {
        return;
    }
    RUNNING.set(1);
    // SAFETY: the timer stands still, so its interrupt cannot interfere.
    unsafe {
        TCNT1.write_volatile(0);
        OCR1A.write_volatile(FIRST_TICK);
        TIFR1.write_volatile(OCF1A);
    }
    // Interrupts are off, or a stop that comes in between would be undone.
    avr_device::interrupt::free(|_| {
        if STOPPED.get() == 0 {
            // SAFETY: as above.
            unsafe { TCCR1B.write_volatile(RUN) };
        }
    });
}

/// Stops the ticks at once, wherever the motors are; they stay stopped until [`release`]. Any level.
pub fn stop() {
    STOPPED.set(1);
    kill();
}

/// Whether [`stop`] has stopped the ticks and nothing has released them.
pub fn is_stopped() -> bool {
    STOPPED.get() != 0
}

/// Allows ticks again after a stop. Call it when the motors have [settled](settle).
pub fn release(_: Thread) {
    STOPPED.set(0);
}

/// Whether ticks are coming.
pub fn running() -> bool {
    RUNNING.get() != 0 && !is_stopped()
}

/// Returns how long the running segment still takes, in CPU cycles.
pub fn left(_: Interrupt) -> u32 {
    let (ticks, top) = super::mask(|| {
        // SAFETY: reading has no effect.
        unsafe { (TICKS.map(|register| register.read_volatile()), OCR1A.read_volatile()) }
    });
    product(u16::from_le_bytes(ticks), top)
}

/// Drops the rest of all segments after a stop, so that every motor stands where its last pulse has put it. `held` is
/// the segment that would have come next after the queued ones. Subtracts the steps that were not made from `position`.
/// Call it while no ticks come.
#[inline(never)]
#[small]
pub fn settle(_: Interrupt, mut held: Option<Segment>, position: &mut [i32; MOTORS]) {
    if running() {
        return;
    }
    // SAFETY: the timer stands still, so its interrupt does not run; only exec starts the timer.
    let (dda, mut segments) = unsafe { (&mut *STATE.0.get(), SEGMENT_RING.stand_in()) };
    // SAFETY: as above; these registers belong to the interrupt, too.
    dda.ticks = u16::from_le_bytes(TICKS.map(|register| unsafe { register.read_volatile() }));
    dda.settle(|| segments.pop().or_else(|| held.take()), position);
    for register in TICKS {
        // SAFETY: as above.
        unsafe { register.write_volatile(0) };
    }
    RUNNING.set(0);
}

/// Returns the state of the generator between two ticks, and the slot of its segment. Only for the sampling
/// interrupt, which holds exec off.
pub(super) fn moment() -> (Dda, u8) {
    let mut dda = Dda::new();
    let mut tail = 0;
    avr_device::interrupt::free(|_| {
        // SAFETY: the step interrupt cannot come in between.
        let state = unsafe { &*STATE.0.get() };
        (dda.phase, dda.due, dda.backwards) = (state.phase, state.due, state.backwards);
        // SAFETY: reading has no effect. The count of ticks is in registers, not in the state.
        dda.ticks = u16::from_le_bytes(unsafe { [GPIOR1.read_volatile(), GPIOR2.read_volatile()] });
        tail = SEGMENT_RING.tail();
    });
    if dda.ticks > 0 {
        // In lockstep the state has no increments, so they are read from the segment.
        // SAFETY: a segment has been taken from this slot. Another may have been taken since, but exec, which is held
        // off, has not refilled the slot.
        dda.increment = unsafe { SEGMENT_RING.at(tail) }.increment;
    }
    (dda, tail)
}

/// Sets which direction pins are inverted: bit m for motor m. Call it while nothing runs.
pub fn set_inverted(_: Thread, motors: u8) {
    let changed = motors ^ INVERTED.get();
    INVERTED.set(motors);
    each_motor!(M => if changed & (1 << M) != 0 {
        gpio::toggle(ACTIVE.motors[M].dir);
    });
}

/// Sets the width of a step pulse, in microseconds, and which step pins rest high (bit m for motor m). The values may
/// change only while nothing runs.
pub fn set_step_output(_: Thread, pulse_us: u8, inverted: u8) {
    LOCKSTEP_WIDTH.set(width_turns(pulse_us, LOCKSTEP_CYCLES));
    SHORT_WIDTH.set(width_turns(pulse_us, SHORT_CYCLES));
    WIDTH.set(width_turns(pulse_us, CYCLES));
    let changed = inverted ^ STEP_INVERTED.get();
    STEP_INVERTED.set(inverted);
    // The interrupt toggles pins, so the level at rest determines the polarity of the pulses.
    each_motor!(M => if changed & (1 << M) != 0 {
        gpio::toggle(ACTIVE.motors[M].step);
    });
}

/// Stops the ticks at once, wherever the motors are. Also for the panic handler.
pub fn kill() {
    // SAFETY: two stores; the machine stops for good, and a tick that is due does not come.
    unsafe {
        TCCR1B.write_volatile(HALT);
        TIFR1.write_volatile(OCF1A);
    }
}
