//! From a stretch of path to a segment: tick period, tick count and per-motor increments, in integers.
//!
//! Owned by the exec task, which calls [`Prep::begin`] for a block and then [`Prep::segment`] or
//! [`Prep::last`] for each stretch of it.
//!
//! The motor that goes farthest in a block is dominant. Its increment is `STEP / 2^k`, so it steps on
//! every `2^k`th tick exactly, with no jitter; `k` is as large as the shortest tick period allows, so
//! that the other motors, which may step on any tick, stay close to their true times too. If all motors
//! that move go equally far there are no others: then `k` is 0 as far as can be, and
//! the interrupt has next to nothing to do (lockstep).
//!
//! A stretch is cut to whole ticks. What is cut off is still in `left` and comes with the next stretch, as does its time:
//! nothing is lost.
//!
//! The other motors get the rounded increment, and [`Minor::owed`] remembers exactly what rounding
//! took: a segment in which it comes to half a unit a tick or more is corrected by a unit a tick. It is
//! carried from segment to segment, and over the end of the block, so that nothing adds up.
//!
//! **Ends of blocks.** A block ends where its line ends, to 1/16 step ([`PART`]). If blocks ended on whole steps, a curve of
//! short lines would be rounded twice: its corners, and the steps between them. Ticks rarely fit such a distance. So the
//! last stretch of a block takes the nearest number of whole ticks. What each motor is then short of, or ahead by, is its
//! `debt`: what lines have told it to go, less what segments have, modulo 2^16. The next block starts from where the motors are and so pays it. The time of the missing part is carried over with it.
//! A dominant motor thus keeps its phase, and its steps stay even, over any number of blocks.
//!
//! **Ends of motion.** A block that comes to rest, or that no line follows, is made to its end (`exact`), with finer ticks
//! for the remainder if need be. That end is less than half a step from the whole step it is rounded to
//! ([`FRACTIONS`](super::block::FRACTIONS)), by more than rounding can leave. So the position is exact whenever the machine rests.
//! Blocks of more than 2,030 steps do not fit 1/16 steps: they are a whole number of steps long, and keep the fraction with which they begin.
//!
//! **Ends of segments.** A segment with one or two ticks a step ends on a step of the dominant motor as far as possible. So the next step
//! is in time when a later segment has one tick a step. A segment with more ticks a step ends in the middle between two steps: a tick without
//! a pulse leaves the interrupt time to load the next segment.
//!
//! **Pressure advance.** An extruder is ahead of its line by what [`advance`](super::advance) says. Its lead is added to segments that are complete but for
//! that, and counted apart from the line, which knows nothing of it. So all that is said here of ends holds for what the line asks for, and at rest
//! there is no lead ([`Prep::relax`]).
//!
//! Cost on AVR: 600 cycles a segment and 200 for each motor that moves; 400 for `begin`, and 300 for each
//! motor when `k` changes.

mod begin;
mod beside;
mod cut;
mod lead;
mod minor;
mod ticks;

use super::advance::{Advance, EXTRUDERS};
use super::block::PARTS_LOG2;
use super::divide::quotient;
use super::pace::{COARSEST, Drivers, Pace, paces};
use crate::boards::{MOTORS, each_motor};
use crate::dda::{STEP, STEP_LOG2, Segment, TICKS_MAX};
use crate::hal::TICKS;
use crate::hal::arithmetic::product;
use minor::{Minor, even, share};
use ticks::{FINE, bit, coarsen, finer, grain, whole_ticks};

/// Phase units in the part of a step to which blocks know their ends.
const PART: u16 = STEP >> PARTS_LOG2;

/// The exponent of it.
const PART_LOG2: u8 = STEP_LOG2 - PARTS_LOG2;

/// Half a step, in such parts.
const HALF: u8 = 1 << (PARTS_LOG2 - 1);

/// Most ticks of a segment that has more than steps ask for.
const LIMIT_MAX: u16 = 2000;

/// Longest stretch, CPU cycles.
pub const CYCLES_MAX: u32 = 1 << 20;

/// Most time of moves without steps that is kept, CPU cycles: a minute.
const KEPT_MAX: u32 = (1 << 30) - 1;

/// Longest tick.
const PERIOD_MAX: u32 = 0xFFFF;

/// Blocks that take longer than 1/16 s have fine ticks: that power of two.
pub const FINE_LOG2: i8 = -4;

/// Latest cycle of a tick at which the interrupt may find itself ready for its pulses.
const SETTLE: u8 = 76;

