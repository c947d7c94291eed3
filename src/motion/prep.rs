//! From a stretch of path to a segment: tick period, tick count and per-motor increments, in integers.
//!
//! Owned by the exec task, which calls [`Prep::begin`] for a block and then [`Prep::segment`] or
//! [`Prep::last`] for each stretch of it.
//!
//! The motor that moves farthest in a block is dominant. Its increment is `STEP / 2^k`, so that it steps on every
//! `2^k`th tick exactly, without jitter. `k` is as large as the shortest tick period allows: the other motors step on
//! any tick, and finer ticks bring them closer to their exact times. If all motors that move go equally far (lockstep),
//! there are no other motors. Then `k` is 0 if possible, which leaves the least work to the interrupt.
//!
//! A stretch is cut to whole ticks. The distance that is cut off stays in `left`, and is made with the next stretch;
//! its time is carried over too.
//!
//! The other motors get the rounded increment, and [`Minor::owed`] holds the exact rounding error. When this error is
//! half a unit a tick or more in a segment, the increment is corrected by one unit a tick. The error is carried from
//! segment to segment, and over the end of the block, so that rounding errors do not add up.
//!
//! **Ends of blocks.** A block ends where its line ends, to 1/16 step ([`PART`]). If blocks ended on whole steps, a
//! curve of short lines would be rounded twice: at its corners, and at the steps between them. The distance of a block
//! is rarely a whole number of ticks, so the last stretch takes the nearest number of whole ticks. The difference that
//! remains for a motor is its `debt`: the distance that lines require, less the distance in segments. The
//! next block starts from where the motors are, which includes the debt in its distances. The time of the missing part
//! is carried over with it. A dominant motor thus keeps its phase, and its steps stay even, over any number of blocks.
//!
//! **Ends of motion.** A block that ends at a standstill, or that no line follows, is made to its exact end (`exact`),
//! with finer ticks for the remainder if necessary. This end is so much closer than half a step to the whole step to
//! which it is rounded ([`FRACTIONS`](super::block::FRACTIONS)) that rounding errors cannot lead to another step. So
//! the position is exact whenever the machine stands still. Distances of more than 2,030 steps do not fit 16 bits in
//! 1/16 steps: such blocks are a whole number of steps long, and keep the fraction with which they begin.
//!
//! **Ends of segments.** A segment with one or two ticks a step ends on a step of the dominant motor if possible. So
//! the next step is in time even if a later segment has one tick a step. A segment with more ticks a step ends in the
//! middle between two steps, because in a tick without a pulse the interrupt has time to load the next segment.
//!
//! **Pressure advance.** An extruder is ahead of its line by its lead ([`advance`](super::advance)). The lead is added
//! to segments that are otherwise complete, and is counted separately. So the rules above hold for the line without the
//! lead, and at a standstill there is no lead ([`Prep::relax`]). A motor makes one step in a tick at most. An exact end
//! therefore has no long ticks while there is a lead: they would stop the extruder.
//!
//! Cost on AVR: 600 cycles a segment and 200 for each motor that moves; 400 for `begin`, and 300 for each
//! motor when `k` changes.

mod begin;
mod beside;
mod cut;
mod lead;
mod minor;
mod slice;
mod ticks;

use super::advance::{Advance, EXTRUDERS};
use super::block::PARTS_LOG2;
use super::divide::quotient;
use super::pace::{COARSEST, Drivers, Pace, TURNED, paces};
use crate::boards::{MOTORS, each_motor};
use crate::dda::{STEP, STEP_LOG2, Segment, TICKS_MAX};
use crate::hal::TICKS;
use crate::hal::arithmetic::product;
use minor::{Minor, even, share};
use ticks::{FINE, bit, coarsen, finer, grain, whole_ticks};

/// Phase units in 1/16 step, the resolution of the ends of blocks.
const PART: u16 = STEP >> PARTS_LOG2;

/// The exponent of [`PART`].
const PART_LOG2: u8 = STEP_LOG2 - PARTS_LOG2;

