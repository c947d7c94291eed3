//! The governor: how fast the machine goes in the next few milliseconds.
//!
//! Owned by exec, which asks [`Governor::stretch`] for one stretch after the other: with the way left in
//! the block, its velocity limit, and what is ahead ([`Ahead`]). It goes as fast as it may, always able
//! to slow down in time for all that is queued. Its state is velocity and acceleration, and the [`Brake`]
//! that it is on, if any: it does not care where blocks begin and end, so a ramp goes on over any number
//! of them, and a limit that changes (more blocks, a lower feed) is taken up at the next stretch from
//! where it is.
//!
//! Units: mm, s (degrees for a rotary-only move).
//!
//! # Without a jerk limit
//!
//! Velocities are those of trapezoids, `v^2 <= headroom + 2 A left`, and a stretch is the solution of
//! that with its own length in it.
//!
//! # With one
//!
//! See `smooth`.
//!
//! Cost on AVR: 1,500 cycles a stretch without a jerk limit, 2,500 for one that ends a block or brakes;
//! with one about 5,000.

use super::brake::Brake;
use super::exec::SEGMENT_S;
use super::float::{OCTAVE, below, greater, least, lesser, log, scaled, some};
use super::horizon::kappa;
pub use super::reach::Ahead;
use super::state::{Limits, State};
use crate::math::sqrt;

/// A part of a block, all of it that is left or less.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// How long it takes, s.
    pub seconds: f32,
    /// How far it goes, mm; to the end of the block if `ends`.
    pub distance: f32,
    /// It is the last of the block.
    pub ends: bool,
}

/// An acceleration limit no machine has: stands for none, and keeps floats in range.
pub const ACCEL_MOST: f32 = 1e6;

/// A jerk limit that takes the acceleration to its limit in less is none: stretches are no shorter.
const JERK_TIME_MIN: f32 = 0.001;

/// The jerk to put into a block, 0 for none; `accel` is its acceleration. Cost: 500.
pub fn effective_jerk(jerk: f32, accel: f32) -> f32 {
    if jerk > 0.0 && accel > jerk * JERK_TIME_MIN { jerk } else { 0.0 }
}

/// Logarithms that are further apart leave no doubt about the product of two numbers.
const PLAIN: i32 = OCTAVE / 5;

/// Whether two limits are equal, or one velocity is the other. Cost: 15.
fn same(a: f32, b: f32) -> bool {
    a.to_bits() == b.to_bits()
}

/// Velocity and acceleration along the path.
#[derive(Debug, Default)]
pub struct Governor {
    pub(super) state: State,
    pub(super) limits: Limits,
    pub(super) brake: Option<Brake>,
    /// Something may be better than the brake.
    pub(super) look: bool,
    /// An override has changed feeds, ever: a limit that a feed makes may be too near to be kept.
    pub(super) late: bool,
}

impl Governor {
    /// At rest.
    pub const fn new() -> Self {
        let limits = Limits { accel: 0.0, jerk: 0.0, kappa: 0.0, pace: 0.0 };
        let state = State { velocity: 0.0, alpha: 0.0 };
        Self { state, limits, brake: None, look: false, late: false }
    }

    /// Velocity, mm/s.
    pub fn velocity(&self) -> f32 {
        self.state.velocity
    }

    /// The machine stands still.
    pub fn stop(&mut self) {
        self.state = State::default();
        self.brake = None;
    }

    /// A block with these limits begins, mm/s^2 and mm/s^3. If they are others than before, it goes on with
    /// as much of its deceleration as may be ended in time; acceleration ends at once.
    pub fn begin(&mut self, accel: f32, jerk: f32) {
        if same(accel, self.limits.accel) && same(jerk, self.limits.jerk) {
            return;
        }
        self.brake = None;
        let mut pace = 0.0;
        let mut alpha = 0.0;
        if jerk > 0.0 {
            pace = jerk / accel;
            if self.state.alpha < 0.0 {
                alpha = greater(self.state.alpha * self.limits.accel / accel, -1.0);
                let most = sqrt(2.0 * jerk * self.state.velocity) / accel;
                alpha = greater(alpha, -most);
            }
        }
        self.state.alpha = alpha;
        self.limits = Limits { accel, jerk, kappa: kappa(accel, jerk), pace };
    }

