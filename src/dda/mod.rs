//! The step generator: what happens at one tick of the step timer, without any register.
//!
//! Owned by the step interrupt (level 0). Each motor has a phase below [`STEP`], which is one step. A
//! tick adds the segment's increment; when that fills bit 15, the bit is taken off and a step is due.
//! So a motor steps at most once a tick, `increment = STEP` is a step on every tick, and a motor whose
//! increment is `STEP / 2^k` steps on every `2^k`th tick exactly.
//!
//! On AVR the whole of [`Dda::tick`] has a twin in assembly (`hal/avr/step_isr.rs`), which works on the
//! same [`Dda`] and [`Segment`], field by field. The host runs this one.
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
//! Pins rise first, so a pulse's time does not depend on the computation, and fall last, so that a
//! pulse is as wide as the computation. Directions change after the last pulse of the old
//! segment and a whole tick before the first of the new one.
//!
//! The interrupt may start late, behind another one. A segment that has the time for it names the
//! cycle of the tick at which its pulses rise, so late that no other interrupt can delay them: those
//! pulses are exact to the cycle.
//!
//! In *lockstep* all motors that move step on every tick: phases stay as they are, and the interrupt
//! has nothing to add. That is how the highest rates are reached.
//!
//! A phase is the motor's true position between steps. When the direction of a motor reverses, its
//! phase is complemented: counting a complement up is counting the phase down, so the fraction
//! of a step survives any reversal.

use kerf_macros::small;

use avr_embassy::ring::Consumer;

use crate::boards::{MOTORS, STEPS_BY_UNIT};

pub mod contact;
pub mod step_replay;

/// A step, in phase units.
pub const STEP: u16 = 1 << STEP_LOG2;
/// The exponent of it.
pub const STEP_LOG2: u8 = 15;

/// Where phases start: a little past half a step, so that a position is rounded to the nearest step
/// and a rest of up to [`PHASE_MARGIN`] left by the segments before never moves a step of a motor that
/// runs on exact ticks.
pub const PHASE_START: u16 = STEP / 2 + PHASE_MARGIN;

/// See [`PHASE_START`].
pub const PHASE_MARGIN: u16 = if STEPS_BY_UNIT { 2200 } else { 1024 };

/// Most ticks of a segment: keeps the rounding rest below [`PHASE_MARGIN`].
pub const TICKS_MAX: u16 = if STEPS_BY_UNIT { 4200 } else { 2000 };

/// The phase of a motor that is at a whole step, in the direction in which it counts.
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
    /// Ticks it lasts, at least 1.
    pub ticks: u16,
    /// CPU cycles from tick to tick.
    pub period: u16,
    /// Bit m set: motor m runs backwards.
    pub backwards: u8,
    /// Cycles from a tick to its pulses; 0 for pulses as soon as may be.
    pub settle: u8,
    /// What the interrupt may leave out: [`NARROW`], [`WIDE`], or [`LOCKSTEP`] and the motors that step on
    /// every tick. Set by [`Segment::seal`].
    pub mode: u8,
    /// Motors of its block that move, as bits, none in a pause: for their power. The interrupt does not
    /// read it. It makes the segment 16 bytes long.
    pub moving: u8,
}

/// Only the first two motors move.
pub const NARROW: u8 = 0;
/// Others do.
pub const WIDE: u8 = 1;
/// All motors that move step on every tick.
pub const LOCKSTEP: u8 = 0x80;

impl Segment {
    /// Completes it: the motors `full` (bits) travel `step` a tick, the rest of those that move less.
    /// Cost: 20.
    #[inline]
    pub fn seal(&mut self, full: u8, step: u16) {
        self.mode = if step == STEP && self.moving == full {
            LOCKSTEP | full
        } else {
            Self::mode_of(self.moving)
        };
    }

    /// The mode of a segment in which these motors (bits) move at rates of their own.
    #[inline(always)]
    pub fn mode_of(moving: u8) -> u8 {
        if moving & !0b11 != 0 { WIDE } else { NARROW }
    }