/// Half a step, in 1/16 step.
const HALF: u8 = 1 << (PARTS_LOG2 - 1);

/// Most ticks of a segment with more than one tick a step.
const LIMIT_MAX: u16 = 2000;

/// Longest stretch, CPU cycles.
pub const CYCLES_MAX: u32 = 1 << 20;

/// Longest time of moves without steps that is carried over, CPU cycles: a minute.
const KEPT_MAX: u32 = (1 << 30) - 1;

/// Longest period of a tick, CPU cycles.
const PERIOD_MAX: u32 = 0xFFFF;

/// Blocks that take longer than 1/16 s have fine ticks. This is the exponent of that time, as a power of two.
pub const FINE_LOG2: i8 = -4;

/// Latest cycle of a tick at which the interrupt may become ready for its pulses.
const SETTLE: u8 = 76;

/// Ticks and period of a segment for a retreat while the motors of the block stand still.
const ASIDE: (u16, u16) = (64, 500);

/// Ticks and period of a segment in which the motors of a retreat move no farther than 1/32 step.
const ASIDE_LITTLE: (u16, u16) = (1, 16_000);

/// A lockstep segment that is shorter than this many steps has at least half this many ticks.
const LOCKSTEP_TICKS: u16 = 16;

/// A segment longer than this, in cycles, has time for [`LOCKSTEP_TICKS`]; a shorter one may have not.
const LOCKSTEP_CYCLES: u32 = LOCKSTEP_TICKS as u32 * TICKS[0].coarsest as u32;

/// The state of the preparation of one block.
#[derive(Debug)]
#[repr(C)]
pub struct Prep {
    // The most used fields come first: the CPU reaches 64 bytes from a pointer.
    /// Phase units of the dominant motor until the block's end.
    left: u32,
    /// Time of earlier stretches that no segment has used, CPU cycles.
    time: i32,
    /// Distance of the dominant motor in the block, in 1/16 step or in whole steps (`parts`).
    most: u16,
    /// Whether distances of this block are in 1/16 step ([`PART`]).
    parts: bool,
    /// The exponent of the ticks for which increments have been computed; above [`STEP_LOG2`] if there are none yet.
    shift: u8,
    /// Motors that go as far as the dominant one, which is one of them, as bits.
    full: u8,
    /// Motors that go less far, as bits.
    minor: u8,
    /// Number of motors that move, less one.
    others: u8,
    backwards: u8,
    /// Whether ticks are to be as fine as possible.
    fine: bool,
    /// Whether ticks are to be as few as in a block of one segment.
    coarse: bool,
    /// Whether exec is late, and pulses are not to wait for their place in the tick.
    hurries: bool,
    /// Whether a motor has reversed and no segment has the new direction yet.
    turned: bool,
    /// Direction set-up time before the first step, CPU cycles.
    setup: u16,
    /// Distance of the dominant motor in the line without debts, signed, in the units of `most`.
    own: i16,
    /// How far the dominant motor is past half a step, in its direction, at the block's end: 1/16 step, modulo 16.
    past: u8,
    /// The distance of a motor in blocks, the running one included, less its distance in segments: phase units,
    /// positive forwards.
    debt: [i32; MOTORS],
    /// How far the end of the block, or of the sample, is past the point half a step before its rounded whole step,
    /// phase units. A whole number of [`PART`]s at the end of a block.
    place: [u16; MOTORS],
    minors: [Minor; MOTORS],
    /// The paces by the number of motors that move, less one.
    paces: [Pace; MOTORS],
    /// A segment that is to follow the tick in which directions settle.
    held: Option<Segment>,
    extruder: [Advance; EXTRUDERS],
}

