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

use super::advance::{Advance, EXTRUDERS, Lead, pushed};
use super::block::{Line, PARTS_LOG2};
use super::divide::{quotient, quotient_remainder};
use super::pace::{COARSEST, Drivers, Pace, paces};
use super::retract::Retreat;
use crate::boards::{MOTORS, each_motor};
use crate::dda::{PHASE_START, STEP, Segment, TICKS_MAX};
use crate::hal::arithmetic::product;

const STEP_LOG2: u8 = 15;

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

/// A motor that moves but does not step on every tick of the dominant one.
#[derive(Clone, Copy, Debug, Default)]
struct Minor {
    /// The way of the motor in the block, in parts of a step or in whole steps.
    way: u16,
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

    /// Starts a block. The steps to the whole ones next to its end are put into `steps` and added to `target`.
    #[inline(never)]
    pub fn begin(&mut self, line: &Line, steps: &mut [i16; MOTORS], target: &mut [i32; MOTORS]) {
        self.shift = u8::MAX;
        (self.full, self.minor, self.most, self.others) = (0, 0, 0, u8::MAX);
        self.parts = !line.extent.has_whole_steps();
        if !self.parts {
            self.begin_far(&line.way, steps, target);
            if self.has_advance() {
                self.begin_lead(line);
            }
            return;
        }
        each_motor!(M => {
            let mut way = line.way[M];
            let mut whole = 0;
            let debt = self.debt[M];
            if way != 0 {
                self.debt[M] = debt.wrapping_add(way << PART_LOG2);
                let sum = way + i16::from(self.fraction[M]);
                self.fraction[M] = sum as u8 & 15;
                whole = sum >> PARTS_LOG2;
                target[M] = target[M].wrapping_add(whole.into());
            }
            steps[M] = whole;
            if !is_little(debt) {
                // With the parts of a step that it is short of.
                way += parts_of(debt) >> PART_LOG2;
            }
            if way != 0 {
                self.take_up(M, 1 << M, way, line.way[M]);
            }
        });
        self.left = product(self.most, PART);
        if self.most == 0 {
            // Without motors there are no ticks to pace.
            self.others = 0;
        }
        if self.has_advance() {
            self.begin_lead(line);
        }
    }

    /// Whether there is a lead of the extruder, or may be one. Cost: 5.
    #[inline(always)]
    fn has_advance(&self) -> bool {
        self.extruder.first().is_some_and(|extruder| extruder.on)
    }

    /// Whether the extruder has a lead in the block, or takes one back: then exec says how fast the machine is ([`Prep::aim`]).
    #[inline(always)]
    pub fn leads(&self) -> bool {
        self.extruder.first().is_some_and(|extruder| extruder.leads)
    }

    /// From the next block on this is the extruder's lead.
    #[small]
    pub fn set_lead(&mut self, lead: &Lead) {
        if let Some(extruder) = self.extruder.first_mut() {
            extruder.set(lead);
        }
    }

    /// The machine is that fast, mm/s, at the end of a slice: see [`Advance::aim`].
    #[inline(never)]
    pub fn aim(&mut self, velocity: f32, seconds: f32, pending: f32) {
        if let Some(extruder) = self.extruder.first_mut() {
            extruder.aim(velocity, seconds, pending);
        }
    }

    /// A block begins. If it pushes filament while others travel, the extruder has a lead in it. Its increments are its own then: it is no motor
    /// that goes as far as others.
    #[inline(never)]
    #[small]
    fn begin_lead(&mut self, line: &Line) {
        let Some(extruder) = self.extruder.first_mut() else { return };
        let m = usize::from(extruder.motor);
        let bit = 1 << extruder.motor;
        let own = line.way.get(m).copied().unwrap_or(0);
        let travels = line.way.iter().enumerate().any(|(other, way)| other != m && *way != 0);
        let way = if travels { pushed(own, line) } else { 0 };
        let leads = extruder.begin(way, line.extent.length()) && self.most != 0;
        if !leads {
            extruder.end();
            return self.end_lead();
        }
        extruder.take_up(self.backwards & bit != 0);
        if self.full & bit != 0 && self.full != bit {
            self.full &= !bit;
            self.minor |= bit;
        } else if (self.full | self.minor) & bit == 0 {
            self.minor |= bit;
            self.others += 1;
            if let Some(minor) = self.minors.get_mut(m) {
                *minor = Minor::default();
            }
        } else if self.others == 0 {
            // Alone: ticks are those of motors whose increments are not a step.
            self.others = 1;
        }
    }