    /// Adds the way that it takes each motor, in phase units.
    fn add_way(&self, ways: &mut [i32; MOTORS]) {
        for (m, way) in ways.iter_mut().enumerate() {
            let far = (u32::from(self.increment[m]) * u32::from(self.ticks)) as i32;
            *way = way.wrapping_add(if self.backwards & 1 << m != 0 { -far } else { far });
        }
    }
}

/// How close ticks may come on a chip with usual pulses ([`Drivers::USUAL`]), for some number of motors that move. All are periods of
/// [`Segment::period`].
#[derive(Clone, Copy, Debug)]
pub struct Ticks {
    /// At the highest step rate: of lockstep.
    pub step: u16,
    /// The shortest: the step interrupt, a short interrupt before it, and some time for everything else.
    pub shortest: u16,
    /// The ticks of steady motion: as fine as leaves exec and the planner a third of the CPU.
    pub fine: u16,
    /// The ticks of short blocks, which leave exec and the planner more of the CPU.
    pub coarse: u16,
    /// The ticks of blocks so short that they are a single segment.
    pub coarsest: u16,
    /// From this period on pulses wait for the interrupt's worst latency ([`Segment::settle`]).
    pub settles: u16,
}

/// What the drivers of the motors ask of their pins.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Drivers {
    /// How long a step pulse lasts, us.
    pub pulse_us: u8,
    /// How long a direction stands before the first step, us.
    pub setup_us: u8,
}

/// What the step generator does to the outside.
pub trait Pins {
    /// Raises the step pins in `motors` (bit m: motor m).
    fn rise(&mut self, motors: u8);
    /// Lets the step pins in `motors` fall.
    fn fall(&mut self, motors: u8);
    /// Sets all direction pins (bit m set: motor m runs backwards).
    fn direction(&mut self, backwards: u8);
    /// Ticks come this many CPU cycles apart from now on.
    fn period(&mut self, cycles: u16);
    /// A segment slot is free.
    fn slot_free(&mut self);
    /// No segment: no more ticks.
    fn stop(&mut self);
}

/// The generator's state. The assembly knows its layout by `offset_of`.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Dda {
    /// Below [`STEP`].
    pub(crate) phase: [u16; MOTORS],
    pub(crate) increment: [u16; MOTORS],
    /// Ticks left of the segment.
    pub(crate) ticks: u16,
    /// Steps due at the next tick, bit m for motor m.
    pub(crate) due: u8,
    pub(crate) backwards: u8,
    /// The settling time, as in the segment.
    pub(crate) settle: u8,
    /// The mode, as in the segment.
    pub(crate) mode: u8,
}

impl Dda {
    /// At rest.
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

    /// Every motor is where its last pulse has put it, and no fraction of a step is on the way. The steps that
    /// the rest of the segment and those that `queued` gives would have made are taken off `position`. For
    /// exec, while no ticks come; exact wherever they were stopped. Cost: 1,200, and 600 a segment.
    #[inline(never)]
    #[small]
    pub fn settle(
        &mut self,
        mut queued: impl FnMut() -> Option<Segment>,
        position: &mut [i32; MOTORS],
    ) {
        // Phases as they count forwards, and the way to where the last segment ends.
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

    /// What is left of the segment.
    fn rest(&self) -> Segment {
        let Self { mut increment, ticks, backwards, mode, .. } = *self;
        if mode & LOCKSTEP != 0 {
            // On AVR increments are those of a segment before.
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

    /// Takes the next segment. False when there is none.
    #[inline(always)]
    pub fn load(
        &mut self,
        pins: &mut impl Pins,
        segments: &mut Consumer<Segment, SEGMENTS>,
    ) -> bool {
        let Some(segment) = segments.pop() else {
            return false;
        };
        // First: the counter is running towards the old top.
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
