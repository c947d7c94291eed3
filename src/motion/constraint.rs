//! The distance to slow down under a jerk limit, and the scan for the constraint ahead that requires it first.
//!
//! Called by the [`Governor`] at exec level, once for a stretch (`rise`).
//!
//! # Units
//!
//! Velocities are mm/s. Distances are brake potential, (mm/s)^2: 2 A for each mm (`speed_constraints`). With
//! k = A^2 / 2J the distance for a change of velocity depends on neither A nor J themselves.
//!
//! # The distance to slow down
//!
//! From a steady velocity u to a steady velocity w:
//!
//! ```text
//! (u + w) (u - w + 2 k)           if the deceleration reaches A: u - w >= 2 k
//! (u + w) sqrt(8 k (u - w))       else
//! ```
//!
//! # Clear
//!
//! A scan finds out how far on the machine may keep the steady velocity u, and for which constraint it then has to slow
//! down. The answer, [`Clear`], holds for every lower velocity as well, because slowing down from a lower velocity
//! takes less distance ([`Clear::narrow`]). It stays true when blocks are added: they never make the distance to a
//! standstill shorter.
//!
//! # Work
//!
//! A scan computes at most [`EXACT`] constraints exactly, each slower than all before it: a machine that has slowed
//! down to one of them may pass all that are no slower. One more constraint stands for all that follow, by its key:
//! keys rise along the queue, and `(u + k)^2 <= key` is sufficient for any of them. So the work has a bound, whatever
//! is queued. It is done in integers (`need`). Cost on AVR: 2,000 cycles for each of these constraints, 25 for each
//! constraint that is passed over, and 1,500 for the rest.

use super::float::{below, greater, least, scaled};
use super::governor::{Governor, Limits};
use super::need::Scale;
use super::queue::Constraint;
use super::short::Short;
use crate::hal::ring::Index;
use crate::math::sqrt;

/// What is ahead of the block that runs.
pub trait Ahead {
    /// The square of the velocity that is allowed at the end of the block without a jerk limit.
    fn headroom(&self) -> f32;
    /// Returns the first constraint from the `n`th on that is slower than `velocity`, or firm, with its number.
    /// Constraints beyond a firm one do not apply.
    fn slower(&self, n: Index, velocity: Short) -> (Index, Constraint);
    /// Returns the brake potential from the end of the block to the end of the queue.
    fn end(&self) -> f32;
}

/// How many constraints a scan computes exactly.
pub const EXACT: u8 = 2;

/// How many constraints behind the machine a scan passes over at most.
const PASSED: u8 = 4;

/// The answer of a scan: how far on a velocity may be kept.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Clear {
    /// The velocity that the answer is for; it holds for any lower one too.
    pub top: f32,
    /// How far on the velocity may be kept, brake potential.
    pub distance: f32,
    /// The velocity to which the machine has to slow down after that.
    pub target: f32,
    /// The distance to the place from which the target velocity is kept, as it was when `distance` was `from`.
    place: f32,
    from: f32,
    /// Whether the target velocity is low enough for all constraints beyond it.
    pub closed: bool,
    /// Whether the target is what bounds the velocity.
    binds: bool,
    /// Slices since the scan. The distance driven since is subtracted in floats, so that the answer gets less exact
    /// with age.
    pub age: u8,
}

/// Slices after which an answer is too old.
const AGE_MOST: u8 = 64;

impl Clear {
    /// The state before the first block, which calls [`Self::forget`] when it sets its limits. All zeros: other values
    /// would take a copy in RAM.
    pub const START: Self = Self {
        top: 0.0,
        distance: 0.0,
        target: 0.0,
        place: 0.0,
        from: 0.0,
        closed: false,
        binds: false,
        age: 0,
    };

