//! The step timer and what the step interrupt works on.
//!
//! Timer 1 counts CPU cycles up to the segment's tick period (CTC), so ticks are exact to the cycle
//! whatever the interrupt takes. The interrupt (`step_isr`) is level 0: it runs with interrupts off and
//! owns the step generator and the pins. Everything else here is for thread mode and exec.

use core::cell::UnsafeCell;
use kerf_macros::small;

use super::arithmetic::product;
use super::gpio;
use crate::boards::{ACTIVE, MOTORS, Timer, each_motor};
use crate::dda::Drivers;
use crate::dda::{Dda, SEGMENTS, Segment};
use crate::hal::byte::SharedByte;
use crate::hal::ring::{Producer, Ring};

const _: () = assert!(matches!(ACTIVE.step_timer, Timer::T1), "the step timer is timer 1");

const TCCR1B: *mut u8 = 0x81 as *mut u8;
const TCNT1: *mut u16 = 0x84 as *mut u16;
const OCR1A: *mut u16 = 0x88 as *mut u16;
const TIFR1: *mut u8 = (FLAGS + 0x20) as *mut u8;
const TIMSK1: *mut u8 = 0x6F as *mut u8;
/// General-purpose registers 1 and 2: the ticks left of the segment.
const TICKS: [*mut u8; 2] = [0x4A as *mut u8, 0x4B as *mut u8];
/// CTC with OCR1A as top, clock not divided.
const RUN: u8 = 1 << 3 | 1;
/// CTC with OCR1A as top, clock stopped.
pub(super) const HALT: u8 = 1 << 3;
const OCF1A: u8 = 1 << DUE;
/// The timer's flags, in the I/O space.
pub(super) const FLAGS: usize = 0x16;
/// The bit of [`FLAGS`] that says that a tick is due, and the one of [`TIMSK1`] that lets it interrupt.
pub(super) const DUE: u8 = 1;
const GPIOR1: *const u8 = 0x4A as *const u8;
const GPIOR2: *const u8 = 0x4B as *const u8;

/// Cycles from starting the timer to the first tick.
const FIRST_TICK: u16 = 400;

pub(super) static SEGMENT_RING: Ring<Segment, SEGMENTS> = Ring::new();
pub(super) static RUNNING: SharedByte = SharedByte::new(0);
/// Set by [`stop`].
static STOPPED: SharedByte = SharedByte::new(0);

/// How long pulses last, cycles, that no turn of a loop widens: in lockstep, with one motor left to add, and else.
const LOCKSTEP_CYCLES: u16 = 21;
/// See [`LOCKSTEP_CYCLES`].
const SHORT_CYCLES: u16 = 26;
/// See [`LOCKSTEP_CYCLES`].
const CYCLES: u16 = 49;

/// Turns of a loop of 3 cycles that widen a pulse, at least 1: in lockstep, with one motor left to add, and else.
pub(super) static LOCKSTEP_WIDTH: SharedByte =
    SharedByte::new(width_turns(Drivers::USUAL.pulse_us, LOCKSTEP_CYCLES));
/// See [`LOCKSTEP_WIDTH`]. [`set_step_output`] sets it at start-up: a first value would lie in flash as well.
pub(super) static SHORT_WIDTH: SharedByte = SharedByte::new(0);
/// See [`LOCKSTEP_WIDTH`].
pub(super) static WIDTH: SharedByte = SharedByte::new(width_turns(Drivers::USUAL.pulse_us, CYCLES));

/// The turns for pulses of `us` microseconds that last `cycles` without any.
const fn width_turns(us: u8, cycles: u16) -> u8 {
    let wanted = us as u16 * (ACTIVE.clock_hz / 1_000_000) as u16;
    let turns = wanted.saturating_sub(cycles).div_ceil(3);
    if turns == 0 { 1 } else { turns as u8 }
}

/// Bit m: motor m's direction pin is inverted.
static INVERTED: SharedByte = SharedByte::new(0);
/// Bit m: motor m's step pin rests high.
static STEP_INVERTED: SharedByte = SharedByte::new(0);

/// What the step interrupt owns.
#[repr(transparent)]
pub(super) struct Owned(UnsafeCell<Dda>);

// SAFETY: touched by the step interrupt only, and by exec while that is stopped.
unsafe impl Sync for Owned {}

pub(super) static STATE: Owned = Owned(UnsafeCell::new(Dda::new()));

