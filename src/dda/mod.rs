//! The step generator: the work of one tick of the step timer, without any register.
//!
//! Owned by the step interrupt (level 0). Each motor has a phase below [`STEP`], which is one step. A tick adds the
//! segment's increment to the phase. When the sum sets bit 15, the bit is cleared and a step is due. So a motor steps
//! at most once a tick: on every tick if its increment is `STEP`, and exactly on every `2^k`th tick if its increment is
//! `STEP / 2^k`.
//!
//! On AVR [`Dda::tick`] is replaced by an equivalent in assembly (`hal/avr/step_isr.rs`), which uses the fields of
//! [`Dda`] and [`Segment`]. The host runs the Rust version.
//!
//! ```text
//!   tick   n-1          n           n+1
//!          |            |            |
//!          +-settle     +-settle     +-settle  wait for the segment's `settle`, if a pulse is due
//!          +-out        +-out        +-out     step pins rise: the bits computed one tick before
//!          +-load?      +-load?      +-load?   segment used up: take the next, set directions
//!          +-add        +-add        +-add     phases advance, bits for the next tick
//!          +-fall       +-fall       +-fall    step pins fall
//! ```
//!
//! Pins rise first, so that the time of a pulse does not depend on the computation. They fall last, so that a pulse
//! is as wide as the computation takes. Directions change after the last pulse of the old segment and a whole tick
//! before the first pulse of the new one.
//!
//! The interrupt may start late, after another one. If the tick period leaves time for it, a segment gives the cycle of
//! the tick at which its pulses rise (`settle`). This cycle is so late that no other interrupt can delay the pulses,
//! which makes them exact to the cycle.
//!
//! In *lockstep* all motors that move step on every tick: phases do not change, and the interrupt has nothing to add.
//! This gives the highest step rates.
//!
//! A phase is the motor's true position between steps. When the direction of a motor reverses, its phase is
//! complemented: counting the complement up equals counting the phase down, so the fraction of a step is kept at a
//! reversal.

use kerf_macros::small;

use avr_embassy::ring::Consumer;

use crate::boards::{MOTORS, STEPS_BY_UNIT};

pub mod contact;
pub mod step_replay;

/// A step, in phase units.
pub const STEP: u16 = 1 << STEP_LOG2;
/// The exponent of [`STEP`].
pub const STEP_LOG2: u8 = 15;

/// Where phases start: a little past half a step, so that a position is rounded to the nearest step. A rounding
/// remainder of up to [`PHASE_MARGIN`] from earlier segments never shifts a step of a motor that runs on exact ticks.
pub const PHASE_START: u16 = STEP / 2 + PHASE_MARGIN;

/// How far [`PHASE_START`] is past half a step, in phase units.
pub const PHASE_MARGIN: u16 = if STEPS_BY_UNIT { 2200 } else { 1024 };

/// Most ticks of a segment: keeps the rounding remainder below [`PHASE_MARGIN`].
pub const TICKS_MAX: u16 = if STEPS_BY_UNIT { 4200 } else { 2000 };

/// The phase of a motor at a whole step, as counted in the motor's direction.
pub const fn start(backwards: bool) -> u16 {
    if backwards { STEP - 1 - PHASE_START } else { PHASE_START }
}

/// Segments prepared ahead, plus one slot that stays empty. A power of two, for the assembly.
pub const SEGMENTS: usize = 8;

/// A stretch of constant velocity, ready for the interrupt. The assembly knows its layout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Segment {
    /// Phase added per tick, 0 to [`STEP`].
    pub increment: [u16; MOTORS],
    /// Number of ticks, at least 1.
    pub ticks: u16,
    /// CPU cycles from tick to tick.
    pub period: u16,
    /// Bit m set: motor m runs backwards.
    pub backwards: u8,
    /// CPU cycles from a tick to its pulses; 0 for pulses as soon as possible.
    pub settle: u8,
    /// Selects the fast path of the interrupt: [`NARROW`], [`WIDE`], or [`LOCKSTEP`] with the bits of the motors that
    /// step on every tick. Set by [`Segment::seal`].
    pub mode: u8,
    /// Motors that move in the segment's block, as bits; none in a pause. Used to power the drivers; the interrupt
    /// does not read it. It makes the segment 16 bytes long.
    pub moving: u8,
}