impl Prep {
    /// The state without a block.
    pub const fn new() -> Self {
        const MINOR: Minor = Minor { way: 0, increment: 0, remainder: 0, owed: 0 };
        Self {
            left: 0,
            time: 0,
            most: 0,
            parts: true,
            minors: [MINOR; MOTORS],
            own: 0,
            past: 0,
            debt: [0; MOTORS],
            place: [STEP / 2; MOTORS],
            shift: u8::MAX,
            full: 0,
            minor: 0,
            others: 0,
            backwards: 0,
            fine: false,
            coarse: false,
            hurries: false,
            turned: false,
            paces: paces(Drivers::USUAL),
            setup: Drivers::USUAL.setup(),
            held: None,
            extruder: [Advance::NONE; EXTRUDERS],
        }
    }

    /// Sets the timing that the drivers require, from the next block on.
    #[inline(never)]
    #[small]
    pub fn set_drivers(&mut self, drivers: Drivers) {
        self.paces = paces(drivers);
        self.setup = drivers.setup();
    }

    /// Takes the segment that comes before any other. Returns false if there is none.
    #[inline(always)]
    pub fn held(&mut self, out: &mut Segment) -> bool {
        // Tested first, because taking `None` costs as much as taking a segment.
        self.held.is_some() && self.release(out)
    }

    #[inline(never)]
    fn release(&mut self, out: &mut Segment) -> bool {
        if let Some(segment) = self.held.take() {
            *out = segment;
        }
        true
    }

    /// Sets whether ticks are to be as fine as possible from now on, or as coarse.
    #[inline(always)]
    pub fn refine(&mut self, fine: bool, coarse: bool) {
        (self.fine, self.coarse) = (fine, coarse);
    }

    /// Sets whether exec is late.
    #[inline(always)]
    pub fn set_hurry(&mut self, hurries: bool) {
        self.hurries = hurries;
    }

    /// Phase units of the dominant motor in the block that no segment covers yet.
    pub fn left(&self) -> u32 {
        self.left
    }

    /// The distance of the dominant motor in the line without debts, phase units. The distance and time of a debt
    /// belong to the first stretch.
    pub fn own(&self) -> u32 {
        product(self.own.unsigned_abs(), if self.parts { PART } else { STEP })
    }

    /// Returns `cycles` plus the time carried over, at least 1.
    #[inline(always)]
    fn with_kept(&self, cycles: u32) -> u32 {
        // The time carried over is below 2^30.
        let sum = self.time.wrapping_add(cycles as i32);
        if sum > 0 { sum as u32 } else { 1 }
    }

    /// The time of earlier stretches that no segment has used, CPU cycles.
    #[inline(always)]
    pub fn kept(&self) -> i32 {
        self.time
    }

    /// Drops the time carried over, because the machine stands still.
    pub fn rest(&mut self) {
        self.time = 0;
    }

    /// Prepares a stretch of `cycles`, up to [`CYCLES_MAX`], at the end of which the dominant motor has about `left`
    /// phase units to go. Returns false, and no segment, when the time is carried over to the next stretch.
    pub fn segment(&mut self, left: u32, cycles: u32, out: &mut Segment) -> bool {
        let travel = self.left.saturating_sub(left);
        let cycles = self.with_kept(cycles);
        let limit = self.most_ticks(cycles, travel);
        let (mut fine, mut shift) = coarsen(travel, limit);
        // The end is aligned to a step of the dominant motor; with fine ticks to the middle between two steps, where
        // the interrupt has time to load a segment.
        let middle = if shift < STEP_LOG2 - 1 { STEP / 2 } else { 0 };
        // In 16 bits: no tick is longer than a step.
        let at = (self.left as u16)
            .wrapping_sub((u16::from(self.past) << PART_LOG2).wrapping_add(middle));
        (fine, shift) = self.aligned(at, (fine, shift), cycles, travel);
        let step = bit(shift);
        let rest = step - 1;
        let mut ticks = whole_ticks(fine, shift);
        let grain = grain(ticks, shift);
        let short = (travel as u16).wrapping_sub(at & !rest) & (bit(grain) - 1);
        if travel <= u32::from(short) {
            return self.idle(cycles, out);
        }
        // The whole ticks in the travel up to the aligned end.
        let part = travel as u16 & rest;
        if short > part {
            ticks -= u32::from((short - part + rest) >> shift);
        }
        let ticks = if ticks > u32::from(TICKS_MAX) { TICKS_MAX } else { ticks as u16 };
        let period = self.period(cycles, fine, shift);
        if period > PERIOD_MAX {
            return self.idle(cycles, out);
        }
        self.emit(ticks, shift, step, period as u16, cycles, out);
        true
    }

