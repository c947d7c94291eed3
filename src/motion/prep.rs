//! From a stretch of path to a segment: tick period, tick count and per-motor increments, in integers.
//!
//! Owned by the exec task, which calls [`Prep::begin`] for a block and then [`Prep::segment`] or
//! [`Prep::last`] for each stretch of it.
//!
//! The motor with the most steps in a block is dominant. Its increment is `STEP / 2^k`, so it steps on
//! every `2^k`th tick exactly, with no jitter; `k` is as large as the shortest tick period allows, so
//! that the other motors, which may step on any tick, stay close to their true times too. If all motors
//! that move make the same number of steps there are no others: then `k` is 0 as far as can be, and
//! the interrupt has next to nothing to do (lockstep).
//!
//! A stretch is cut to whole ticks, and so that coarser ticks fit what is left. What is cut off is
//! still in `left` and comes with the next stretch, as does its time: nothing is lost.
//!
//! The other motors get the rounded increment, and [`Minor::owed`] remembers exactly what rounding
//! took: a segment in which it comes to half a unit a tick or more is corrected by a unit a tick. It is
//! carried from segment to segment, and over the end of the block: never above half a tick count, far
//! below half a step, so every block ends exactly on its step.
//!
//! Cost on AVR: 600 cycles a segment and 150 for each motor that moves; 600 for `begin`, and 300 for each
//! motor when `k` changes.

use super::dda::{STEP, Segment, start};
use super::divide::{quotient, quotient_remainder};
use super::pace::{COARSEST, Drivers, Pace, paces};
use crate::boards::{MOTORS, each_motor};

const STEP_LOG2: u8 = 15;

/// Most steps of a motor in a block: phase units of a block fit 30 bits.
pub const STEPS_MAX: u16 = 0x7FFF;

/// Most ticks of a segment: keeps the rounding rest below [`super::dda::PHASE_MARGIN`].
pub const TICKS_MAX: u16 = 2000;

/// Longest stretch, CPU cycles.
pub const CYCLES_MAX: u32 = 1 << 20;

/// Most time of moves without steps that is kept, CPU cycles: a minute.
const KEPT_MAX: u32 = (1 << 30) - 1;

/// Longest tick.
const PERIOD_MAX: u32 = 0xFFFF;

/// Blocks that take longer than 1/16 s have fine ticks: that power of two.
pub const FINE_LOG2: i8 = -4;

/// Latest cycle of a tick at which the interrupt may find itself ready for its pulses.
const SETTLE: u8 = 68;

/// Latest cycle behind its tick at which a segment's directions stand.
const TURNED: u16 = 150;

/// A lockstep segment has at least half as many ticks, if it is shorter than as many steps.
const LOCKSTEP_TICKS: u32 = 16;

/// A motor that moves but does not step on every tick of the dominant one.
#[derive(Clone, Copy, Debug, Default)]
struct Minor {
    /// Its steps in the block.
    steps: u16,
    /// Travel in a tick, rounded down, and what that leaves, in 1 / most.
    increment: u16,
    remainder: u16,
    /// What increments owe the line from start to end, in phase units / most.
    owed: i32,
}

/// The state of the preparation of one block.
#[derive(Debug)]
#[repr(C)]
pub struct Prep {
    // What is used most comes first: the CPU reaches 64 bytes from a pointer.
    /// Phase units of the dominant motor until the block's end.
    left: u32,
    /// Time that has not been used, CPU cycles.
    time: i32,
    /// Steps of the dominant motor.
    most: u16,
    /// The shift for which increments have been computed; none yet if above [`STEP_LOG2`].
    shift: u8,
    /// Motors that make as many steps as the dominant one.
    full: u8,
    /// Motors that make some, but fewer.
    minor: u8,
    /// Motors that move, less one.
    others: u8,
    backwards: u8,
    /// Ticks are to be as fine as can be.
    fine: bool,
    /// A motor has turned round, and no segment tells of it yet.
    turned: bool,
    /// How long directions must stand before the first step, CPU cycles.
    setup: u16,
    /// Phase units that a motor is short of at the end of a block.
    debt: [i16; MOTORS],
    minors: [Minor; MOTORS],
    /// By the number of motors that move, less one.
    paces: [Pace; MOTORS],
    /// A segment that comes behind one in which directions settle.
    held: Option<Segment>,
}