    /// Forgets the answer. Field by field, because a constant would take a copy in RAM.
    #[inline(never)]
    pub fn forget(&mut self) {
        let Self { top, distance, target, place, from, closed, binds, age } = self;
        *top = -1.0;
        (*distance, *target, *place, *from) = (0.0, 0.0, 0.0, 0.0);
        (*closed, *binds, *age) = (false, false, 0);
    }

    /// Returns the distance to the place from which the target velocity is kept, brake potential.
    pub fn place(&self) -> f32 {
        self.place - (self.from - self.distance)
    }

    /// Narrows the answer for a higher velocity to `top`. If `top` is no faster than the target, it may be kept up to
    /// the place of the target.
    pub fn narrow(&mut self, top: f32) {
        if self.closed && !below(self.target, top) {
            self.distance = self.place();
            (self.top, self.target, self.from) = (top, top, self.place);
        }
    }

    /// Returns for what distance, brake potential, the top is kept before a ramp down to the target begins; `at` is the
    /// distance to where the top is reached.
    pub fn slack(&self, at: f32, kappa: f32) -> f32 {
        // A scan is slightly inexact, but a ramp to a standstill has to end at its place.
        let exact = self.binds && self.closed;
        let distance =
            if exact { self.place() - needed(self.top, self.target, kappa) } else { self.distance };
        distance - at
    }
}

/// The question for a scan: a velocity to try.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ask {
    /// The velocity; `at` is the distance to where it would be reached.
    pub top: f32,
    pub at: f32,
    /// The highest velocity until then.
    pub fastest: f32,
    /// No constraint at this velocity or below may lie before the place where the top is reached.
    pub level: f32,
    /// Distance from the present state to the end of the block.
    pub here: f32,
    /// Whether the velocity is reached in any case: the question is then how long it may be kept.
    pub taken: bool,
}

/// Returns the distance to slow down from `u` to `w`, which is not above `u`. Cost: 700, 1,000 if the deceleration does
/// not reach A.
#[inline(never)]
pub(super) fn needed(u: f32, w: f32, kappa: f32) -> f32 {
    let (drop, sum) = (u - w, u + w);
    let twice = scaled(kappa, 1);
    sum * if below(drop, twice) { sqrt(scaled(kappa * drop, 3)) } else { drop + twice }
}

/// The result of a scan so far, in the units of its scale.
struct Scan {
    scale: Scale,
    /// The top, and (`at`) where it is reached.
    top: u16,
    at: i32,
    distance: i32,
    place: i32,
    /// The target; `low` is the target as a velocity of the scale.
    target: Short,
    low: u16,
    /// An upper bound of the distance to slow down from the top.
    most: i32,
    /// Constraints from here on make no difference.
    reach: i32,
    closed: bool,
    binds: bool,
}

impl Scan {
    #[inline(always)]
    fn new(ask: &Ask, limits: &Limits) -> Self {
        let scale = Scale::of(ask.fastest, limits);
        let top = scale.velocity_above(ask.top);
        Self {
            at: scale.distance(ask.at),
            top,
            low: top,
            most: scale.most(top),
            scale,
            distance: i32::MAX,
            place: i32::MAX,
            target: Short::ZERO,
            reach: i32::MAX,
            closed: true,
            binds: true,
        }
    }

    /// Looks at one constraint after the other. Returns whether the top is safe.
    #[inline(never)]
    fn run(&mut self, ask: &Ask, ahead: &impl Ahead, behind: f32) -> bool {
        let (mut next, mut passed, mut budget) = (0, 0, EXACT);
        let mut low = Short::above(greater(ask.top, ask.level));
        loop {
            let (found, constraint) = ahead.slower(next, low);
            next = found + 1;
            let place = constraint.ahead + ask.here;
            if !constraint.firm && passed < PASSED && below(place, behind) {
                passed += 1;
                continue;
            }
            let place = self.scale.distance(place);
            if place >= self.reach {
                break;
            }
            // A firm constraint may be faster than those before it.
            low = constraint.velocity.min(low);
            if budget == 0 {
                self.look_no_further(low, place, ahead.end() + ask.here);
                break;
            }
            budget -= 1;
            self.take_in(low, place, ask.taken);
            if constraint.firm || !ask.taken && self.distance < self.at {
                break;
            }
        }
        self.distance >= self.at
    }