    /// Returns shorter ticks, and the `travel` in them ([`finer`]), if a step at the distance `at` does not lie on a tick
    /// and there is time for such ticks; else the ticks as they are.
    #[inline(always)]
    fn aligned(&self, at: u16, ticks: (u32, u8), cycles: u32, travel: u32) -> (u32, u8) {
        let (fine, shift) = ticks;
        if at & (bit(shift) - 1) == 0 {
            return (fine, shift);
        }
        match self.fitting(shift, at.trailing_zeros() as u8, cycles, travel) {
            fits if fits == shift => (fine, shift),
            fits => (finer(travel, fits), fits),
        }
    }

    /// Returns the exponent of ticks that end on the steps of the dominant motor: `fits` if that is less than `shift`
    /// and there is time for such ticks, else `shift`.
    fn fitting(&self, shift: u8, fits: u8, cycles: u32, travel: u32) -> u8 {
        // A period that comes out as the shortest may have been raised to it: then there is no time.
        let finer = fits < shift
            && self.period(cycles, finer(travel, fits), fits) > u32::from(self.paces().settles);
        if finer { fits } else { shift }
    }

    /// Prepares the whole of a block that begins, in `cycles`, which are no more than a few milliseconds. Returns
    /// false, and no segment, when the block has no steps; its time is then carried over.
    ///
    /// The result is that of `last` for such a block, in fewer cycles; but in lockstep it may begin within a tick. Cost:
    /// 700, and 400 for each motor but the dominant one.
    #[inline(never)]
    pub fn whole(&mut self, cycles: u32, exact: bool, out: &mut Segment) -> bool {
        let cycles = self.with_kept(cycles);
        let most = self.most;
        let limit = self.limit(cycles, self.coarsest());
        // The time carried over may be long.
        if exact || most == 0 || !self.parts || cycles >> 24 != 0 {
            return self.last_of(cycles, limit, exact, out);
        }
        if most < u16::from(HALF) {
            // Less than half a step: nothing moves, and the next block includes this distance.
            self.left = 0;
            return self.last_of(cycles, limit, exact, out);
        }
        // Starts from ticks of 1/16 step, and makes them finer or coarser. The period stays `time / most`.
        let (mut ticks, mut step, mut time) = (most, PART, cycles);
        if ticks > limit {
            let (mut half, mut upper) = (0, (PART >> 8) as u8);
            while ticks > limit && upper != (STEP >> 8) as u8 {
                half = ticks as u8 & 1;
                ticks >>= 1;
                upper <<= 1;
                time <<= 1;
            }
            ticks += u16::from(half);
            step = u16::from(upper) << 8;
        } else {
            while ticks <= limit / 2 {
                ticks *= 2;
                step /= 2;
                time >>= 1;
            }
        }
        if ticks > TICKS_MAX {
            return self.last_of(cycles, limit, exact, out);
        }
        let shortest = self.paces().shortest;
        let long = (time >> 16) as u16 >= most;
        let period = if long { u16::MAX } else { quotient(time + u32::from(most / 2), most) };
        let period = period.max(shortest);
        self.left = 0;
        out.ticks = ticks;
        out.period = period;
        out.settle = 0;
        self.complete(cycles, step, out, |prep, m| even(prep.minors[m].way, step, most));
        true
    }

