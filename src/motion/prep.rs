//! From a stretch of path to a segment: tick period, tick count and per-motor increments, in integers.
//!
//! Owned by the exec task, which calls [`Prep::begin`] for a block and then [`Prep::segment`] or
//! [`Prep::last`] for each stretch of it.
//!
//! The motor with the most steps in a block is dominant. Its increment is `STEP / 2^k`, so it steps on
//! every `2^k`th tick exactly, with no jitter; `k` is as large as the shortest tick period allows, so
//! that the other motors, which may step on any tick, stay close to their true times too. Distances are
//! cut to whole ticks and the rest of distance and time is handed back to exec, which adds it to the
//! next stretch: nothing is lost.
//!
//! The other motors get the increment that takes them nearest to the line from the block's start to
//! its end. What rounding leaves is carried from segment to segment, and over the end of the block, in
//! `left`: it is never above half a tick count, far below half a step, so every block ends exactly on
//! its step.
//!
//! Cost on AVR: about 4,500 cycles a segment with four motors (three divisions and three wide
//! multiplications), 6,000 for `begin`.

use super::block::Block;
use super::dda::{STEP, Segment};
use crate::boards::MOTORS;

const STEP_LOG2: u32 = 15;

/// Shortest tick period, CPU cycles: what the step interrupt sustains beside everything else.
pub const PERIOD_MIN: u16 = 400;

/// `cycles / PERIOD_MIN`, a little too high: 1 / 400 is 10.24 / 4096. A division would take 690 cycles.
fn ticks_in(cycles: u32) -> u32 {
    const { assert!(PERIOD_MIN == 400) };
    (cycles * 41) >> 14
}

/// Most ticks of a segment: keeps the rounding rest below [`super::dda::PHASE_MARGIN`].
pub const TICKS_MAX: u32 = 2000;

/// What a stretch has not used, for the next one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rest {
    /// Phase units of the dominant motor.
    pub distance: u32,
    /// CPU cycles.
    pub cycles: u32,
}

/// The state of the preparation of one block.
#[derive(Debug, Default)]
pub struct Prep {
    /// Phase units until the block's end, modulo 2^32, that the segments so far have not covered.
    left: [u32; MOTORS],
    /// Share of the dominant motor's travel, in 2^-32; unused for the dominant motor.
    ratio: [u32; MOTORS],
    /// What increments owe the line, in phase units.
    owed: [i32; MOTORS],
    /// The same below one phase unit, in 2^-32.
    fraction: [u32; MOTORS],
    /// Motors that make as many steps as the dominant one.
    full: u8,
    backwards: u8,
}

/// Rounded quotient of a non-negative by a positive number.
fn div_round(a: u32, b: u32) -> u32 {
    (a + b / 2) / b
}

/// Rounded quotient of what is wanted by the ticks there are; 0 if it is less than nothing. Motors that
/// stand still are not worth a division.
fn quotient(wanted: i32, ticks: u32) -> u32 {
    let wanted = wanted.max(0) as u32;
    if wanted < ticks / 2 { 0 } else { div_round(wanted, ticks) }
}

impl Prep {
    /// Nothing to prepare.
    pub const fn new() -> Self {
        Self {
            left: [0; MOTORS],
            ratio: [0; MOTORS],
            owed: [0; MOTORS],
            fraction: [0; MOTORS],
            full: 0,
            backwards: 0,
        }
    }

    /// Starts a block. Returns the steps of its dominant motor.
    pub fn begin(&mut self, block: &Block) -> u32 {
        let mut dominant = 0;
        for m in 1..MOTORS {
            if block.steps[m].unsigned_abs() > block.steps[dominant].unsigned_abs() {
                dominant = m;
            }
        }
        let most = block.steps[dominant].unsigned_abs();
        self.full = 0;
        for m in 0..MOTORS {
            self.begin_motor(m, block.steps[m], most);
        }
        most
    }

    fn begin_motor(&mut self, m: usize, steps: i32, most: u32) {
        let bit = 1 << m;
        let backwards = steps < 0;
        // A motor that stands still keeps its direction: no needless edge on the pin.
        if steps != 0 && backwards != (self.backwards & bit != 0) {
            self.backwards ^= bit;
            // The rest was measured in the old direction.
            self.left[m] = self.left[m].wrapping_neg();
        }
        // The rest goes into the block's first segment.
        self.owed[m] = self.left[m] as i32;
        let steps = steps.unsigned_abs();
        self.left[m] = self.left[m].wrapping_add(steps << STEP_LOG2);
        if steps == most {
            self.full |= bit;
        } else {
            self.ratio[m] = ratio(steps, most);
            self.fraction[m] = 0;
        }
    }

