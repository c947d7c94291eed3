//! What it takes to slow down under a jerk limit: which states are safe.
//!
//! Called by the [`Governor`](super::governor::Governor) for each state it may go into, and for the one
//! it brakes from.
//!
//! # Units
//!
//! Velocities are mm/s. The acceleration is alpha times its limit A, alpha from -1 to 1, and changes by at
//! most J in a second. Ways are in brake potential, (mm/s)^2: 2 A for each mm (`horizon`). With k = A^2 / 2J
//! neither A nor J is needed.
//!
//! # The way down
//!
//! From a top velocity u with alpha = 0 down to w with alpha = 0 again takes
//!
//! ```text
//! (u + w) (u - w + 2 k)           if alpha gets to -1: u - w >= 2 k
//! (u + w) sqrt(8 k (u - w))       else
//! ```
//!
//! A state with alpha above 0 is on its way to the top `v + k alpha^2`, one with alpha below 0 has come from
//! there. The way between, `4 k alpha (v + 2/3 k alpha^2)`, is added or taken off.
//!
//! # Safe
//!
//! A state is safe if for each limit ahead, nearest first, the top is not above it, or there is way enough
//! to come down to it; up to the first before which it can stop. That keeps: while it brakes as hard as
//! it may, the top and the way from there stay as they are until alpha is -1, and after that the way needed
//! falls faster than the way left. So whoever goes from safe states to safe states only, and brakes when
//! there is none, passes all limits; how long the stretches between are does not matter.
//!
//! Cost on AVR: 800 cycles a state, and for each limit below its top 1,500 to 2,500.

use super::float::lesser;
use super::queue::Anchor;
use crate::math::sqrt;

/// What is ahead of the block that runs.
pub trait Ahead {
    /// The square of the velocity at the block's end without a jerk limit.
    fn headroom(&self) -> f32;
    /// The `n`th limit ahead, nearest first.
    fn anchor(&self, n: u8) -> Option<Anchor>;
}

/// A state, seen from its top.
#[derive(Clone, Copy, Debug)]
pub struct Reach {
    /// The highest velocity it comes to, or is on.
    level: f32,
    /// The velocity at which alpha was or will be 0.
    top: f32,
    /// Way to the top, less than 0 if it is past.
    spent: f32,
    kappa: f32,
}

/// What floats may be off.
const ROUNDING: f32 = 1.00002;

/// How to slow down.
#[derive(Clone, Copy, Debug)]
pub struct Demand {
    /// Velocity to come to, mm/s.
    pub velocity: f32,
    /// Way to there, brake potential from where the state is.
    pub way: f32,
    /// The share of the acceleration limit that just does it, if braking begins at the top.
    pub share: f32,
    /// There is way enough.
    pub fits: bool,
    /// Nothing else has to be thought of on the way.
    pub alone: bool,
}

/// Not a velocity.
pub const NONE: f32 = -1.0;

impl Reach {
    /// Of velocity `v` and acceleration `alpha`.
    pub fn new(v: f32, alpha: f32, kappa: f32) -> Self {
        let rise = kappa * alpha * alpha;
        let top = v + rise;
        let spent = 4.0 * kappa * alpha * (v + rise * (2.0 / 3.0));
        Reach { level: if alpha > 0.0 { top } else { v }, top, spent, kappa }
    }

    /// Whether `way` is enough to come down to `w`, which is below the level.
    fn fits(&self, way: f32, w: f32) -> bool {
        let way = (way - self.spent) * ROUNDING;
        let (drop, sum) = (self.top - w, self.top + w);
        let twice = self.kappa + self.kappa;
        if drop >= twice {
            way >= sum * (drop + twice)
        } else {
            way >= 0.0 && way * way >= 4.0 * twice * drop * sum * sum
        }
    }

    /// Whether it is safe with `within` to go to the end of the block. Limits of `but` do not count.
    pub fn safe(&self, within: f32, ahead: &impl Ahead, but: f32) -> bool {
        let mut n = 0;
        while let Some(anchor) = ahead.anchor(n) {
            let w = anchor.velocity;
            if self.level > w * ROUNDING && w != but {
                let way = anchor.ahead + within;
                if !self.fits(way, w) {
                    return false;
                }
                if w == 0.0 || self.fits(way, 0.0) {
                    return true;
                }
            }
            if anchor.firm {
                return true;
            }
            n += 1;
        }
        true
    }

    /// The limit ahead that has to be braked for hardest.
    #[inline(never)]
    pub fn demand(&self, within: f32, ahead: &impl Ahead) -> Option<Demand> {
        let mut hardest: Option<Demand> = None;
        let mut alone = true;
        let mut n = 0;
        while let Some(anchor) = ahead.anchor(n) {
            if self.level > anchor.velocity {
                let way = anchor.ahead + within;
                let share = self.share(way, anchor.velocity);
                alone = hardest.is_none();
                if hardest.is_none_or(|demand| share > demand.share) {
                    let velocity = anchor.velocity;
                    let fits = self.fits(way, velocity);
                    hardest = Some(Demand { velocity, way, share, fits, alone });
                }
                if self.fits(way, 0.0) {
                    break;
                }
            }
            if anchor.firm {
                break;
            }
            n += 1;
        }
        let mut demand = hardest?;
        demand.alone = alone && {
            let there = Reach::new(demand.velocity, 0.0, self.kappa);
            there.safe(within - demand.way, ahead, NONE)
        };
        Some(demand)
    }

    /// The share of the acceleration limit with which it comes down to `w` in `way`.
    fn share(&self, way: f32, w: f32) -> f32 {
        let way = way - self.spent;
        let (drop, sum) = (self.top - w, self.top + w);
        let product = sum * drop;
        if way <= 0.0 {
            return 1.0;
        }
        let share = 2.0 * product / (way + sqrt(way * way - 8.0 * self.kappa * sum * product));
        lesser(share, 1.0)
    }

    /// The velocity from which it comes, or to which it goes, with alpha 0.
    pub fn top(&self) -> f32 {
        self.top
    }
}