    /// Completes a segment that has ticks and a period, where there are `cycles` of time. Motors that go as far as
    /// the dominant one get the increment `step`; the others get what `minor` returns.
    #[inline(always)]
    fn complete(
        &mut self,
        cycles: u32,
        step: u16,
        out: &mut Segment,
        minor: impl Fn(&mut Self, usize) -> u16,
    ) {
        let used = product(out.ticks, out.period);
        // Lateness of more than 1,000 cycles is forgotten, or the machine would race to catch up. Half a tick more
        // comes from rounding to whole ticks.
        let mut time = cycles as i32 - used as i32;
        if time < -1000 {
            time = time.max(-1000 - i32::from(out.period / 2));
        }
        self.time = time;
        out.backwards = self.backwards;
        out.moving = self.full | self.minor;
        let (full, moving) = (self.full, out.moving);
        let ticks = out.ticks;
        let travel = product(step, ticks) as i32;
        each_motor!(M => {
            let mut increment = 0;
            if moving & 1 << M != 0 {
                let mut travel = travel;
                increment = step;
                if full & 1 << M == 0 {
                    increment = minor(self, M);
                    travel = product(increment, ticks) as i32;
                }
                self.debt[M] += if out.backwards & 1 << M != 0 { travel } else { -travel };
            }
            out.increment[M] = increment;
        });
        if self.leads() {
            out.mode = Segment::mode_of(moving);
            self.lead(out);
        } else {
            out.seal(self.full, step);
        }
        if self.turned {
            self.behind_turn(out);
        }
    }

    /// Prepares the last stretch of the block, the whole remainder, in `cycles`: to its exact end if `exact`, else to
    /// the nearest number of ticks. Returns false, and no segment, when nothing is left; the time is then carried over.
    pub fn last(&mut self, cycles: u32, exact: bool, out: &mut Segment) -> bool {
        let cycles = self.with_kept(cycles);
        let limit = self.most_ticks(cycles, self.left);
        self.last_of(cycles, limit, exact, out)
    }

    #[inline(never)]
    fn last_of(&mut self, cycles: u32, limit: u16, exact: bool, out: &mut Segment) -> bool {
        let left = self.left;
        if left == 0 {
            self.time = cycles.min(KEPT_MAX) as i32;
            return false;
        }
        let (mut fine, mut shift) = coarsen(left, limit);
        if exact && left < u32::from(STEP) {
            let fits = left.trailing_zeros() as u8;
            if fits > shift && !self.leads() {
                // The remainder, in no more ticks than necessary.
                (fine, shift) = (finer(left, fits), fits);
            }
        } else if self.is_in_lockstep() {
            // The end is not aligned, but the beginning is: otherwise the first step would be late.
            let at = (left as u16).wrapping_sub(u16::from(self.past) << PART_LOG2);
            (fine, shift) = self.aligned(at, (fine, shift), cycles, left);
        }
        let mut ticks = whole_ticks(fine, shift);
        let period = self.period(cycles, fine, shift).min(PERIOD_MAX);
        let tick = bit(shift);
        if ticks > u32::from(TICKS_MAX) {
            // Too much for one segment. This segment takes a part; the rest comes with the next call.
            ticks = TICKS_MAX.into();
        } else if !exact {
            // The nearest number: the error is at most half a tick.
            ticks += u32::from(left as u16 & (tick - 1) > tick / 2);
            self.left = product(ticks as u16, tick);
        }
        self.emit(ticks as u16, shift, tick, period as u16, cycles, out);
        true
    }

    /// Returns the paces for the motors that move. With a motor above the second, the interrupt handles all motors
    /// (`dda::WIDE`), so that two motors take as long as three.
    fn paces(&self) -> &Pace {
        let is_wide = self.others == 1 && self.full | self.minor > 0b11;
        &self.paces[usize::from(if is_wide { 2 } else { self.others })]
    }

    /// Returns the most ticks for a stretch of `travel`. Ticks are fine only if requested, and if at most every fourth
    /// one is a step: a tick with a step takes the interrupt longer, and would leave too little time to exec.
    #[inline(never)]
    fn most_ticks(&self, cycles: u32, travel: u32) -> u16 {
        if self.fine {
            let fine = self.limit(cycles, self.paces().fine);
            if travel >> (STEP_LOG2 - 2) <= u32::from(fine) {
                return fine;
            }
        }
        self.limit(cycles, if self.coarse { self.coarsest() } else { self.paces().coarse })
    }