/// Latest cycle behind its tick at which a segment's directions stand.
const TURNED: u16 = 158;

/// Ticks and period of a segment for motors beside a block that stands still.
const ASIDE: (u16, u16) = (64, 500);

/// Of one in which they go no farther than 1/32 step.
const ASIDE_LITTLE: (u16, u16) = (1, 16_000);

/// A lockstep segment has at least half as many ticks, if it is shorter than as many steps.
const LOCKSTEP_TICKS: u16 = 16;

/// If it is longer than so many cycles: a shorter one may not have the time for as many.
const LOCKSTEP_CYCLES: u32 = LOCKSTEP_TICKS as u32 * TICKS[0].coarsest as u32;

/// The state of the preparation of one block.
#[derive(Debug)]
#[repr(C)]
pub struct Prep {
    // What is used most comes first: the CPU reaches 64 bytes from a pointer.
    /// Phase units of the dominant motor until the block's end.
    left: u32,
    /// Time that has not been used, CPU cycles.
    time: i32,
    /// Way of the dominant motor, in parts of a step or in whole steps.
    most: u16,
    /// The ways of this block are in parts of a step ([`PART`]).
    parts: bool,
    /// The shift for which increments have been computed; none yet if above [`STEP_LOG2`].
    shift: u8,
    /// Motors that go as far as the dominant one.
    full: u8,
    /// Motors that go less far.
    minor: u8,
    /// Motors that move, less one.
    others: u8,
    backwards: u8,
    /// Ticks are to be as fine as can be.
    fine: bool,
    /// Ticks are to be as few as in a block of one segment.
    coarse: bool,
    /// A motor has turned round, and no segment tells of it yet.
    turned: bool,
    /// How long directions must stand before the first step, CPU cycles.
    setup: u16,
    /// What the dominant motor's way is without debts, in the same units, signed.
    own: i16,
    /// How far the dominant motor is past half a step, in its direction, at the block's end: 1/16 step, modulo 16.
    past: u8,
    /// Phase units, positive forwards: how far blocks have told a motor to go, the running one included, less how far segments
    /// have. Modulo 2^16; at the end of a block it is less than that.
    debt: [i16; MOTORS],
    /// How far the end of the block is beyond half a step before the whole step that it is rounded to, in 1/16 step.
    fraction: [u8; MOTORS],
    minors: [Minor; MOTORS],
    /// By the number of motors that move, less one.
    paces: [Pace; MOTORS],
    /// A segment that comes behind one in which directions settle.
    held: Option<Segment>,
    extruder: [Advance; EXTRUDERS],
}