/// Only the first two motors move.
pub const NARROW: u8 = 0;
/// Motors beyond the first two move.
pub const WIDE: u8 = 1;
/// All motors that move step on every tick.
pub const LOCKSTEP: u8 = 0x80;

impl Segment {
    /// Sets `mode`: the motors `full` (bits) travel `step` a tick, the other motors that move travel less. Cost: 20.
    #[inline]
    pub fn seal(&mut self, full: u8, step: u16) {
        self.mode = if step == STEP && self.moving == full {
            LOCKSTEP | full
        } else {
            Self::mode_of(self.moving)
        };
    }

    /// Returns the mode of a segment in which the motors `moving` (bits) move at rates of their own.
    #[inline(always)]
    pub fn mode_of(moving: u8) -> u8 {
        if moving & !0b11 != 0 { WIDE } else { NARROW }
    }

    /// Adds the distance that the segment moves each motor, in phase units, to `ways`.
    fn add_way(&self, ways: &mut [i32; MOTORS]) {
        for (m, way) in ways.iter_mut().enumerate() {
            let far = (u32::from(self.increment[m]) * u32::from(self.ticks)) as i32;
            *way = way.wrapping_add(if self.backwards & 1 << m != 0 { -far } else { far });
        }
    }
}

/// Tick period limits of a chip with usual pulses ([`Drivers::USUAL`]), for a given number of motors that move. All
/// fields are periods, as in [`Segment::period`].
#[derive(Clone, Copy, Debug)]
pub struct Ticks {
    /// Period at the highest step rate, which is that of lockstep.
    pub step: u16,
    /// Shortest period: the step interrupt, a short interrupt before it, and some time for everything else.
    pub shortest: u16,
    /// Period in steady motion, as short as leaves exec and the planner a third of the CPU.
    pub fine: u16,
    /// Period in short blocks, which leave exec and the planner more of the CPU.
    pub coarse: u16,
    /// Period in blocks so short that they are one segment.
    pub coarsest: u16,
    /// From this period on, pulses are delayed by the interrupt's worst latency ([`Segment::settle`]).
    pub settles: u16,
}

/// What the motor drivers require of the signals at their pins.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Drivers {
    /// How long a step pulse lasts, us.
    pub pulse_us: u8,
    /// How long a direction must be stable before the first step, us.
    pub setup_us: u8,
}

/// The outputs of the step generator.
pub trait Pins {
    /// Raises the step pins in `motors` (bit m: motor m).
    fn rise(&mut self, motors: u8);
    /// Lets the step pins in `motors` fall.
    fn fall(&mut self, motors: u8);
    /// Sets all direction pins (bit m set: motor m runs backwards).
    fn direction(&mut self, backwards: u8);
    /// Sets the tick period from now on, in CPU cycles.
    fn period(&mut self, cycles: u16);
    /// Tells exec that a segment slot is free.
    fn slot_free(&mut self);
    /// Stops the ticks, because there is no segment.
    fn stop(&mut self);
}

/// The generator's state. The assembly knows its layout by `offset_of`.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Dda {
    /// The position of each motor between two steps, below [`STEP`].
    pub(crate) phase: [u16; MOTORS],
    pub(crate) increment: [u16; MOTORS],
    /// Ticks left of the running segment.
    pub(crate) ticks: u16,
    /// Steps due at the next tick, bit m for motor m.
    pub(crate) due: u8,
    pub(crate) backwards: u8,
    /// [`Segment::settle`] of the running segment.
    pub(crate) settle: u8,
    /// [`Segment::mode`] of the running segment.
    pub(crate) mode: u8,
}