    /// The pace of the coarsest ticks. Wide pulses may require longer ones than [`COARSEST`]: with shorter ones the segment
    /// would take longer than its stretch.
    #[inline(always)]
    fn coarsest(&self) -> u16 {
        COARSEST.min(self.paces().coarse)
    }

    /// Whether all motors that move go equally far.
    #[inline(always)]
    fn is_in_lockstep(&self) -> bool {
        self.minor == 0 && !self.leads()
    }

    /// Returns the most ticks for a stretch of `cycles` at `pace`.
    #[inline(always)]
    fn limit(&self, cycles: u32, pace: u16) -> u16 {
        let in_lockstep = self.is_in_lockstep();
        if in_lockstep && cycles > LOCKSTEP_CYCLES {
            return LOCKSTEP_TICKS;
        }
        let cycles = if cycles > PERIOD_MAX { u16::MAX } else { cycles as u16 };
        // Shifts by 22 bits in all: dropping 16 of them costs nothing.
        let limit = (product(cycles, pace) >> 16) as u16 >> 6;
        limit.clamp(1, if in_lockstep { LOCKSTEP_TICKS } else { LIMIT_MAX })
    }

    /// Returns the cycles from tick to tick when a stretch of `fine` parts of a tick ([`coarsen`]) takes `cycles`.
    /// The period is no less than can be sustained; it is 2^16 if it does not fit 16 bits.
    fn period(&self, cycles: u32, fine: u32, shift: u8) -> u32 {
        let (mut cycles, mut ticks) =
            (if shift < FINE { cycles << shift } else { cycles << FINE }, fine);
        while ticks > 0xFFFF {
            ticks >>= 1;
            cycles >>= 1;
        }
        let ticks = ticks as u16;
        if ticks == 0 || (cycles >> 16) as u16 >= ticks {
            return 0x1_0000;
        }
        let period = quotient(cycles + u32::from(ticks / 2), ticks);
        u32::from(period.max(self.paces().shortest))
    }

    /// Prepares a pause, because the next step is too far off: a single tick that takes the whole time, or the longest
    /// period. Returns false, and carries the time over, if it is short.
    fn idle(&mut self, cycles: u32, out: &mut Segment) -> bool {
        if cycles < PERIOD_MAX / 2 {
            self.time = cycles as i32;
            return false;
        }
        let period = if cycles > PERIOD_MAX { u16::MAX } else { cycles as u16 };
        self.time = (cycles - u32::from(period)) as i32;
        // By far long enough for directions to settle.
        self.turned = false;
        self.pause(1, period, out);
        true
    }

    /// Makes a segment in which nothing moves.
    pub fn pause(&self, ticks: u16, period: u16, out: &mut Segment) {
        *out = Segment { ticks, period, backwards: self.backwards, ..Segment::default() };
    }

    /// Makes a segment of `ticks`, in each of which the dominant motor travels `step`, which is `1 << shift`.
    #[inline(never)]
    fn emit(
        &mut self,
        ticks: u16,
        shift: u8,
        step: u16,
        period: u16,
        cycles: u32,
        out: &mut Segment,
    ) {
        if shift != self.shift {
            self.scale(shift, step);
        }
        self.left -= product(ticks, step);
        out.ticks = ticks;
        out.period = period;
        let settles = period >= self.paces().settles;
        out.settle = if settles { SETTLE } else { 0 };
        self.complete(cycles, step, out, |prep, m| prep.minors[m].advance(ticks, prep.most));
    }

    /// Gives directions time to settle after motors have reversed. If the first steps of `segment` come too soon, it
    /// becomes a tick in which directions settle, and the steps come in the next segment. The motion is delayed by that
    /// tick.
    #[inline(never)]
    fn behind_turn(&mut self, segment: &mut Segment) {
        self.turned = false;
        let stand = segment.period.saturating_sub(TURNED);
        if stand >= self.setup {
            return;
        }
        self.held = Some(*segment);
        self.pause(1, (self.setup - stand).max(self.paces().shortest), segment);
    }

