//! What it takes to slow down under a jerk limit, and which constraint ahead is the first to ask for it.
//!
//! Called by the [`Governor`] at exec level, once for a stretch (`rise`).
//!
//! # Units
//!
//! Velocities are mm/s. Distances are brake potential, (mm/s)^2: 2 A for each mm (`speed_constraints`). With
//! k = A^2 / 2J the distance that a change of velocity takes depends on neither A nor J.
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
//! A scan answers one question: how far on may the machine still be at the steady velocity u, and which constraint does it
//! have to slow down for then? The answer, [`Clear`], holds for every lower velocity as well: less distance is needed
//! from there ([`Clear::narrow`]). It stays true when blocks are added, which never make the distance to a standstill shorter.
//!
//! # Work
//!
//! A scan looks at no more than [`EXACT`] constraints exactly, each slower than all before it: whoever is down to one of them may
//! keep that velocity past all that are no slower. One more answers for all that follow, by its key: keys rise, and `(u + k)^2 <= key`
//! is enough for any of them. So the work has a bound, whatever is queued. It is done in integers (`need`): 2,000 cycles on AVR for each
//! of these, 25 for each constraint that is passed over, and 1,500 for the rest.

use super::float::{below, greater, least, scaled};
use super::governor::{Governor, Limits};
use super::need::Scale;
use super::queue::Constraint;
use super::short::Short;
use crate::hal::ring::Index;
use crate::math::sqrt;

/// What is ahead of the block that runs.
pub trait Ahead {
    /// The square of the velocity at the block's end without a jerk limit.
    fn headroom(&self) -> f32;
    /// The first constraint from the `n`th on that is slower than `velocity`, or firm: nothing beyond that counts. With its
    /// number.
    fn slower(&self, n: Index, velocity: Short) -> (Index, Constraint);
    /// Brake potential from the end of the block to that of the queue.
    fn end(&self) -> f32;
}

/// Constraints that a scan looks at exactly.
pub const EXACT: u8 = 2;

/// Constraints behind the machine that a scan passes over.
const PASSED: u8 = 4;

/// How far on a velocity may be kept.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Clear {
    /// The velocity `top`, or any below it,
    pub top: f32,
    /// may be steady until so much further on.
    pub distance: f32,
    /// Then it has to slow down to this velocity,
    pub target: f32,
    /// which is kept from here on, as seen from where `distance` was `from`.
    place: f32,
    from: f32,
    /// From the target on nothing else is too near.
    pub closed: bool,
    /// The velocity is bounded by the target.
    binds: bool,
    /// Slices since: what has been driven is subtracted in floats, so it gets less exact.
    pub age: u8,
}

/// Slices after which what is known is too old.
const AGE_MOST: u8 = 64;

impl Clear {
    /// Before the first block, whose limits have it [forgotten](Self::forget). All zeros: anything else would be copied, from RAM.
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

    /// Forgets what is known. Field by field: a constant would be copied, from RAM.
    #[inline(never)]
    pub fn forget(&mut self) {
        let Self { top, distance, target, place, from, closed, binds, age } = self;
        *top = -1.0;
        (*distance, *target, *place, *from) = (0.0, 0.0, 0.0, 0.0);
        (*closed, *binds, *age) = (false, false, 0);
    }

    /// How far on the target is kept from.
    pub fn place(&self) -> f32 {
        self.place - (self.from - self.distance)
    }

    /// What is known of a faster velocity holds for `top` too, which may be kept to the target's place if it is no faster.
    pub fn narrow(&mut self, top: f32) {
        if self.closed && !below(self.target, top) {
            self.distance = self.place();
            (self.top, self.target, self.from) = (top, top, self.place);
        }
    }

    /// How long the top is kept before a ramp begins down to the target, if the top is reached `at`.
    pub fn slack(&self, at: f32, kappa: f32) -> f32 {
        // A scan is a little off, and a ramp to a standstill has to end at its place.
        let exact = self.binds && self.closed;
        let distance =
            if exact { self.place() - needed(self.top, self.target, kappa) } else { self.distance };
        distance - at
    }
}