    /// The extruder's lead is added to a segment that is complete but for its mode.
    #[inline(never)]
    fn lead(&mut self, out: &mut Segment) {
        let Some(extruder) = self.extruder.first_mut() else { return };
        let more = extruder.travel(out.ticks, out.period);
        let bit = 1 << extruder.motor;
        let Some(increment) = out.increment.get_mut(usize::from(extruder.motor)) else { return };
        let size = i32::from(*increment);
        let own = if out.backwards & bit != 0 { -size } else { size };
        let most = extruder.most(out.period).max(size);
        let mut goes = (own + more).clamp(-most, most);
        if goes != 0 && (goes < 0) != extruder.backwards {
            extruder.backwards = goes < 0;
            if out.period.saturating_sub(TURNED) < self.setup {
                // The direction stands from here on, and the motor goes in the next segment.
                goes = 0;
            }
        }
        *increment = goes.unsigned_abs() as u16;
        out.backwards = out.backwards & !bit | if extruder.backwards { bit } else { 0 };
        extruder.note(goes - own, more, (out.ticks, out.period));
        if extruder.is_done() {
            self.end_lead();
        }
    }

    /// The extruder is where its line is, but for little, and the block has no lead.
    #[inline(never)]
    #[small]
    fn end_lead(&mut self) {
        let Some(extruder) = self.extruder.first_mut() else { return };
        let bit = 1 << extruder.motor;
        if core::mem::take(&mut extruder.leads) {
            // The next segment turns it round.
            self.turned |= extruder.backwards != (self.backwards & bit != 0);
        }
        if self.full == bit && self.minor == 0 {
            self.others = 0;
        } else if self.minor & bit != 0
            && self.minors.get(usize::from(extruder.motor)).is_some_and(Minor::stands)
        {
            self.minor &= !bit;
            self.others = self.others.saturating_sub(1);
        }
    }

    /// The machine rests at the end of its lines, or in a hold: a segment in which the extruder takes back what is left of its lead. False, and no
    /// segment, if there is none.
    #[inline(always)]
    pub fn relax(&mut self, out: &mut Segment) -> bool {
        self.has_advance() && self.takes_back(out)
    }

    #[inline(never)]
    #[small]
    fn takes_back(&mut self, out: &mut Segment) -> bool {
        let Some(extruder) = self.extruder.first_mut() else { return false };
        if extruder.made() == 0 {
            return false;
        }
        let bit = 1 << extruder.motor;
        extruder.take_up(self.backwards & bit != 0);
        let (ticks, period) = if extruder.rest() { ASIDE_LITTLE } else { ASIDE };
        self.pause(ticks, period, out);
        out.moving = bit;
        self.lead(out);
        out.mode = Segment::mode_of(bit);
        true
    }

    /// Starts a block whose ways are in whole steps. Else as [`Prep::begin`].
    #[inline(never)]
    #[small]
    fn begin_far(
        &mut self,
        ways: &[i16; MOTORS],
        steps: &mut [i16; MOTORS],
        target: &mut [i32; MOTORS],
    ) {
        *steps = *ways;
        let mut bit = 1;
        for (m, way) in ways.iter().enumerate() {
            if *way != 0 {
                target[m] = target[m].wrapping_add((*way).into());
                self.take_up(m, bit, *way, *way);
            }
            bit <<= 1;
        }
        self.left = product(self.most, STEP);
        self.lengthen();
        for (debt, way) in self.debt.iter_mut().zip(ways) {
            *debt = debt.wrapping_add(way << STEP_LOG2);
        }
    }