impl Prep {
    /// Nothing to prepare.
    pub const fn new() -> Self {
        const MINOR: Minor = Minor { steps: 0, increment: 0, remainder: 0, owed: 0 };
        Self {
            left: 0,
            time: 0,
            most: 0,
            minors: [MINOR; MOTORS],
            debt: [0; MOTORS],
            shift: u8::MAX,
            full: 0,
            minor: 0,
            others: 0,
            backwards: 0,
            fine: false,
            turned: false,
            paces: paces(Drivers::USUAL),
            setup: Drivers::USUAL.setup(),
            held: None,
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

    /// Whether ticks are to be as fine as can be, from now on.
    #[inline(always)]
    pub fn refine(&mut self, fine: bool) {
        self.fine = fine;
    }

    /// Starts a block. Its steps are added to `target`.
    #[inline(never)]
    pub fn begin(&mut self, steps: &[i16; MOTORS], target: &mut [i32; MOTORS]) {
        self.shift = u8::MAX;
        let (mut most, mut moving, mut full, mut others) = (0, 0, 0, u8::MAX);
        each_motor!(M => {
            let (signed, bit) = (steps[M], 1 << M);
            if signed != 0 {
                others = others.wrapping_add(1);
                moving |= bit;
                target[M] = target[M].wrapping_add(signed.into());
                let steps = signed.unsigned_abs();
                self.minors[M].steps = steps;
                if steps > most {
                    (most, full) = (steps, 0);
                }
                if steps == most {
                    full |= bit;
                }
                let backwards = if signed < 0 { bit } else { 0 };
                if backwards != self.backwards & bit {
                    self.turn(M, bit);
                }
            }
        });
        self.most = most;
        self.left = u32::from(most) << STEP_LOG2;
        self.full = full;
        self.minor = moving & !full;
        // Without motors there are no ticks to pace.
        self.others = if moving == 0 { 0 } else { others };
    }

    /// Motor `m` turns round.
    #[inline(never)]
    fn turn(&mut self, m: usize, bit: u8) {
        self.backwards ^= bit;
        self.turned = true;
        // It was measured in the old direction.
        self.debt[m] = -self.debt[m];
    }

    /// Phase units of the dominant motor in the block that no segment has covered yet.
    pub fn left(&self) -> u32 {
        self.left
    }

    /// `cycles` with what has been kept of the time before, at least 1.
    #[inline(always)]
    fn with_kept(&self, cycles: u32) -> u32 {
        // What is kept is below 2^30.
        let sum = self.time.wrapping_add(cycles as i32);
        if sum > 0 { sum as u32 } else { 1 }
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
        let limit = self.limit(cycles, self.pace());
        let (_, shift) = coarsen(travel, limit);
        // What is left must be whole ticks, now and at the end: of up to an eighth of this stretch.
        let shift = shift.min(self.left.trailing_zeros() as u8);
        let grain = grain(travel >> shift, shift);
        let short = (self.left - travel).wrapping_neg() & !(u32::MAX << grain);
        if travel <= short {
            return self.idle(cycles, out);
        }
        let aligned = travel - short;
        let ticks = ((aligned >> shift) as u16).min(TICKS_MAX);
        let period = self.period(cycles, travel, shift);
        if period > PERIOD_MAX {
            return self.idle(cycles, out);
        }
        self.emit(ticks, shift, period as u16, cycles, out);
        true
    }

    /// Prepares the whole of a block that begins: `cycles` for it, no more than a few milliseconds. False,
    /// and no segment, when it has no steps; the time is kept then.
    ///
    /// The same as `last` for it, but short and simple. Cost: 700, and 400 for each motor but the dominant.
    #[inline(never)]
    pub fn whole(&mut self, cycles: u32, out: &mut Segment) -> bool {
        let cycles = self.with_kept(cycles);
        let most = self.most;
        if most == 0 || most > TICKS_MAX {
            return self.last_of(cycles, COARSEST, out);
        }
        let limit = self.limit(cycles, COARSEST) as u16;
        let (mut ticks, mut increment) = (most, STEP);
        while ticks <= limit / 2 {
            ticks *= 2;
            increment /= 2;
        }
        let shortest = self.paces().shortest;
        let long = (cycles >> 16) as u16 >= ticks;
        let period = if long { u16::MAX } else { quotient(cycles + u32::from(ticks / 2), ticks) };
        let period = period.max(shortest);
        self.left = 0;
        out.ticks = ticks;
        out.period = period;
        out.settle = 0;
        self.complete(cycles, increment, out, |prep, m| prep.even(m, ticks));
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
        let used = u32::from(out.ticks) * u32::from(out.period);
        // Time that cannot be caught up is let go, or the machine would race to do so.
        self.time = (cycles as i32 - used as i32).max(-1000);
        out.backwards = self.backwards;
        out.moving = self.full | self.minor;
        let (full, others) = (self.full, self.minor);
        each_motor!(M => out.increment[M] = match 1 << M {
            bit if full & bit != 0 => step,
            bit if others & bit != 0 => minor(self, M),
            _ => 0,
        });
        out.seal(self.full, step);
        if self.turned {
            self.behind_turn(out);
        }
    }

    /// The increment that takes a motor over its block in `ticks`, and what it is short of then.
    fn even(&mut self, m: usize, ticks: u16) -> u16 {
        let wanted = (u32::from(self.minors[m].steps) << 16 >> 1) as i32 + i32::from(self.debt[m]);
        let wanted = wanted.max(0);
        let increment = quotient(wanted as u32 + u32::from(ticks / 2), ticks).min(STEP);
        self.debt[m] = (wanted - (u32::from(increment) * u32::from(ticks)) as i32) as i16;
        increment
    }

    /// Prepares the last stretch of the block, everything that is left, in `cycles`. False,
    /// and no segment, when nothing is left; the time is kept then.
    pub fn last(&mut self, cycles: u32, out: &mut Segment) -> bool {
        let cycles = self.with_kept(cycles);
        self.last_of(cycles, self.pace(), out)
    }

    fn last_of(&mut self, cycles: u32, pace: u16, out: &mut Segment) -> bool {
        if self.left == 0 {
            self.time = cycles.min(KEPT_MAX) as i32;
            return false;
        }
        let (_, shift) = coarsen(self.left, self.limit(cycles, pace));
        // Ticks that do not go into what is left would leave a rest.
        let shift = shift.min(self.left.trailing_zeros() as u8);
        let ticks = self.left >> shift;
        if ticks > u32::from(TICKS_MAX) {
            // Too much for one segment: a part of it, and the rest when asked again.
            let period = self.period(cycles, self.left, shift) as u16;
            self.emit(TICKS_MAX, shift, period, cycles, out);
            return true;
        }
        let period = self.period(cycles, self.left, shift).min(PERIOD_MAX);
        self.emit(ticks as u16, shift, period as u16, cycles, out);
        true
    }

    fn paces(&self) -> &Pace {
        &self.paces[usize::from(self.others)]
    }

    fn pace(&self) -> u16 {
        let pace = self.paces();
        if self.fine { pace.fine } else { pace.coarse }
    }

    /// Most ticks for a stretch.
    fn limit(&self, cycles: u32, pace: u16) -> u32 {
        if self.minor == 0 {
            return LOCKSTEP_TICKS;
        }
        let cycles = if cycles > PERIOD_MAX { u16::MAX } else { cycles as u16 };
        let limit = (u32::from(cycles) * u32::from(pace)) >> 22;
        limit.clamp(1, TICKS_MAX.into())
    }

    /// Cycles from tick to tick when a stretch of `travel` takes `cycles`; no less than
    /// can be sustained, at most 2^16 if it does not fit 16 bits.
    fn period(&self, cycles: u32, travel: u32, shift: u8) -> u32 {
        // In 1/32 tick, as far as that fits 16 bits.
        let (mut cycles, mut ticks) = match shift {
            0..5 => (cycles << shift, travel),
            _ => (cycles << 5, travel >> (shift - 5)),
        };
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

    /// Nothing moves: the next step is too far off. A tick of the time there is, at most; short times
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

    /// The block ends here and now: what of its steps no segment has is taken off `target`. Every motor is at
    /// its last step from now on ([`Dda::settle`](super::dda::Dda::settle)). Returns the segment that
    /// was to come next, if it has been prepared.
    /// Cost: 4,000 a motor.
    #[inline(never)]
    #[small]
    pub fn cut(&mut self, target: &mut [i32; MOTORS]) -> Option<Segment> {
        let mut bit = 1;
        for (m, target) in target.iter_mut().enumerate() {
            if (self.full | self.minor) & bit != 0 && self.left != 0 {
                let backwards = self.backwards & bit != 0;
                let steps = steps_of(self.short_of(m, bit), backwards);
                *target = target.wrapping_add(if backwards { steps } else { -steps });
            }
            bit <<= 1;
        }
        self.left = 0;
        self.time = 0;
        self.debt = [0; MOTORS];
        // The segment that was to tell of it may be among those that are lost.
        self.turned = true;
        self.held.take()
    }

    /// Phase units that a motor is short of its target: exact.
    #[inline(never)]
    #[small]
    fn short_of(&self, m: usize, bit: u8) -> i32 {
        let (minor, debt) = (&self.minors[m], i32::from(self.debt[m]));
        if self.full & bit != 0 {
            return self.left as i32 + debt;
        }
        if self.shift == u8::MAX {
            // Nothing of the block has been prepared.
            return (i32::from(minor.steps) << STEP_LOG2) + debt;
        }
        let wide = i64::from(minor.steps) * i64::from(self.left) + i64::from(minor.owed);
        (wide / i64::from(self.most)) as i32
    }

    /// A segment in which nothing moves.
    pub fn pause(&self, ticks: u16, period: u16, out: &mut Segment) {
        *out = Segment { ticks, period, backwards: self.backwards, ..Segment::default() };
    }

    /// A segment of `ticks` in each of which the dominant motor travels `1 << shift`.
    #[inline(never)]
    fn emit(&mut self, ticks: u16, shift: u8, period: u16, cycles: u32, out: &mut Segment) {
        if shift != self.shift {
            if self.shift == u8::MAX {
                self.take_up_debts();
            }
            self.scale(shift);
        }
        self.left -= u32::from(ticks) << shift;
        out.ticks = ticks;
        out.period = period;
        let settles = period >= self.paces().settles;
        out.settle = if settles { SETTLE } else { 0 };
        self.complete(cycles, 1 << shift, out, |prep, m| prep.minors[m].advance(ticks, prep.most));
        if self.left == 0 {
            self.settle_debts();
        }
    }

    /// What motors are short of from blocks before, in the units of this one.
    fn take_up_debts(&mut self) {
        let mut bit = 1;
        for m in 0..MOTORS {
            if self.minor & bit != 0 {
                self.minors[m].owed = product(self.debt[m], self.most);
            }
            bit <<= 1;
        }
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
    fn scale(&mut self, shift: u8) {
        self.shift = shift;
        each_motor!(M => if self.minor & 1 << M != 0 {
            let minor = &mut self.minors[M];
            let travel = u32::from(minor.steps) << shift;
            (minor.increment, minor.remainder) = quotient_remainder(travel, self.most);
        });
    }

    /// The block is done: what its motors are short of goes into the next.
    fn settle_debts(&mut self) {
        let mut bit = 1;
        for (debt, minor) in self.debt.iter_mut().zip(&self.minors) {
            if self.minor & bit != 0 {
                // Exact: the line has arrived at a whole step.
                let owed = minor.owed.unsigned_abs();
                let whole = if owed == 0 { 0 } else { quotient(owed, self.most) as i16 };
                *debt = if minor.owed < 0 { -whole } else { whole };
            }
            bit <<= 1;
        }
    }
}

impl Default for Prep {
    fn default() -> Self {
        Self::new()
    }
}

impl Minor {
    /// The increment for the next `ticks`, and what it owes then.
    fn advance(&mut self, ticks: u16, most: u16) -> u16 {
        let unit = u32::from(ticks) * u32::from(most);
        let half = (unit / 2) as i32;
        let mut owed = self.owed + (u32::from(ticks) * u32::from(self.remainder)) as i32;
        let mut increment = self.increment;
        if owed > half {
            let more = if owed - (unit as i32) <= half { 1 } else { rounded(owed as u32, unit) };
            let more = more.min(STEP - increment);
            increment += more;
            owed -= product_wide(unit, more);
        } else if owed < -half {
            let less =
                if owed + (unit as i32) >= -half { 1 } else { rounded(owed.unsigned_abs(), unit) };
            let less = less.min(increment);
            increment -= less;
            owed += product_wide(unit, less);
        }
        self.owed = owed;
        increment
    }
}

/// `owed / unit`, rounded. Rare: a debt that meets a short segment.
#[inline(never)]
fn rounded(owed: u32, unit: u32) -> u16 {
    ((owed + unit / 2) / unit) as u16
}

/// The steps in the last `travel` phase units before a whole step.
fn steps_of(travel: i32, backwards: bool) -> i32 {
    let last = i32::from(start(backwards));
    if travel <= last { 0 } else { (travel - last + i32::from(STEP - 1)) >> STEP_LOG2 }
}

fn product(a: i16, b: u16) -> i32 {
    let size = (u32::from(a.unsigned_abs()) * u32::from(b)) as i32;
    if a < 0 { -size } else { size }
}

fn product_wide(unit: u32, times: u16) -> i32 {
    match times {
        0 => 0,
        1 => unit as i32,
        _ => (unit * u32::from(times)) as i32,
    }
}

/// Ticks of a travel, no more than `limit` if steps allow, and the shift between the two.
fn coarsen(travel: u32, limit: u32) -> (u32, u8) {
    let mut shift = 0;
    let mut ticks = travel;
    while ticks > limit && shift < STEP_LOG2 {
        ticks >>= 1;
        shift += 1;
    }
    (ticks, shift)
}

/// The exponent of what a stretch's end is aligned to: a tick, up to an eighth of the stretch, up to a
/// step.
fn grain(ticks: u32, shift: u8) -> u8 {
    let mut grain = shift;
    let mut eighth = ticks >> 4;
    while eighth != 0 && grain < STEP_LOG2 {
        eighth >>= 1;
        grain += 1;
    }
    grain
}