/// A velocity to try.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ask {
    /// The velocity, and where it would be reached.
    pub top: f32,
    pub at: f32,
    /// The fastest that it is until then.
    pub fastest: f32,
    /// Constraints from this velocity on down must be behind where the top is reached.
    pub level: f32,
    /// Distance from the state to the end of the block.
    pub here: f32,
    /// The velocity is taken in any case, and the question is how long it may be kept.
    pub taken: bool,
}

/// The distance it takes to come from `u` down to `w`, not above it. Cost: 700, 1,000 if the deceleration does not reach A.
#[inline(never)]
pub(super) fn needed(u: f32, w: f32, kappa: f32) -> f32 {
    let (drop, sum) = (u - w, u + w);
    let twice = scaled(kappa, 1);
    sum * if below(drop, twice) { sqrt(scaled(kappa * drop, 3)) } else { drop + twice }
}

/// What a scan has found so far, in the units of its scale.
struct Scan {
    scale: Scale,
    /// The top, and where it is reached.
    top: u16,
    at: i32,
    distance: i32,
    place: i32,
    /// The target, and as a velocity of the scale.
    target: Short,
    low: u16,
    /// What it takes at most to slow down from the top.
    most: i32,
    /// From here on nothing makes a difference.
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
            // A firm one may be faster than those before it.
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

    /// A constraint to `velocity`, slower than those before it, at `place`. A top that is `taken` is reached whatever is ahead.
    #[inline(never)]
    fn take_in(&mut self, velocity: Short, place: i32, taken: bool) {
        let scale = &self.scale;
        let (mut target, mut low) = (velocity, scale.velocity(velocity).min(self.top));
        let mut distance = place - scale.need(self.top, low);
        if taken && distance < self.at && low > 0 {
            // To a standstill is a shorter way than to a low velocity.
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

    /// No less than it takes to slow down from `low`: what half the velocity takes is less than half as much. Cost: 50, where the exact
    /// answer takes 450.
    fn most_from(&self, low: u16) -> i32 {
        let (mut top, mut most) = (self.top, self.most);
        while low <= top / 2 && most > 8 {
            (top, most) = (top / 2, most / 2 + 1);
        }
        most
    }

    /// A constraint that stands for all that follow: what its key says of them, and that of the end of the queue.
    #[inline(never)]
    fn look_no_further(&mut self, velocity: Short, place: i32, end: f32) {
        let scale = &self.scale;
        let by_key =
            place.saturating_sub(scale.by_key(self.top, scale.velocity(velocity).min(self.top)));
        let end = scale.distance(end).saturating_sub(scale.by_key(self.top, 0));
        // Whatever it is, it is not nearer.
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
    /// Whether a velocity is safe. Fills in how long it may be kept, if it is or if it is taken in any case.
    #[inline(never)]
    pub(super) fn scan(&mut self, ask: &Ask, ahead: &impl Ahead) -> bool {
        self.scanned = true;
        let mut scan = Scan::new(ask, &self.limits);
        // But for rounding: 0.1 um.
        let safe = scan.run(ask, ahead, self.limits.accel * 2e-4);
        if safe || ask.taken {
            self.clear = scan.clear(ask.top);
        }
        safe
    }

    /// Whether it is known that the steady velocity `top` is safe at a place `at` so far on. Cost: 50.
    #[inline(always)]
    pub(super) fn is_clear(&self, top: f32, at: f32) -> bool {
        let clear = &self.clear;
        clear.age < AGE_MOST && !below(clear.top, top) && !below(clear.distance, at)
    }

    /// The distance in brake potential.
    #[inline(always)]
    pub(super) fn potential(&self, distance: f32) -> f32 {
        distance * scaled(self.limits.accel, 1)
    }
}
