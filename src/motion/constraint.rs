//! What it takes to slow down under a jerk limit, and which constraint ahead is the first to ask for it.
//!
//! Called by the [`Governor`](super::governor::Governor) at exec level, at most once for a stretch.
//!
//! # Units
//!
//! Velocities are mm/s. Distances are brake potential, (mm/s)^2: 2 A for each mm (`horizon`). With
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
//! from there. It stays true when blocks are added, which never make the distance to a standstill shorter.
//!
//! # Work
//!
//! A scan looks at no more than [`EXACT`] constraints exactly, each slower than all before it: whoever is down to one of them may
//! keep that velocity past all that are no slower. One more answers for all that follow, by its key: keys rise, and `(u + k)^2 <= key`
//! is enough for any of them. So the work has a bound, whatever is queued: 2,500 cycles on AVR for each of these, and
//! 25 for each constraint that is passed over.

use super::float::{below, greater, least, less, lesser, scaled, some};
use super::governor::Governor;
use super::horizon;
use super::queue::Anchor;
use crate::math::sqrt;

/// What is ahead of the block that runs.
pub trait Ahead {
    /// The square of the velocity at the block's end without a jerk limit.
    fn headroom(&self) -> f32;
    /// The first constraint from the `n`th on that is slower than `velocity`, or firm: nothing beyond that counts. With its
    /// number.
    fn slower(&self, n: u8, velocity: f32) -> (u8, Anchor);
    /// Brake potential from the end of the block to that of the queue.
    fn end(&self) -> f32;
}

/// Constraints that a scan looks at exactly.
pub const EXACT: u8 = 3;

/// Constraints behind the machine that a scan passes over.
const PASSED: u8 = 4;

/// What floats may be off.
const ROUNDING: f32 = 1.00002;

/// How far on a velocity may be kept.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Clear {
    /// This velocity, or any below it,
    pub top: f32,
    /// may be steady until so much further on.
    pub distance: f32,
    /// Then it has to slow down to this velocity,
    pub target: f32,
    /// which is kept from here on.
    pub place: f32,
    /// `(top + k)^2` and `(target + k)^2`: more than it takes to come down from there to any velocity.
    high: f32,
    low: f32,
    /// From the target on nothing else is too near.
    pub closed: bool,
    /// Slices since: what has been driven is subtracted in floats, so it gets less exact.
    pub age: u8,
}

/// Slices after which what is known is too old.
const AGE_MOST: u8 = 64;

impl Clear {
    /// Nothing is known.
    pub const NONE: Self = Self {
        top: -1.0,
        distance: 0.0,
        target: 0.0,
        place: 0.0,
        high: 0.0,
        low: 0.0,
        closed: true,
        age: 0,
    };
}

/// Velocities to try, fastest first, and where each of them would be reached.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ask {
    pub tops: [f32; 3],
    pub at: [f32; 3],
    /// The first that is to be tried, and whether the middle one is.
    pub first: u8,
    pub middle: bool,
    /// Constraints from this velocity on down must be behind where the top is reached.
    pub level: f32,
    /// Distance from the state to the end of the block.
    pub here: f32,
}

/// The number of the velocity that is taken in any case.
pub(super) const LOWEST: u8 = 2;

impl Ask {
    /// About one velocity, reached at `at`.
    pub fn about(velocity: f32, at: f32, here: f32) -> Self {
        Self { tops: [velocity; 3], at: [at; 3], first: LOWEST, middle: false, level: 0.0, here }
    }
}

/// The distance it takes to come from `u` down to `w`, not above it. Cost: 700, 1,000 if the deceleration does not reach A.
#[inline(never)]
pub(super) fn needed(u: f32, w: f32, kappa: f32) -> f32 {
    let (drop, sum) = (u - w, u + w);
    let twice = scaled(kappa, 1);
    sum * if below(drop, twice) { sqrt(scaled(kappa * drop, 3)) } else { drop + twice }
}

fn square(x: f32) -> f32 {
    x * x
}

impl Governor {
    /// Finds the fastest of the velocities that is safe, and how long it is; the last of them is taken whatever is ahead.
    /// Returns its number.
    #[inline(never)]
    pub(super) fn scan(&mut self, ask: &Ask, ahead: &impl Ahead) -> u8 {
        self.scanned = true;
        let mut budget = EXACT;
        let mut n = ask.first;
        while !self.try_top(ask, n, &mut budget, ahead) && n < LOWEST {
            n = if ask.middle { n + 1 } else { LOWEST };
        }
        n
    }