/// Sets the timer up. Before interrupts are on; `None` after the first time.
pub fn start() -> Option<Producer<Segment, SEGMENTS>> {
    // The interrupt is the consumer.
    let (producer, _) = SEGMENT_RING.split()?;
    // SAFETY: interrupts are off, nobody else looks.
    unsafe {
        TCCR1B.write_volatile(HALT);
        TIMSK1.write_volatile(1 << DUE);
    }
    Some(producer)
}

/// Whether ticks interrupt: always, behind [`start`].
#[inline(always)]
pub(super) fn is_on() -> bool {
    // SAFETY: `start` alone writes it.
    unsafe { TIMSK1.read_volatile() & 1 << DUE != 0 }
}

/// Starts the ticks if they have stopped. For exec, after it has queued a segment.
///
/// A function of its own in the image: the bench counts segments by it.
#[inline(never)]
pub fn go() {
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
    // A stop that comes in between would be undone.
    avr_device::interrupt::free(|_| {
        if STOPPED.get() == 0 {
            // SAFETY: as above.
            unsafe { TCCR1B.write_volatile(RUN) };
        }
    });
}

/// Stops the ticks at once and until [`release`], wherever the motors are. Any level.
pub fn stop() {
    STOPPED.set(1);
    kill();
}

/// Whether they have been stopped.
pub fn is_stopped() -> bool {
    STOPPED.get() != 0
}

/// Ticks may come again. Thread mode, when the motors have [settled](settle).
pub fn release() {
    STOPPED.set(0);
}

/// Whether ticks are coming.
pub fn running() -> bool {
    RUNNING.get() != 0 && !is_stopped()
}

/// How long the segment that runs takes yet, CPU cycles. Exec.
pub fn left() -> u32 {
    let (ticks, top) = super::mask(|| {
        // SAFETY: reading has no effect.
        unsafe { (TICKS.map(|register| register.read_volatile()), OCR1A.read_volatile()) }
    });
    product(u16::from_le_bytes(ticks), top)
}

/// Every motor is where its last pulse has put it; nothing is left of the segments, of which `held` would have
/// come first after those that are queued. What they lack is taken off `position`. For exec, while no ticks come.
#[inline(never)]
#[small]
pub fn settle(mut held: Option<Segment>, position: &mut [i32; MOTORS]) {
    if running() {
        return;
    }
    // SAFETY: the timer stands still, so its interrupt does not run; exec alone starts it.
    let (dda, mut segments) = unsafe { (&mut *STATE.0.get(), SEGMENT_RING.stand_in()) };
    // SAFETY: as above: these are the interrupt's as well.
    dda.ticks = u16::from_le_bytes(TICKS.map(|register| unsafe { register.read_volatile() }));
    dda.settle(|| segments.pop().or_else(|| held.take()), position);
    for register in TICKS {
        // SAFETY: as above.
        unsafe { register.write_volatile(0) };
    }
    RUNNING.set(0);
}

/// Where the generator is right now, between two ticks, and the slot of its segment. For the sampling interrupt, which
/// holds exec off.
pub fn moment() -> (Dda, u8) {
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
        // In lockstep the state has no increments, but the segment has.
        // SAFETY: one has been taken. Another may have been since, but exec, which is held off, has not refilled
        // the slot.
        dda.increment = unsafe { SEGMENT_RING.at(tail) }.increment;
    }
    (dda, tail)
}

/// Which direction pins are inverted: bit m for motor m. For thread mode, while nothing runs.
pub fn set_inverted(motors: u8) {
    let changed = motors ^ INVERTED.get();
    INVERTED.set(motors);
    each_motor!(M => if changed & (1 << M) != 0 {
        gpio::toggle(ACTIVE.motors[M].dir);
    });
}

/// How wide a step pulse is, in microseconds, and which step pins rest high (bit m for motor m). For
/// thread mode; a change only while nothing runs.
pub fn set_step_output(pulse_us: u8, inverted: u8) {
    LOCKSTEP_WIDTH.set(width_turns(pulse_us, LOCKSTEP_CYCLES));
    SHORT_WIDTH.set(width_turns(pulse_us, SHORT_CYCLES));
    WIDTH.set(width_turns(pulse_us, CYCLES));
    let changed = inverted ^ STEP_INVERTED.get();
    STEP_INVERTED.set(inverted);
    // The interrupt toggles pins, so that the level at rest is all there is to polarity.
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