    /// The travel of motor `m` while the dominant one travels `distance`.
    fn share(&mut self, m: usize, distance: u32) -> i32 {
        if self.full & (1 << m) != 0 {
            return distance as i32;
        }
        let product = u64::from(distance) * u64::from(self.ratio[m]) + u64::from(self.fraction[m]);
        self.fraction[m] = product as u32;
        (product >> 32) as i32
    }

    /// Prepares a stretch: the dominant motor is to travel `distance` phase units in `cycles` CPU
    /// cycles (1 to 2^17).
    pub fn segment(&mut self, distance: u32, cycles: u32) -> (Segment, Rest) {
        let shift = tick_shift(distance, cycles);
        // Fits 32 bits: `tick_shift` sees to that.
        let period = (cycles << shift).checked_div(distance).unwrap_or(u32::MAX);
        if period > 0xFFFF {
            return self.idle(distance, cycles);
        }
        let period = period.max(u32::from(PERIOD_MIN));
        let ticks = (distance >> shift).clamp(1, TICKS_MAX);
        let travel = ticks << shift;
        let rest =
            Rest { distance: distance - travel, cycles: cycles.saturating_sub(ticks * period) };
        (self.emit(ticks, period as u16, |prep, m| prep.share(m, travel)), rest)
    }

    /// A tick in which nothing moves: the next step is further off than the timer counts.
    pub fn idle(&self, distance: u32, cycles: u32) -> (Segment, Rest) {
        let period = cycles.clamp(1, 0xFFFF);
        let segment = Segment {
            ticks: 1,
            period: period as u16,
            backwards: self.backwards,
            ..Default::default()
        };
        (segment, Rest { distance, cycles: cycles - period })
    }

    /// Prepares the last stretch of the block: everything that is left, in `cycles`. `None` when
    /// nothing is left.
    pub fn last(&mut self, cycles: u32) -> Option<Segment> {
        // All but the dominant motor may have a little more or less left than their share.
        let distance = self.left.iter().map(|left| *left as i32).max().unwrap_or(0);
        // Nothing but a rest of rounding, to either side: leave it to the next block.
        if distance < (STEP / 8).into() {
            return None;
        }
        let distance = distance as u32;
        let shift = tick_shift(distance, cycles);
        // A motor makes a step on each tick at most.
        let ticks = div_round(distance, 1 << shift).max(distance.div_ceil(STEP.into()));
        let ticks = ticks.clamp(1, TICKS_MAX);
        let period = (cycles / ticks).clamp(u32::from(PERIOD_MIN), 0xFFFF);
        for m in 0..MOTORS {
            self.owed[m] = 0;
        }
        Some(self.emit(ticks, period as u16, |prep, m| prep.left[m] as i32))
    }

    /// A segment of `ticks` in which each motor travels what `travel` says plus what it is owed.
    fn emit(
        &mut self,
        ticks: u32,
        period: u16,
        travel: impl Fn(&mut Self, usize) -> i32,
    ) -> Segment {
        let mut segment = Segment {
            ticks: ticks as u16,
            period,
            backwards: self.backwards,
            ..Default::default()
        };
        for m in 0..MOTORS {
            let wanted = travel(self, m) + self.owed[m];
            let increment = quotient(wanted, ticks).min(u32::from(STEP));
            let done = increment * ticks;
            self.owed[m] = wanted - done as i32;
            self.left[m] = self.left[m].wrapping_sub(done);
            segment.increment[m] = increment as u16;
        }
        segment
    }
}

/// `steps / most` in 2^-32, rounded down; `steps < most`.
fn ratio(steps: u32, most: u32) -> u32 {
    ((u64::from(steps) << 32) / u64::from(most.max(1))) as u32
}

/// The exponent of a tick's travel, `STEP >> k`, for the finest tick that keeps ticks at least
/// [`PERIOD_MIN`] apart and makes no more than [`TICKS_MAX`] of them.
fn tick_shift(distance: u32, cycles: u32) -> u32 {
    let finest = ticks_in(cycles).clamp(1, TICKS_MAX);
    // `cycles << shift` must fit 32 bits.
    let most = STEP_LOG2.min(cycles.leading_zeros());
    let mut shift = 0;
    let mut ticks = distance;
    while shift < most && ticks > finest {
        ticks >>= 1;
        shift += 1;
    }
    shift
}