    /// A motor goes this way in the block, of which it has `own` but for its debt.
    #[inline(always)]
    fn take_up(&mut self, m: usize, bit: u8, way: i16, own: i16) {
        self.others = self.others.wrapping_add(1);
        let (size, turned) = if way < 0 {
            ((way as u16).wrapping_neg(), !self.backwards & bit)
        } else {
            (way as u16, self.backwards & bit)
        };
        if turned != 0 {
            self.backwards ^= bit;
            self.turned = true;
        }
        self.minors[m].way = size;
        if size == self.most {
            self.full |= bit;
        } else if size > self.most {
            self.minor |= self.full;
            self.full = bit;
            self.most = size;
            self.own = own;
            let at = self.fraction[m];
            self.past = if way < 0 { !at } else { at };
        } else {
            self.minor |= bit;
        }
    }

    /// In a block of whole steps the dominant motor makes up what it is short of, and with it those that go as far.
    #[inline(never)]
    #[small]
    fn lengthen(&mut self) {
        let mut due = None;
        let mut bit = 1;
        for m in 0..MOTORS {
            if self.full & bit != 0 {
                let debt = if self.backwards & bit != 0 { -self.debt[m] } else { self.debt[m] };
                let due = *due.get_or_insert(parts_of(debt));
                if (debt - due).unsigned_abs() > PART {
                    // It goes as far, but not as what it was short of.
                    self.full &= !bit;
                    self.minor |= bit;
                }
            } else if self.minor & bit == 0 && !is_little(self.debt[m]) {
                // It has no part in the line, but not arrived where that begins.
                self.minor |= bit;
                self.minors[m].way = 0;
                self.others += 1;
                if (self.debt[m] < 0) != (self.backwards & bit != 0) {
                    self.backwards ^= bit;
                    self.turned = true;
                }
            }
            bit <<= 1;
        }
        let due = due.unwrap_or(0);
        self.left = self.left.wrapping_add_signed(due.into());
        // What makes the dominant motor's way longer makes theirs so in proportion, and they have their own debts.
        let mut bit = 1;
        for m in 0..MOTORS {
            let debt = if self.backwards & bit != 0 { -self.debt[m] } else { self.debt[m] };
            let way = self.minors[m].way;
            self.minors[m].owed = times(debt, self.most) - times(due, way);
            bit <<= 1;
        }
    }

    /// Whether these motors have no part in the block.
    #[small]
    pub fn rest_of(&self, motors: u8) -> bool {
        (self.full | self.minor) & motors == 0
    }

    /// The debt of the first of these motors, phase units.
    #[small]
    pub fn debt_of(&self, motors: u8) -> i16 {
        let first = motors.trailing_zeros() as usize;
        self.debt.get(first).copied().unwrap_or_default()
    }

    /// These motors, which the block lets stand, are about to move this way, beside it. Segments have ticks for them from here on.
    #[inline(never)]
    #[small]
    pub fn join(&mut self, motors: u8, backwards: bool) {
        let turned = if backwards { !self.backwards & motors } else { self.backwards & motors };
        if turned != 0 {
            self.backwards ^= turned;
            self.turned = true;
        }
        let mut bit = 1;
        for minor in &mut self.minors {
            if motors & bit != 0 {
                *minor = Minor::default();
                if self.minor & bit == 0 {
                    self.minor |= bit;
                    self.others = self.others.wrapping_add(1);
                }
            }
            bit <<= 1;
        }
    }

    /// A segment in which these motors may move, and no others: 2 ms.
    #[small]
    pub fn stand(&mut self, motors: u8, out: &mut Segment) {
        self.pause(ASIDE.0, ASIDE.1, out);
        out.moving = motors;
        out.seal(0, 0);
        if self.turned {
            self.behind_turn(out);
        }
    }

    /// Motors beside the block move in its segment, which has room for that.
    #[inline(never)]
    #[small]
    pub fn add(&mut self, retreat: &mut Retreat, out: &mut Segment, target: &mut [i32; MOTORS]) {
        // Of two segments the second one is in `held`.
        if self.held.is_none() && !retreat.is_done() {
            retreat.add(out, target, &mut self.debt);
            out.settle = 0;
        }
    }