    /// Takes in a constraint to `velocity`, slower than those before it, at `place`. A top that is `taken` is reached
    /// whatever is ahead.
    #[inline(never)]
    fn take_in(&mut self, velocity: Short, place: i32, taken: bool) {
        let scale = &self.scale;
        let (mut target, mut low) = (velocity, scale.velocity(velocity).min(self.top));
        let mut distance = place - scale.need(self.top, low);
        if taken && distance < self.at && low > 0 {
            // Slowing down to a standstill may take less distance than slowing down to a low velocity.
            let stop = place - scale.need(self.top, 0);
            if distance < stop {
                (target, low, distance) = (Short::ZERO, 0, stop);
            }
        }
        let nearer = distance < self.distance;
        let close = || low < self.low && place - self.place < scale.need(self.low, low);
        if !(nearer || close()) {
            return;
        }
        if nearer {
            self.distance = distance;
        }
        (self.target, self.low, self.place, self.binds) = (target, low, place, nearer);
        let beyond = place.saturating_add(self.most_from(low));
        self.reach = beyond.max(self.distance.saturating_add(self.most));
    }

    /// Returns an upper bound of the distance to slow down from `low`: from half the velocity it takes less than half
    /// the distance. Cost: 50, where the exact answer takes 450.
    fn most_from(&self, low: u16) -> i32 {
        let (mut top, mut most) = (self.top, self.most);
        while low <= top / 2 && most > 8 {
            (top, most) = (top / 2, most / 2 + 1);
        }
        most
    }

    /// Takes in a constraint that stands for all that follow, by its key and by the key of the end of the queue.
    #[inline(never)]
    fn look_no_further(&mut self, velocity: Short, place: i32, end: f32) {
        let scale = &self.scale;
        let by_key =
            place.saturating_sub(scale.by_key(self.top, scale.velocity(velocity).min(self.top)));
        let end = scale.distance(end).saturating_sub(scale.by_key(self.top, 0));
        // Slowing down never begins nearer than this, whatever follows.
        let distance = by_key.min(end).max(place - self.most);
        (self.closed, self.target, self.binds) = (false, Short::ZERO, false);
        self.distance = self.distance.min(distance);
    }

    #[inline(always)]
    fn clear(&self, top: f32) -> Clear {
        let (distance, place) =
            (self.scale.potential(self.distance), self.scale.potential(self.place));
        let target = least(self.target.get(), top);
        let (closed, binds) = (self.closed, self.binds);
        Clear { top, distance, target, place, from: distance, closed, binds, age: 0 }
    }
}

impl Governor {
    /// Whether a velocity is safe. Stores in `clear` how long it may be kept, if it is safe or is reached in any case.
    #[inline(never)]
    pub(super) fn scan(&mut self, ask: &Ask, ahead: &impl Ahead) -> bool {
        self.scanned = true;
        let mut scan = Scan::new(ask, &self.limits);
        // Constraints up to 0.1 um ahead count as behind the machine, because of rounding.
        let safe = scan.run(ask, ahead, self.limits.accel * 2e-4);
        if safe || ask.taken {
            self.clear = scan.clear(ask.top);
        }
        safe
    }

    /// Whether the steady velocity `top` is known to be safe up to a place `at`. Cost: 50.
    #[inline(always)]
    pub(super) fn is_clear(&self, top: f32, at: f32) -> bool {
        let clear = &self.clear;
        clear.age < AGE_MOST && !below(clear.top, top) && !below(clear.distance, at)
    }

    /// Returns a distance in brake potential.
    #[inline(always)]
    pub(super) fn potential(&self, distance: f32) -> f32 {
        distance * scaled(self.limits.accel, 1)
    }
}