    /// Whether the `n`th velocity is safe. Fills in `clear` as far as it gets.
    #[inline(never)]
    fn try_top(&mut self, ask: &Ask, n: u8, budget: &mut u8, ahead: &impl Ahead) -> bool {
        let n = usize::from(n);
        let (Some(&top), Some(&at)) = (ask.tops.get(n), ask.at.get(n)) else { return true };
        let high = square(top + self.limits.kappa);
        let none = f32::MAX;
        self.clear = Clear {
            top,
            distance: none,
            target: top,
            place: none,
            high,
            low: high,
            closed: true,
            age: 0,
        };
        let (mut next, mut passed) = (0, 0);
        let mut low = greater(top, ask.level);
        loop {
            let (found, anchor) = ahead.slower(next, low);
            let place = anchor.ahead + ask.here;
            next = found + 1;
            if !anchor.firm && self.is_here(place) && passed < PASSED {
                passed += 1;
                continue;
            }
            if *budget == 0 {
                self.look_no_further(&anchor, place, ahead.end() + ask.here);
                return !less(self.clear.distance, at);
            }
            *budget -= 1;
            let lowest = n >= usize::from(LOWEST);
            // A firm one may be faster than those before it.
            low = least(anchor.velocity, low);
            self.take_in(low, place, if lowest { at } else { f32::MIN });
            if !lowest && less(self.clear.distance, at) {
                return false;
            }
            if anchor.firm || self.is_out_of_reach(place) {
                return true;
            }
        }
    }

    /// A constraint to `velocity`, slower than those before it, at `place`, for a top that is reached `at` whatever is ahead.
    #[inline(never)]
    fn take_in(&mut self, velocity: f32, place: f32, at: f32) {
        let kappa = self.limits.kappa;
        let clear = &mut self.clear;
        let mut low = least(velocity, clear.top);
        let mut distance = place - needed(clear.top, low, kappa);
        if less(distance, at) && some(low) {
            // To a standstill is a shorter way than to a low velocity.
            let stop = place - needed(clear.top, 0.0, kappa);
            if less(distance, stop) {
                (low, distance) = (0.0, stop);
            }
        }
        let nearer = less(distance, clear.distance);
        if nearer {
            clear.distance = distance;
        }
        if nearer || self.is_close(low, place) {
            (self.clear.target, self.clear.place) = (low, place);
            self.clear.low = square(low + kappa);
        }
    }

    /// Whether a constraint is too near to be slowed down for from the target.
    fn is_close(&self, low: f32, place: f32) -> bool {
        let Clear { target, place: from, low: enough, .. } = self.clear;
        let distance = place - from;
        less(distance, enough)
            && below(low, target)
            && less(distance * ROUNDING, needed(target, low, self.limits.kappa))
    }

    /// Nothing beyond `place` makes a difference: even the lowest key there would not.
    #[inline(never)]
    fn is_out_of_reach(&self, place: f32) -> bool {
        let clear = &self.clear;
        !less(place - clear.high, clear.distance) && !less(place - clear.place, clear.low)
    }

    /// A constraint that stands for all that follow: what its key says of them, and that of the end of the queue.
    #[inline(never)]
    fn look_no_further(&mut self, anchor: &Anchor, place: f32, end: f32) {
        let kappa = self.limits.kappa;
        let key = lesser(horizon::key(anchor.velocity, kappa) + place, kappa * kappa + end);
        let clear = &mut self.clear;
        if less(clear.place, place) && !less((key - clear.place) * ROUNDING, clear.low) {
            return;
        }
        clear.distance = lesser(clear.distance, key - clear.high);
        (clear.target, clear.closed) = (0.0, false);
    }

    /// Whether a place is behind the machine, or where it is, but for rounding: 0.1 um.
    fn is_here(&self, place: f32) -> bool {
        less(place, self.limits.accel * 2e-4)
    }

    /// Whether it is known that the steady velocity `top` is safe at a place `at` so far on.
    #[inline(always)]
    pub(super) fn is_clear(&self, top: f32, at: f32) -> bool {
        let clear = &self.clear;
        clear.age < AGE_MOST && !less(clear.top, top) && !less(clear.distance, at)
    }

    /// The distance in brake potential.
    #[inline(always)]
    pub(super) fn potential(&self, distance: f32) -> f32 {
        distance * scaled(self.limits.accel, 1)
    }
}