    /// Computes the increments for ticks in which the dominant motor travels `step`, which is `1 << shift`.
    #[inline(never)]
    fn scale(&mut self, shift: u8, step: u16) {
        let first = core::mem::replace(&mut self.shift, shift) == u8::MAX && self.parts;
        let (most, others) = (self.most, self.minor);
        each_motor!(M => if others & 1 << M != 0 {
            let minor = &mut self.minors[M];
            (minor.increment, minor.remainder) = share(minor.way, step, most);
            if first {
                // The motor's distance includes what it owed.
                minor.owed = 0;
            }
        });
    }
}

impl Default for Prep {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::{Extent, Line};
    use super::super::smooth::{CHANNELS, SAMPLE_CYCLES};
    use super::*;
    use crate::hal::TIMER_HZ;

    /// Three and a half steps of 50 us: the last half takes half as long as a step, not sixteen of the shortest ticks.
    #[test]
    fn a_little_rest_in_lockstep_takes_its_time() {
        let (mut prep, mut out) = (Prep::new(), Segment::default());
        let mut way = [0; MOTORS];
        way[0] = 3 * 16 + 8;
        let line = Line { way, extent: Extent::new(1.0, false), ..Line::default() };
        prep.begin(&line, &mut [0; MOTORS], &mut [0; MOTORS]);
        assert!(prep.segment(u32::from(STEP / 2), 3 * 800, &mut out));
        assert_eq!(out.ticks * out.period, 3 * 800);
        assert!(prep.last(400, false, &mut out));
        let took = u32::from(out.ticks) * u32::from(out.period);
        assert!((350..=450).contains(&took), "{out:?}");
    }

    /// Ticks that are shorter than pulses allow would be longer than computed, and so would each sample: a motor would
    /// keep one velocity while its ramp asks for others.
    #[test]
    fn samples_take_their_time_whatever_pulses_and_ticks() {
        for pulse_us in [0, 2, 5, 10, 30, 60, 100] {
            let drivers = Drivers { pulse_us, setup_us: 1 };
            let fastest = drivers.step_rate_max(2) * SAMPLE_CYCLES as f32 / TIMER_HZ as f32;
            for (fine, coarse) in [(true, false), (false, false), (false, true)] {
                for part in 1..100 {
                    let most = fastest * part as f32 / 100.0;
                    let [long, odd] = longest_and_average(drivers, (fine, coarse), most);
                    assert!(
                        odd < 0.001 && long < 1.3,
                        "{drivers:?} {fine} {coarse} {most}: {long} {odd}"
                    );
                }
            }
        }
    }

    /// Makes samples in which a motor goes `most` steps, and another seven tenths. Returns how long the longest segment
    /// is, and by how much they are longer or shorter together, over what they should be.
    fn longest_and_average(drivers: Drivers, (fine, coarse): (bool, bool), most: f32) -> [f32; 2] {
        const COUNT: u32 = 300;
        let (mut prep, mut out, mut target) = (Prep::new(), Segment::default(), [0; MOTORS]);
        prep.set_drivers(drivers);
        prep.refine(fine, coarse);
        let (mut sum, mut longest) = (0, 0);
        for _ in 0..COUNT {
            let mut distances = [0; CHANNELS];
            distances[0] = (most * f32::from(STEP)) as i32;
            distances[1] = (0.7 * most * f32::from(STEP)) as i32;
            prep.slice(&distances, &mut target, &mut out);
            let cycles = u32::from(out.ticks) * u32::from(out.period);
            (sum, longest) = (sum + cycles, longest.max(cycles));
        }
        let wanted = (COUNT * SAMPLE_CYCLES) as f32;
        let [sum, longest] = [sum.saturating_add_signed(prep.kept()), longest].map(|of| of as f32);
        [longest / SAMPLE_CYCLES as f32, (sum / wanted - 1.0).abs()]
    }
}
