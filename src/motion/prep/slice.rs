//! Samples: segments for motors whose distances come from the means ([`Smooth`](super::super::smooth::Smooth)).
//!
//! Exec calls [`Prep::slice`] for each sample. The motor that goes farthest is dominant, as in a block: it steps on
//! every `2^k`th tick exactly. Its distance is cut so that the segment ends on a step, or in the middle between two
//! steps where a step has more ticks. The remainder of its distance, and the time of the remainder, belong to the next
//! sample. The other motors go in proportion. What they lack or have gone too far by rounding, less than a phase unit a
//! tick, belongs to the next sample, too ([`Prep::debt`]).
//!
//! A motor that becomes dominant may be anywhere between two steps. In its first segment its ticks are not exact, and
//! the segment ends on a step.
//!
//! At the end of motion [`Prep::finish`] makes what is left in one tick.
//!
//! Cost on AVR: 1,800 cycles a segment, and 500 for each motor that moves.

use super::super::divide::quotient;
use super::super::smooth::{CHANNELS, SAMPLE_CYCLES};
use super::ticks::{bit, grain};
use super::{PART, PERIOD_MAX, Prep, SETTLE};
use crate::boards::{MOTORS, each_motor};
use crate::dda::{STEP, STEP_LOG2, Segment, TICKS_MAX};
use crate::hal::arithmetic::product;

/// A distance that a motor may be off its place at a standstill, phase units. It is well below
/// [`PHASE_MARGIN`](crate::dda::PHASE_MARGIN), so that no step depends on it.
const LITTLE: u32 = PART as u32 / 8;

/// Ticks and period of the segment that makes what is left at the end of motion.
const FINISH: (u16, u16) = (1, 16_000);

/// Ticks and period of a sample in which only the lead of the extruder moves.
const LEAD_TICKS: u16 = (SAMPLE_CYCLES / LEAD_PERIOD as u32) as u16;
const LEAD_PERIOD: u16 = 500;
const _: () = assert!(LEAD_TICKS <= TICKS_MAX);

/// The distances of a segment, and its dominant motor.
struct Distances {
    /// What each motor is to go at most, phase units.
    sizes: [u32; MOTORS],
    /// The dominant motor.
    dominant: usize,
    most: u32,
    /// How far the dominant motor is past a step, in its direction.
    past: u16,
}

impl Prep {
    /// Makes the segment of a sample in which the motors are to go these `distances`, in [`SAMPLE_CYCLES`]. Moves
    /// `target`, in steps, to the end of the sample.
    #[inline(never)]
    pub fn slice(
        &mut self,
        distances: &[i32; CHANNELS],
        target: &mut [i32; MOTORS],
        out: &mut Segment,
    ) {
        let mut all = Distances { sizes: [0; MOTORS], dominant: 0, most: 0, past: 0 };
        self.collect(distances, target, &mut all);
        if self.has_advance() {
            self.aim_sampled(distances);
        }
        let cycles = self.with_kept(SAMPLE_CYCLES);
        if all.most < LITTLE {
            return self.stand_still(cycles, out);
        }
        // The distance of the dominant motor in 16 bits.
        let (mut short, mut shift) = (all.most, 0);
        while short > 0xFFFF {
            short >>= 1;
            shift += 1;
        }
        let short = (short as u16, shift);
        let (ticks, travel) = self.divide(&all, short, cycles);
        if travel == 0 {
            return self.stand_still(cycles, out);
        }
        self.share_out(&all, short, (ticks, travel), cycles, out);
    }

    /// Collects what each motor is to go, and its direction.
    #[inline(always)]
    fn collect(
        &mut self,
        distances: &[i32; CHANNELS],
        target: &mut [i32; MOTORS],
        all: &mut Distances,
    ) {
        (self.full, self.minor, self.others) = (0, 0, u8::MAX);
        self.left = 0;
        each_motor!(M => {
            if distances[M] != 0 || !is_nearly_none(self.debt[M]) {
                self.take_in(M, distances[M], &mut target[M], all);
            }
        });
        if self.minor == 0 {
            self.others = 0;
        } else if self.others == 0 && !self.leads() {
            // It moves alone: its ticks are those of lockstep.
            (self.full, self.minor) = (self.minor, 0);
        }
    }

    /// Takes in what a motor is to go, besides its debt.
    #[inline(never)]
    fn take_in(&mut self, m: usize, way: i32, target: &mut i32, all: &mut Distances) {
        let before = self.place[m];
        if way != 0 {
            let place = i32::from(before) + way;
            self.place[m] = place as u16 & (STEP - 1);
            *target = target.wrapping_add(place >> STEP_LOG2);
        }
        let owed = self.debt[m];
        let goes = way + owed;
        self.debt[m] = goes;
        if goes == 0 || (goes ^ way) < 0 && way != 0 {
            // Rounding has taken it too far: it stands until the path has caught up.
            return;
        }
        let bit = 1 << m;
        let turned = (goes < 0) != (self.backwards & bit != 0);
        if turned {
            self.backwards ^= bit;
            self.turned = true;
        }
        self.minor |= bit;
        self.others = self.others.wrapping_add(1);
        let size = goes.unsigned_abs();
        all.sizes[m] = size;
        if size > all.most {
            (all.most, all.dominant) = (size, m);
            let made = before.wrapping_sub(owed as u16);
            all.past = if goes < 0 { (STEP - PART).wrapping_sub(made) } else { made };
        }
    }