impl Dda {
    /// A generator at a standstill.
    pub const fn new() -> Self {
        Self {
            phase: [PHASE_START; MOTORS],
            increment: [0; MOTORS],
            ticks: 0,
            due: 0,
            backwards: 0,
            settle: 0,
            mode: NARROW,
        }
    }

    /// Sets every motor to the position of its last pulse, without a fraction of a step. Subtracts from `position` the
    /// steps that the remainder of the running segment, and the segments that `queued` returns, would have made. Exec
    /// calls this while no ticks come; the result is exact wherever the ticks were stopped. Cost: 1,200, and 600 a
    /// segment.
    #[inline(never)]
    #[small]
    pub fn settle(
        &mut self,
        mut queued: impl FnMut() -> Option<Segment>,
        position: &mut [i32; MOTORS],
    ) {
        // Phases as they count forwards; then the distance to the end of the last segment is added.
        let mut ends = [0i32; MOTORS];
        for (m, end) in ends.iter_mut().enumerate() {
            let (phase, backwards) = (self.phase[m], self.backwards & 1 << m != 0);
            *end = i32::from(if backwards { STEP - 1 - phase } else { phase });
        }
        let mut next = Some(self.rest());
        while let Some(segment) = next {
            segment.add_way(&mut ends);
            next = queued();
        }
        for (m, position) in position.iter_mut().enumerate() {
            let bit = 1 << m;
            let backwards = self.backwards & bit != 0;
            let due = i32::from(self.due & bit != 0);
            let missing = (ends[m] >> 15) + if backwards { -due } else { due };
            *position = position.wrapping_sub(missing);
            self.phase[m] = start(backwards);
        }
        (self.ticks, self.due, self.mode) = (0, 0, NARROW);
    }

    /// Returns the remainder of the running segment.
    fn rest(&self) -> Segment {
        let Self { mut increment, ticks, backwards, mode, .. } = *self;
        if mode & LOCKSTEP != 0 {
            // In lockstep on AVR, `increment` is still that of an earlier segment.
            for (m, increment) in increment.iter_mut().enumerate() {
                *increment = if mode & 1 << m != 0 { STEP } else { 0 };
            }
        }
        Segment { increment, ticks, backwards, ..Segment::default() }
    }

    /// Carries out a tick.
    #[inline(always)]
    pub fn tick(&mut self, pins: &mut impl Pins, segments: &mut Consumer<Segment, SEGMENTS>) {
        let due = self.due;
        pins.rise(due);
        if self.ticks == 0 && !self.load(pins, segments) {
            self.due = 0;
            pins.fall(due);
            pins.stop();
            return;
        }
        self.ticks -= 1;
        let mut next = 0;
        let mut m = 0;
        while m < MOTORS {
            let after = self.phase[m] + self.increment[m];
            self.phase[m] = after & !STEP;
            if after & STEP != 0 {
                next |= 1 << m;
            }
            m += 1;
        }
        self.due = next;
        pins.fall(due);
    }

    /// Takes the next segment. Returns false when there is none.
    #[inline(always)]
    pub fn load(
        &mut self,
        pins: &mut impl Pins,
        segments: &mut Consumer<Segment, SEGMENTS>,
    ) -> bool {
        let Some(segment) = segments.pop() else {
            return false;
        };
        // Set first, because the counter is already running towards the old top.
        pins.period(segment.period);
        let turned = segment.backwards ^ self.backwards;
        if turned != 0 {
            pins.direction(segment.backwards);
            self.backwards = segment.backwards;
            for m in 0..MOTORS {
                if turned & (1 << m) != 0 {
                    self.phase[m] = !self.phase[m] & !STEP;
                }
            }
        }
        self.increment = segment.increment;
        self.ticks = segment.ticks;
        self.settle = segment.settle;
        self.mode = segment.mode;
        pins.slot_free();
        true
    }
}

impl Default for Dda {
    fn default() -> Self {
        Self::new()
    }
}
