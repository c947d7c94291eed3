//! The step timer and the step interrupt.
//!
//! Timer 1 counts CPU cycles up to the segment's tick period (CTC), so ticks are exact to the cycle
//! whatever the interrupt takes. The interrupt (`step_isr`) is level 0: it runs with interrupts off and
//! owns the step generator and the pins.

use core::cell::UnsafeCell;

use super::exec;
use super::gpio::{self, each_motor};
use crate::boards::{ACTIVE, Timer};
use crate::hal::byte::SharedByte;
use crate::hal::ring::{Consumer, Producer, Ring};
use crate::motion::dda::{Dda, Pins, SEGMENTS, Segment};

const _: () = assert!(matches!(ACTIVE.step_timer, Timer::T1), "the step timer is timer 1");

const TCCR1B: *mut u8 = 0x81 as *mut u8;
const TCNT1: *mut u16 = 0x84 as *mut u16;
const OCR1A: *mut u16 = 0x88 as *mut u16;
const TIFR1: *mut u8 = 0x36 as *mut u8;
const TIMSK1: *mut u8 = 0x6F as *mut u8;
/// CTC with OCR1A as top, clock not divided.
const RUN: u8 = 1 << 3 | 1;
/// The same, stopped.
const HALT: u8 = 1 << 3;
const OCF1A: u8 = 1 << 1;

/// Cycles from starting the timer to the first tick.
const FIRST_TICK: u16 = 400;

static RING: Ring<Segment, SEGMENTS> = Ring::new();
static RUNNING: SharedByte = SharedByte::new(0);
/// Bit m: motor m's direction pin is inverted.
static INVERTED: SharedByte = SharedByte::new(0);
/// Bit m: motor m's step pin rests high.
static STEP_INVERTED: SharedByte = SharedByte::new(0);
/// How wide a step pulse is, microseconds.
static PULSE_US: SharedByte = SharedByte::new(2);

/// What the step interrupt owns. The generator comes first: the assembly counts on it.
#[repr(C)]
pub(super) struct Level0 {
    dda: Dda,
    segments: Option<Consumer<Segment, SEGMENTS>>,
}

#[repr(transparent)]
pub(super) struct Owned(UnsafeCell<Level0>);

// SAFETY: touched by the step interrupt only, after `start`, which runs before interrupts are on.
unsafe impl Sync for Owned {}

pub(super) static STATE: Owned = Owned(UnsafeCell::new(Level0 { dda: Dda::new(), segments: None }));

/// Sets the timer up. Before interrupts are on; `None` after the first time.
pub fn start() -> Option<Producer<Segment, SEGMENTS>> {
    let (producer, consumer) = RING.split()?;
    // SAFETY: interrupts are off, nobody else looks.
    unsafe {
        (*STATE.0.get()).segments = Some(consumer);
        TCCR1B.write_volatile(HALT);
        TIMSK1.write_volatile(1 << 1);
    }
    Some(producer)
}

/// Starts the ticks if they have stopped. For exec, after it has queued a segment.
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
        TCCR1B.write_volatile(RUN);
    }
}

/// Whether ticks are coming.
pub fn running() -> bool {
    RUNNING.get() != 0
}

/// Which direction pins are inverted: bit m for motor m. Takes effect with the next segment.
pub fn set_inverted(motors: u8) {
    INVERTED.set(motors);
}

/// How wide a step pulse is, in microseconds, and which step pins rest high (bit m for motor m). The
/// pins go to rest at once if nothing moves. Thread mode.
pub fn set_step_output(pulse_us: u8, inverted: u8) {
    PULSE_US.set(pulse_us);
    STEP_INVERTED.set(inverted);
    // Exec could start the ticks in between; the pins are the interrupt's then.
    exec::lock(|_| {
        if !running() {
            rest(inverted);
        }
    });
}

/// Step pins at the level between pulses.
fn rest(inverted: u8) {
    each_motor!(M => if inverted & (1 << M) != 0 {
        gpio::high(ACTIVE.motors[M].step);
    } else {
        gpio::low(ACTIVE.motors[M].step);
    });
}

/// Stops the ticks at once, wherever the motors are. For the panic handler.
pub fn kill() {
    // SAFETY: a single store; the machine stops for good.
    unsafe { TCCR1B.write_volatile(HALT) };
}

/// Loads the next segment for the interrupt. Called by it alone, at level 0. Whether there was one.
pub(super) extern "C" fn load() -> bool {
    // SAFETY: the interrupt owns it, and does not nest.
    let state = unsafe { &mut *STATE.0.get() };
    match &mut state.segments {
        Some(segments) => state.dda.load(&mut BoardPins, segments),
        None => false,
    }
}

/// No segment is left: no more ticks. Called by the interrupt alone, at level 0.
pub(super) extern "C" fn halt() {
    BoardPins.stop();
}

struct BoardPins;

impl Pins for BoardPins {
    // The assembly does these two itself.
    fn rise(&mut self, _motors: u8) {}
    fn fall(&mut self, _motors: u8) {}

    #[inline(always)]
    fn direction(&mut self, backwards: u8) {
        let level = backwards ^ INVERTED.get();
        each_motor!(M => if level & (1 << M) != 0 {
            gpio::high(ACTIVE.motors[M].dir);
        } else {
            gpio::low(ACTIVE.motors[M].dir);
        });
    }

    #[inline(always)]
    fn period(&mut self, cycles: u16) {
        // Comes first when a segment is loaded, 190 cycles behind the tick and 250 at the latest: the
        // counter has not reached the shortest top there is.
        // SAFETY: the step timer's register, at level 0.
        unsafe { OCR1A.write_volatile(cycles - 1) };
    }

    #[inline(always)]
    fn slot_free(&mut self) {
        exec::pend();
    }

    #[inline(always)]
    fn stop(&mut self) {
        // SAFETY: the step timer's register, at level 0.
        unsafe { TCCR1B.write_volatile(HALT) };
        RUNNING.set(0);
        exec::pend();
    }
}