    /// Returns the ticks of a segment, and how far the dominant motor goes. `short` is its distance in 16 bits, and the
    /// power of two that this leaves out.
    #[inline(always)]
    fn divide(&self, all: &Distances, short: (u16, u8), cycles: u32) -> (u16, u32) {
        let most = all.most;
        let limit = self.most_ticks(cycles, most);
        let (mut few, mut shift) = short;
        while few > limit && shift < STEP_LOG2 {
            few >>= 1;
            shift += 1;
        }
        let grain = bit(grain(few.into(), shift));
        let middle = if shift < STEP_LOG2 - 1 { STEP / 2 } else { 0 };
        let end = all.past.wrapping_add(most as u16).wrapping_sub(middle);
        let travel = most - u32::from(end & (grain - 1));
        let tick = bit(shift);
        // A motor makes a step in a tick at most, so the longest ticks are rounded up.
        let more = if shift == STEP_LOG2 { tick - 1 } else { tick / 2 };
        let ticks = (travel + u32::from(more)) >> shift;
        let ticks = ticks.clamp(1, u32::from(TICKS_MAX)) as u16;
        // Less than half a phase unit in each tick is rounding: the ticks are exact.
        let exact = product(ticks, tick);
        let travel = if travel.abs_diff(exact) <= u32::from(ticks / 2) { exact } else { travel };
        (ticks, travel)
    }

    /// Makes the segment: the dominant motor goes `travel` in `ticks`, and the others in proportion.
    #[inline(always)]
    fn share_out(
        &mut self,
        all: &Distances,
        (most, shift): (u16, u8),
        (ticks, travel): (u16, u32),
        cycles: u32,
        out: &mut Segment,
    ) {
        let increment = quotient(travel + u32::from(ticks / 2), ticks).min(STEP);
        let moving = self.full | self.minor;
        let mut full = 0;
        each_motor!(M => if moving & 1 << M != 0 {
            let size = (all.sizes[M] >> shift) as u16;
            if M == all.dominant || size == most {
                full |= 1 << M;
            } else {
                self.minors[M].increment = proportion(size, increment, most);
            }
        });
        (self.full, self.minor) = (full, moving & !full);
        let period = self.time_of(increment, (most, shift), cycles);
        out.ticks = ticks;
        out.period = period;
        // The wait takes time that exec lacks where it is late, and thread mode where a host waits for an answer. A motor
        // alone leaves time enough for that.
        let settles = self.paces().settles;
        let presses = self.hurries || self.coarse && self.others > 0;
        let least = if presses { 2 * settles } else { settles };
        out.settle = if period >= least { SETTLE } else { 0 };
        self.complete(cycles, increment, out, |prep, m| prep.minors[m].increment);
    }

    /// Returns the period of ticks in which the dominant motor goes `increment`, if it is to go `most`, in
    /// `2^shift` phase units, in `cycles`.
    #[inline(always)]
    fn time_of(&self, increment: u16, (most, mut shift): (u16, u8), mut cycles: u32) -> u16 {
        let mut halves = 0u8;
        while cycles > 0xFFFF {
            cycles >>= 1;
            if shift > 0 {
                shift -= 1;
            } else {
                halves += 1;
            }
        }
        let time = (product(cycles as u16, increment) >> shift) + u32::from(most / 2);
        let mut period = if (time >> 16) as u16 >= most { u16::MAX } else { quotient(time, most) };
        while halves > 0 {
            period = period.saturating_mul(2);
            halves -= 1;
        }
        period.max(self.paces().shortest)
    }

    /// Makes a segment of a sample in which nothing moves.
    #[inline(never)]
    #[small]
    fn stand_still(&mut self, cycles: u32, out: &mut Segment) {
        if self.leads() {
            return self.lead_alone(out);
        }
        let ticks = cycles.div_ceil(PERIOD_MAX);
        let period = cycles / ticks;
        self.time = (cycles - ticks * period) as i32;
        // By far long enough for directions to settle.
        self.turned = false;
        self.pause(ticks as u16, period as u16, out);
    }

    /// Makes a segment of a sample in which nothing moves but the extruder, by its lead.
    #[inline(never)]
    #[small]
    fn lead_alone(&mut self, out: &mut Segment) {
        self.time = 0;
        self.pause(LEAD_TICKS, LEAD_PERIOD, out);
        out.moving = self.minor;
        self.lead(out);
        out.mode = Segment::mode_of(out.moving);
    }

    /// Makes the segment in which motors go what rounding has left them to go at the end of motion. Returns false, and
    /// no segment, if that is little.
    #[inline(never)]
    #[small]
    pub fn finish(&mut self, out: &mut Segment) -> bool {
        self.time = 0;
        if self.debt.iter().all(|debt| is_nearly_none(*debt)) {
            return false;
        }
        let mut all = Distances { sizes: [0; MOTORS], dominant: 0, most: 0, past: 0 };
        self.collect(&[0; CHANNELS], &mut [0; MOTORS], &mut all);
        let (ticks, period) = FINISH;
        let moving = self.full | self.minor;
        (self.full, self.minor) = (0, moving);
        (out.ticks, out.period, out.settle) = (ticks, period, 0);
        self.complete(product(ticks, period), 0, out, |_, m| {
            all.sizes[m].min(u32::from(STEP)) as u16
        });
        true
    }
}

/// Whether a debt may be left at a standstill. Cost: 12.
#[inline(always)]
fn is_nearly_none(debt: i32) -> bool {
    debt.wrapping_add(LITTLE as i32) as u32 / (2 * LITTLE) == 0
}

/// Returns `size * increment / most`, rounded to the nearest.
#[inline(never)]
fn proportion(size: u16, increment: u16, most: u16) -> u16 {
    quotient(product(size, increment) + u32::from(most / 2), most)
}