impl Prep {
    /// A preparation without a block.
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
            fraction: [HALF; MOTORS],
            shift: u8::MAX,
            full: 0,
            minor: 0,
            others: 0,
            backwards: 0,
            fine: false,
            coarse: false,
            turned: false,
            paces: paces(Drivers::USUAL),
            setup: Drivers::USUAL.setup(),
            held: None,
            extruder: [Advance::NONE; EXTRUDERS],
        }
    }

    /// From the next block on, this is what the drivers ask for.
    #[inline(never)]
    #[small]
    pub fn set_drivers(&mut self, drivers: Drivers) {
        self.paces = paces(drivers);
        self.setup = drivers.setup();
    }

    /// The segment that comes before any other, if there is one.
    #[inline(always)]
    pub fn held(&mut self, out: &mut Segment) -> bool {
        // Looked at first: to take nothing costs as much as to take something.
        self.held.is_some() && self.release(out)
    }

    #[inline(never)]
    fn release(&mut self, out: &mut Segment) -> bool {
        if let Some(segment) = self.held.take() {
            *out = segment;
        }
        true
    }

    /// Whether ticks are to be as fine as can be, from now on, or as coarse.
    #[inline(always)]
    pub fn refine(&mut self, fine: bool, coarse: bool) {
        (self.fine, self.coarse) = (fine, coarse);
    }

    /// Phase units of the dominant motor in the block that no segment has covered yet.
    pub fn left(&self) -> u32 {
        self.left
    }

    /// How far the dominant motor goes in the block, debts apart, phase units. What a debt adds belongs to the first stretch, as
    /// does its time.
    pub fn own(&self) -> u32 {
        product(self.own.unsigned_abs(), if self.parts { PART } else { STEP })
    }

    /// `cycles` with what has been kept of the time before, at least 1.
    #[inline(always)]
    fn with_kept(&self, cycles: u32) -> u32 {
        // What is kept is below 2^30.
        let sum = self.time.wrapping_add(cycles as i32);
        if sum > 0 { sum as u32 } else { 1 }
    }

    /// Time that has not been used, CPU cycles.
    #[inline(always)]
    pub fn kept(&self) -> i32 {
        self.time
    }

    /// Forgets time that has not been used: the machine stands still.
    pub fn rest(&mut self) {
        self.time = 0;
    }

    /// Prepares a stretch of `cycles`, up to [`CYCLES_MAX`], at the end of which the dominant motor has
    /// about `left` phase units to go. False, and no segment, when that time is kept for the next stretch.
    pub fn segment(&mut self, left: u32, cycles: u32, out: &mut Segment) -> bool {
        let travel = self.left.saturating_sub(left);
        let cycles = self.with_kept(cycles);
        let limit = self.most_ticks(cycles, travel);
        let (mut fine, mut shift) = coarsen(travel, limit);
        // From where a tick is a step; of fine ticks, from the middle between two, where the interrupt has time for a segment.
        let middle = if shift < STEP_LOG2 - 1 { STEP / 2 } else { 0 };
        // No tick is longer than a step.
        let at = (self.left as u16)
            .wrapping_sub((u16::from(self.past) << PART_LOG2).wrapping_add(middle));
        let mut step = bit(shift);
        if at & (step - 1) != 0 {
            let fits = self.fitting(shift, at.trailing_zeros() as u8, cycles, travel);
            if fits != shift {
                (fine, shift) = (finer(travel, fits), fits);
                step = bit(shift);
            }
        }
        let rest = step - 1;
        let mut ticks = whole_ticks(fine, shift);
        let grain = grain(ticks, shift);
        let short = (travel as u16).wrapping_sub(at & !rest) & (bit(grain) - 1);
        if travel <= u32::from(short) {
            return self.idle(cycles, out);
        }
        // Whole ticks of the travel without what is short.
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

    /// The exponent of ticks that end on the steps of the dominant motor: `fits`, if `shift` is more and there is time.
    fn fitting(&self, shift: u8, fits: u8, cycles: u32, travel: u32) -> u8 {
        // A period that is no longer than the shortest may have been made as long.
        let finer = fits < shift
            && self.period(cycles, finer(travel, fits), fits) > u32::from(self.paces().settles);
        if finer { fits } else { shift }
    }

    /// Prepares the whole of a block that begins: `cycles` for it, no more than a few milliseconds. False,
    /// and no segment, when it has no steps; the time is kept then.
    ///
    /// What `last` gives for such a block, in fewer cycles. Cost: 700, and 400 for each motor but the dominant.
    #[inline(never)]
    pub fn whole(&mut self, cycles: u32, exact: bool, out: &mut Segment) -> bool {
        let cycles = self.with_kept(cycles);
        let most = self.most;
        let limit = self.limit(cycles, COARSEST);
        // What has been kept may be long.
        if exact || most == 0 || !self.parts || cycles >> 24 != 0 {
            return self.last_of(cycles, limit, exact, out);
        }
        if most < u16::from(HALF) {
            // Nothing moves yet: the next block goes all the way.
            self.left = 0;
            return self.last_of(cycles, limit, exact, out);
        }
        // Ticks of a part, finer or coarser; and so many times the period.
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

    /// Completes a segment that has ticks and a period, in the `cycles` there are: `step` for the motors that
    /// move as the dominant one, and what `minor` says for the others.
    #[inline(always)]
    fn complete(
        &mut self,
        cycles: u32,
        step: u16,
        out: &mut Segment,
        minor: impl Fn(&mut Self, usize) -> u16,
    ) {
        let used = product(out.ticks, out.period);
        // Time that cannot be caught up is let go, or the machine would race to do so. A tick may be half ahead.
        let mut time = cycles as i32 - used as i32;
        if time < -1000 {
            time = time.max(-1000 - i32::from(out.period / 2));
        }
        self.time = time;
        out.backwards = self.backwards;
        out.moving = self.full | self.minor;
        let (full, moving) = (self.full, out.moving);
        let ticks = out.ticks;
        let travel = step.wrapping_mul(ticks);
        each_motor!(M => {
            let mut increment = 0;
            if moving & 1 << M != 0 {
                let mut travel = travel;
                increment = step;
                if full & 1 << M == 0 {
                    increment = minor(self, M);
                    travel = increment.wrapping_mul(ticks);
                }
                if out.backwards & 1 << M == 0 {
                    travel = travel.wrapping_neg();
                }
                self.debt[M] = self.debt[M].wrapping_add_unsigned(travel);
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

    /// Prepares the last stretch of the block, everything that is left, in `cycles`; all of it if `exact`, else the nearest
    /// number of ticks. False, and no segment, when nothing is left; the time is kept then.
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
            if fits > shift {
                // The rest of it, in no more ticks than need be.
                (fine, shift) = (finer(left, fits), fits);
            }
        }
        let mut ticks = whole_ticks(fine, shift);
        let period = self.period(cycles, fine, shift).min(PERIOD_MAX);
        let tick = bit(shift);
        if ticks > u32::from(TICKS_MAX) {
            // Too much for one segment: a part of it, and the rest when asked again.
            ticks = TICKS_MAX.into();
        } else if !exact {
            // The nearest; what is over is never above half a tick then.
            ticks += u32::from(left as u16 & (tick - 1) > tick / 2);
            self.left = product(ticks as u16, tick);
        }
        self.emit(ticks as u16, shift, tick, period as u16, cycles, out);
        true
    }

    /// The paces of the motors that move. With a motor above the second the interrupt goes through all of them (`dda::WIDE`), so that
    /// two take as long as three.
    fn paces(&self) -> &Pace {
        let is_wide = self.others == 1 && self.full | self.minor > 0b11;
        &self.paces[usize::from(if is_wide { 2 } else { self.others })]
    }

    /// Most ticks for a stretch of `travel`: fine ones, if they are to be, where no more than every fourth tick is a step. The
    /// interrupt takes longer for a tick with a step, and would leave too little to exec.
    #[inline(never)]
    fn most_ticks(&self, cycles: u32, travel: u32) -> u16 {
        if self.fine {
            let fine = self.limit(cycles, self.paces().fine);
            if travel >> (STEP_LOG2 - 2) <= u32::from(fine) {
                return fine;
            }
        }
        self.limit(cycles, if self.coarse { COARSEST } else { self.paces().coarse })
    }

    /// Most ticks for a stretch.
    #[inline(always)]
    fn limit(&self, cycles: u32, pace: u16) -> u16 {
        let in_lockstep = self.minor == 0 && !self.leads();
        if in_lockstep && cycles > LOCKSTEP_CYCLES {
            return LOCKSTEP_TICKS;
        }
        let cycles = if cycles > PERIOD_MAX { u16::MAX } else { cycles as u16 };
        // Of 22 bits, 16 are dropped for nothing.
        let limit = (product(cycles, pace) >> 16) as u16 >> 6;
        limit.clamp(1, if in_lockstep { LOCKSTEP_TICKS } else { LIMIT_MAX })
    }

    /// Cycles from tick to tick when a stretch of so many parts of a tick ([`coarsen`]) takes `cycles`; no less than
    /// can be sustained, at most 2^16 if it does not fit 16 bits.
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

    /// Prepares a pause: the next step is too far off. A tick of the time there is, at most; short times
    /// are kept.
    fn idle(&mut self, cycles: u32, out: &mut Segment) -> bool {
        if cycles < PERIOD_MAX / 2 {
            self.time = cycles as i32;
            return false;
        }
        let period = if cycles > PERIOD_MAX { u16::MAX } else { cycles as u16 };
        self.time = (cycles - u32::from(period)) as i32;
        // By far long enough for directions.
        self.turned = false;
        self.pause(1, period, out);
        true
    }

    /// A segment in which nothing moves.
    pub fn pause(&self, ticks: u16, period: u16, out: &mut Segment) {
        *out = Segment { ticks, period, backwards: self.backwards, ..Segment::default() };
    }

    /// A segment of `ticks` in each of which the dominant motor travels a `step` of `1 << shift`.
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

    /// The first segment after motors have turned round, or, if its first steps come too soon after
    /// that, a tick in which directions settle. Its time is not made up for.
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

    /// Computes the increments for ticks in which the dominant motor travels `1 << shift`.
    #[inline(never)]
    fn scale(&mut self, shift: u8, step: u16) {
        let first = core::mem::replace(&mut self.shift, shift) == u8::MAX && self.parts;
        let (most, others) = (self.most, self.minor);
        each_motor!(M => if others & 1 << M != 0 {
            let minor = &mut self.minors[M];
            (minor.increment, minor.remainder) = share(minor.way, step, most);
            if first {
                // Its way has them.
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
    use super::*;

    /// Three steps of 50 us and a half: what is left takes half as long as a step, not sixteen of the shortest ticks.
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
}