    /// An override has changed feeds, of what runs and of what is ahead.
    pub fn change_feed(&mut self) {
        self.late = true;
        self.look = true;
    }

    /// What is ahead has changed.
    pub fn look_again(&mut self) {
        self.look = true;
    }

    /// The next stretch, of about `seconds` under a jerk limit and [`SEGMENT_S`] else, in a block with `left` mm to go at up to
    /// `cruise` mm/s.
    #[inline(always)]
    pub fn stretch(&mut self, left: f32, cruise: f32, ahead: &impl Ahead, seconds: f32) -> Stretch {
        if !some(self.limits.jerk) {
            return self.trapezoid(left, cruise, ahead.headroom());
        }
        self.smooth(left, cruise, ahead, seconds)
    }

    #[inline(never)]
    fn trapezoid(&mut self, left: f32, cruise: f32, headroom: f32) -> Stretch {
        let (v, seconds) = (self.state.velocity, SEGMENT_S);
        // Rounding may put a stop before the end of the block.
        let headroom = if headroom.is_sign_negative() { 0.0 } else { headroom };
        // Steady over a block that is short enough to be one stretch.
        if same(v, cruise)
            && below(cruise * cruise, headroom)
            && below(left, cruise * (seconds + seconds))
        {
            return Stretch { seconds: left / v, distance: left, ends: true };
        }
        // Mostly plain: a block that is run through in no more than one.
        if log(v) + log(seconds + seconds) < log(left) + PLAIN
            && below(v * (seconds + seconds), left)
        {
            let gain = self.limits.accel * seconds;
            let half = 0.5 * seconds;
            // An override may have taken the feed away from under it.
            let mut next = greater(lesser(v + gain, cruise), v - gain);
            let mut distance = (v + next) * half;
            let twice = self.limits.accel + self.limits.accel;
            if next * next > headroom + twice * (left - distance) {
                let b = 0.5 * gain;
                next = sqrt(b * b + headroom + twice * left - gain * v) - b;
                // A little more than the limit makes up for rounding.
                let least = v - gain * 1.005;
                next = greater(lesser(next, cruise), greater(least, 0.0));
                distance = (v + next) * half;
            }
            if distance + half * next < left && distance > 0.0 {
                self.state.velocity = next;
                return Stretch { seconds, distance, ends: false };
            }
        }
        self.finish(left, cruise, headroom)
    }

    /// `next`, or the least velocity that it can have at the end, from `v` and with so much to lose, if that
    /// is more by what is not rounding: an override has lowered the limit too late.
    #[inline(never)]
    pub(super) fn slowest(&self, v: f32, gain: f32, next: f32, nominal: f32) -> f32 {
        let least = sqrt(greater(v * v - gain, 0.0));
        if least > next + self.limits.accel * nominal { least } else { next }
    }

    /// All the rest of a block in one.
    #[inline(never)]
    fn finish(&mut self, left: f32, cruise: f32, headroom: f32) -> Stretch {
        let (v, nominal) = (self.state.velocity, SEGMENT_S);
        let gain = scaled(self.limits.accel * left, 1);
        let square = v * v + gain;
        let next = least(sqrt(least(square, headroom)), cruise);
        let late = below(next, v) && (self.late || below(cruise, v));
        let next = if late { self.slowest(v, gain, next, nominal) } else { next };
        self.state.velocity = next;
        let sum = v + next;
        let mut seconds = 2.0 * nominal;
        if below(cruise, v)
            || log(sum) + log(nominal) > log(left) + PLAIN
            || below(left, sum * nominal)
        {
            seconds = scaled(left, 1) / sum;
        } else if square > 0.0 {
            // From rest to rest or nearly so: there is a peak between.
            let peak = sqrt(0.5 * (square + next * next));
            if peak < cruise {
                seconds = (peak + peak - sum) / self.limits.accel;
            } else {
                let ramps = (cruise + cruise - sum) / self.limits.accel;
                // The ramps' way: each at the mean of its ends.
                let slower =
                    0.5 * ((cruise - v) * (cruise - v) + (cruise - next) * (cruise - next));
                seconds = (left + slower / self.limits.accel) / cruise;
                seconds = greater(seconds, ramps);
            }
        }
        Stretch { seconds, distance: left, ends: true }
    }
}