    /// How far motors that have [joined](Prep::join) are to go in each tick of a segment that is queued already; 0 if there is no time for them.
    #[inline(never)]
    #[small]
    pub fn plan_lead(&self, retreat: &mut Retreat, ticks: u16, period: u16) -> u16 {
        let stands = !self.turned || period >= self.setup.saturating_add(TURNED);
        if stands && period >= self.paces().settles { retreat.plan(ticks, period) } else { 0 }
    }

    /// Counts what motors have been told to go for the lead of a retreat.
    #[small]
    pub fn note_lead(
        &mut self,
        retreat: &mut Retreat,
        increment: u16,
        ticks: u16,
        target: &mut [i32; MOTORS],
    ) {
        self.turned = false;
        retreat.note(increment, ticks, target, &mut self.debt);
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
        if self.minor == 0 && !self.leads() {
            return LOCKSTEP_TICKS;
        }
        let cycles = if cycles > PERIOD_MAX { u16::MAX } else { cycles as u16 };
        // Of 22 bits, 16 are dropped for nothing.
        let limit = (product(cycles, pace) >> 16) as u16 >> 6;
        limit.clamp(1, LIMIT_MAX)
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

    /// The block ends here and now: what of its steps no segment has is taken off `target`. Every motor is at
    /// its last step from now on ([`Dda::settle`](crate::dda::Dda::settle)). Returns the segment that
    /// was to come next, if it has been prepared.
    /// Cost: 4,000 a motor.
    #[inline(never)]
    #[small]
    pub fn cut(&mut self, target: &mut [i32; MOTORS]) -> Option<Segment> {
        let mut bit = 1;
        for (m, target) in target.iter_mut().enumerate() {
            // Where the whole step is that its end is rounded to, from where it is.
            let beyond = (i32::from(self.fraction[m]) - i32::from(HALF)) * i32::from(PART);
            let left = self.left_of(m, bit);
            let left = if self.backwards & bit != 0 { -left } else { left };
            // The debt has that as well, modulo 2^16.
            let ahead = match self.extruder.first() {
                Some(extruder) if usize::from(extruder.motor) == m => extruder.made(),
                _ => 0,
            };
            let short = left + i32::from(self.debt[m].wrapping_sub(left as i16)) - beyond - ahead;
            *target = target.wrapping_add((i32::from(PHASE_START) - short) >> STEP_LOG2);
            bit <<= 1;
        }
        self.left = 0;
        self.time = 0;
        self.debt = [0; MOTORS];
        self.fraction = [HALF; MOTORS];
        if let Some(extruder) = self.extruder.first_mut() {
            extruder.cut();
        }
        // The segment that was to tell of it may be among those that are lost.
        self.turned = true;
        self.held.take()
    }

    /// Phase units that no segment has of a motor's way, in its direction, but for its debt.
    #[inline(never)]
    #[small]
    fn left_of(&self, m: usize, bit: u8) -> i32 {
        let minor = &self.minors[m];
        if self.left == 0 || (self.full | self.minor) & bit == 0 {
            return 0;
        }
        if self.full & bit != 0 {
            return self.left as i32;
        }
        if self.shift == u8::MAX {
            // Nothing of the block has been prepared.
            return product(minor.way, if self.parts { PART } else { STEP }) as i32;
        }
        let wide = i64::from(minor.way) * i64::from(self.left) + i64::from(minor.owed);
        (wide / i64::from(self.most)) as i32
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

impl Minor {
    /// Whether it has no way, and owes nothing.
    fn stands(&self) -> bool {
        self.way == 0 && self.owed == 0
    }

    /// The increment for the next `ticks`, and what it owes then.
    fn advance(&mut self, ticks: u16, most: u16) -> u16 {
        let unit = product(ticks, most);
        let half = (unit / 2) as i32;
        let mut owed = self.owed + product(ticks, self.remainder) as i32;
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

/// `way * step / most`, rounded down, and the remainder.
#[inline(never)]
fn share(way: u16, step: u16, most: u16) -> (u16, u16) {
    quotient_remainder(product(way, step), most)
}

/// `way * step / most`, rounded to the nearest.
#[inline(never)]
fn even(way: u16, step: u16, most: u16) -> u16 {
    quotient(product(way, step) + u32::from(most / 2), most)
}

/// `owed / unit`, rounded. Rare: a debt that meets a short segment.
#[inline(never)]
fn rounded(owed: u32, unit: u32) -> u16 {
    ((owed + unit / 2) / unit) as u16
}

/// Whether a debt is less than a part of a step, by rounding.
#[inline(always)]
fn is_little(debt: i16) -> bool {
    (debt as u16).wrapping_add(PART / 2) < PART
}

/// A debt rounded to parts of a step, in phase units.
#[inline(always)]
fn parts_of(debt: i16) -> i16 {
    (debt + (PART / 2) as i16) & !(PART as i16 - 1)
}

#[inline(never)]
#[small]
fn times(a: i16, b: u16) -> i32 {
    let size = product(a.unsigned_abs(), b) as i32;
    if a < 0 { -size } else { size }
}

fn product_wide(unit: u32, times: u16) -> i32 {
    match times {
        0 => 0,
        1 => unit as i32,
        _ => (unit * u32::from(times)) as i32,
    }
}

/// `1 << n`, up to [`STEP`]. Cost: 15; the compiler makes a loop of six cycles a bit.
#[inline(always)]
fn bit(n: u8) -> u16 {
    let pair = if n & 2 != 0 { 4 } else { 1 };
    let nibble: u8 = if n & 1 != 0 { pair << 1 } else { pair };
    let byte = if n & 4 != 0 { nibble << 4 } else { nibble };
    if n & 8 != 0 { u16::from(byte) << 8 } else { byte.into() }
}

/// Parts of a tick for its period: 1/32, if the tick has as many phase units.
const FINE: u8 = 5;

/// Most ticks of a limit, in such parts.
const fn limit_in_parts(limit: u16) -> u16 {
    limit << FINE | ((1 << FINE) - 1)
}

const _: () = assert!(limit_in_parts(LIMIT_MAX) >> FINE == LIMIT_MAX);

/// A travel in parts of ticks, of which there are no more than `limit` if steps allow, and the exponent of a tick. Cost: 100.
#[inline(never)]
fn coarsen(travel: u32, limit: u16) -> (u32, u8) {
    let limit = limit_in_parts(limit);
    if travel <= u32::from(limit) {
        return coarsen_little(travel, limit);
    }
    let (mut fine, mut shift) = (travel, FINE);
    if fine >> 8 > u32::from(limit) {
        (fine, shift) = (fine >> 8, FINE + 8);
    }
    while fine > 0xFFFF && shift < STEP_LOG2 {
        fine >>= 1;
        shift += 1;
    }
    if fine > 0xFFFF {
        return (fine, shift);
    }
    let mut few = fine as u16;
    while few > limit && shift < STEP_LOG2 {
        few >>= 1;
        shift += 1;
    }
    (few.into(), shift)
}

/// A travel for which ticks of less than [`FINE`] bits do: it is its own parts.
#[inline(never)]
#[small]
fn coarsen_little(travel: u32, limit: u16) -> (u32, u8) {
    let (limit, mut ticks, mut shift) = (limit >> FINE, travel as u16, 0);
    while ticks > limit && shift < FINE {
        ticks >>= 1;
        shift += 1;
    }
    (travel, shift)
}

/// A travel in parts of ticks of so many bits.
#[inline(never)]
#[small]
fn finer(travel: u32, shift: u8) -> u32 {
    travel >> shift.saturating_sub(FINE)
}

/// Whole ticks of so many parts. Cost: 25.
#[inline(always)]
fn whole_ticks(fine: u32, shift: u8) -> u32 {
    if shift < FINE { fine >> shift } else { fine >> FINE }
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
