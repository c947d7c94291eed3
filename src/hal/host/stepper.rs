//! The step timer on the host: the real step generator, which ticks in mocked time, with pins that count.

use core::cell::{Cell, RefCell};
use std::vec::Vec;

use super::{NEVER, exec, inputs, now};
use crate::boards::{MOTORS, inputs as board_inputs};
use crate::dda::{Dda, Pins, SEGMENTS, Segment};
use crate::hal::ring::{Consumer, Ring};
use crate::hal::segments::Segments;
use crate::hal::{Boot, Interrupt, Thread};

const FIRST_TICK: u64 = 400;

/// What the pins have done so far.
#[derive(Clone, Debug, Default)]
pub struct Emitted {
    /// Position of each motor by its pulses.
    pub position: [i64; MOTORS],
    /// Pulses of each motor.
    pub steps: [u64; MOTORS],
}

/// A switch that a motor actuates.
struct Near {
    input: usize,
    motor: usize,
    step: i64,
    /// The contact opens at `step` instead of closing.
    opens: bool,
    closed: bool,
}

impl Near {
    /// Opens or closes the contact, with the motor at `position`.
    fn look(&mut self, position: i64) {
        let upper = self.input < board_inputs::ENDS && self.input % 2 == 1;
        let worked = if upper { position >= self.step } else { position <= self.step };
        let closed = worked != self.opens;
        if closed != self.closed {
            self.closed = closed;
            inputs::set(self.input, !closed);
        }
    }
}

struct Pinned {
    near: Vec<Near>,
    backwards: u8,
    period: u64,
    stopped: bool,
    emitted: Emitted,
}

struct Stepper {
    segments: RefCell<Option<Consumer<Segment, SEGMENTS>>>,
    dda: RefCell<Dda>,
    pins: RefCell<Pinned>,
    next_tick: Cell<u64>,
    output: Cell<(u8, u8)>,
    halted: Cell<bool>,
}

machine_static! {
    fn ring() -> Ring<Segment, SEGMENTS> = Ring::new();
    fn stepper() -> Stepper = Stepper {
        segments: RefCell::new(None),
        dda: RefCell::new(Dda::new()),
        pins: RefCell::new(Pinned {
            near: Vec::new(),
            backwards: 0,
            period: 0,
            stopped: true,
            emitted: Emitted::default(),
        }),
        next_tick: Cell::new(NEVER),
        output: Cell::new((0, 0)),
        halted: Cell::new(false),
    };
}

impl Pins for Pinned {
    fn rise(&mut self, motors: u8) {
        for m in 0..MOTORS {
            if motors & (1 << m) != 0 {
                let backwards = self.backwards & (1 << m) != 0;
                self.emitted.position[m] += if backwards { -1 } else { 1 };
                self.emitted.steps[m] += 1;
                let at = self.emitted.position[m];
                self.near.iter_mut().filter(|n| n.motor == m).for_each(|n| n.look(at));
            }
        }
    }

    fn fall(&mut self, _motors: u8) {}

    fn direction(&mut self, backwards: u8) {
        self.backwards = backwards;
    }

    fn period(&mut self, cycles: u16) {
        self.period = u64::from(cycles);
    }

    fn slot_free(&mut self) {
        exec::pend();
    }

    fn stop(&mut self) {
        self.stopped = true;
        exec::pend();
    }
}

/// Sets the timer up and returns the filling end of the segment ring; `None` after the first time.
pub fn start(_: &Boot) -> Option<Segments> {
    let (producer, consumer) = ring().split()?;
    stepper().segments.replace(Some(consumer));
    // SAFETY: the mocked step interrupt alone reads the ring. It never runs within exec, and copies each segment.
    Some(unsafe { Segments::new(producer) })
}

/// Starts the ticks if they have stopped.
pub fn go(_: Interrupt) {
    if !running() && !stepper().halted.get() {
        let mut pins = stepper().pins.borrow_mut();
        pins.stopped = false;
        pins.period = FIRST_TICK;
        stepper().next_tick.set(now() + FIRST_TICK);
    }
}

/// Stops the ticks at once, wherever the motors are; they stay stopped until [`release`].
pub fn stop() {
    stepper().halted.set(true);
    stepper().next_tick.set(NEVER);
}

/// Whether [`stop`] has stopped the ticks and nothing has released them.
pub fn is_stopped() -> bool {
    stepper().halted.get()
}

/// Allows ticks again after a stop.
pub fn release(_: Thread) {
    stepper().halted.set(false);
}

/// Whether ticks are coming.
pub fn running() -> bool {
    stepper().next_tick.get() != NEVER
}

/// Returns how long the running segment still takes, in cycles.
pub fn left(_: Interrupt) -> u32 {
    let stepper = stepper();
    u32::from(stepper.dda.borrow().ticks) * stepper.pins.borrow().period as u32
}

/// Drops the rest of all segments after a stop, so that every motor stands where its last pulse has put it. `held` is
/// the segment that would have come next after the queued ones. Subtracts the steps that were not made from `position`.
/// Call it while no ticks come.
pub fn settle(_: Interrupt, mut held: Option<Segment>, position: &mut [i32; MOTORS]) {
    if running() {
        return;
    }
    let mut segments = stepper().segments.borrow_mut();
    let mut queued = || segments.as_mut().and_then(Consumer::pop).or_else(|| held.take());
    stepper().dda.borrow_mut().settle(&mut queued, position);
}

/// Returns the state of the generator now, and the slot of its segment.
pub(super) fn moment() -> (Dda, u8) {
    (stepper().dda.borrow().clone(), ring().tail())
}

/// Does nothing: positions are counted before pins are inverted.
pub fn set_inverted(_: Thread, _motors: u8) {}

/// Keeps the width of a step pulse, in microseconds, and which step pins rest high, for tests. They have no other
/// effect here.
pub fn set_step_output(_: Thread, pulse_us: u8, inverted: u8) {
    stepper().output.set((pulse_us, inverted));
}

/// Returns what [`set_step_output`] has set: the pulse width, and the inverted motors as bits.
pub fn step_output() -> (u8, u8) {
    stepper().output.get()
}

/// Makes the motor of an axis actuate the switch at an input from now on: see
/// [`Machine::set_near`](super::Machine::set_near).
pub(super) fn set_near(input: usize, step: i64, opens: bool) {
    let motor = if input < board_inputs::ENDS { input / 2 } else { 2 };
    let mut pins = stepper().pins.borrow_mut();
    let mut near = Near { input, motor, step, opens, closed: false };
    near.look(pins.emitted.position[motor]);
    pins.near.push(near);
}

/// Returns what the pins have done so far.
pub fn emitted() -> Emitted {
    stepper().pins.borrow().emitted.clone()
}

/// Returns when the next tick is due.
pub(super) fn next_tick() -> u64 {
    stepper().next_tick.get()
}

/// Carries out a tick, at its time.
pub(super) fn tick() {
    let s = stepper();
    let mut pins = s.pins.borrow_mut();
    if let Some(segments) = s.segments.borrow_mut().as_mut() {
        s.dda.borrow_mut().tick(&mut *pins, segments);
    }
    let next = if pins.stopped { NEVER } else { now() + pins.period };
    s.next_tick.set(next);
}
