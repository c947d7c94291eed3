//! A ramp, laid out to its end: from the present state to a steady velocity at a given place.
//!
//! Owned by the [`Governor`], exec level. A ramp has five phases of constant jerk: an acceleration ends, the velocity
//! is kept, the deceleration builds up, is kept, and ends. Velocity and distance are polynomials of the remaining time,
//! so that a slice is the difference of two values. Errors do not add up, the ramp ends exactly at its place, and a
//! slice in which the phase changes costs no more than any other.
//!
//! Units: mm, s. Cost on AVR: 3,500 cycles to lay out, 1,000 to 1,700 a slice.

use super::float::{below, greater, ratio, scaled, some};
use super::governor::{Governor, same};
use super::rise::MARGIN_FIRST;
use crate::math::sqrt;

/// The remainder of a ramp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ramp {
    /// Time and distance to the end of the ramp.
    time: f32,
    distance: f32,
    /// Velocity at the end of the ramp; `top` is the velocity before the deceleration, where the acceleration is 0.
    velocity: f32,
    top: f32,
    /// How long before the end the deceleration begins to end (`rise`), and reaches its maximum (`hold`).
    rise: f32,
    hold: f32,
    /// How long before the end the top is reached.
    coast: f32,
    /// Half of the jerk; `pace` is by how much alpha changes in a second.
    half: f32,
    pace: f32,
    /// Distance to the end where the deceleration begins.
    begin: f32,
    /// Whether the end velocity is known to be safe for what follows; otherwise the ramp ends in a standstill.
    pub closed: bool,
}

/// The phase that a ramp is in.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// Accelerating, or steady at the top.
    Up,
    /// Decelerating, and not about to end it.
    Down,
    /// The deceleration ends.
    Ending,
}

impl Ramp {
    /// Returns how long before the end the deceleration begins.
    fn fall(&self) -> f32 {
        self.hold + self.rise
    }

    /// Returns the velocity and the distance to the end at `time` before the end.
    #[inline(never)]
    fn at(&self, time: f32) -> (f32, f32) {
        const THIRD: f32 = 1.0 / 3.0;
        let w = self.velocity;
        if !below(self.rise, time) {
            let gain = self.half * time * time;
            return (w + gain, time * (w + gain * THIRD));
        }
        if !below(self.hold, time) {
            // The constant deceleration counts as if it had begun in the middle of the rise.
            let accel = scaled(self.half * self.rise, 1);
            let since = time - scaled(self.rise, -1);
            let gain = accel * since;
            let more = accel * self.rise * self.rise * (1.0 / 24.0);
            return (w + gain, w * time + scaled(gain, -1) * since + more);
        }
        let fall = self.fall();
        if !below(fall, time) {
            let (velocity, far) = self.off_top(fall - time);
            return (velocity, self.begin - far);
        }
        if !below(self.coast, time) {
            return (self.top, self.begin + self.top * (time - fall));
        }
        if !some(self.coast) {
            // The ramp only ends an acceleration.
            return self.off_top(time);
        }
        let (velocity, far) = self.off_top(time - self.coast);
        (velocity, self.begin + self.top * (self.coast - fall) + far)
    }

    /// Returns the velocity `time` before or after the top, and the distance to the top.
    #[inline(never)]
    fn off_top(&self, time: f32) -> (f32, f32) {
        let loss = self.half * time * time;
        (self.top - loss, time * (self.top - loss * (1.0 / 3.0)))
    }

    /// Returns for how long the present acceleration has built up; less than 0 if it is a deceleration.
    fn built(&self) -> f32 {
        let (time, fall) = (self.time, self.fall());
        if !below(self.rise, time) {
            -time
        } else if !below(self.hold, time) {
            -self.rise
        } else if !below(fall, time) {
            time - fall
        } else if below(self.coast, time) {
            time - self.coast
        } else {
            0.0
        }
    }

    /// Whether the ramp only ends an acceleration, at this velocity.
    pub fn ends_at(&self, velocity: f32) -> bool {
        same(self.velocity, velocity) && same(self.top, velocity)
    }

    pub fn phase(&self) -> Phase {
        if !below(self.rise, self.time) {
            Phase::Ending
        } else if below(self.time, self.fall()) {
            Phase::Down
        } else {
            Phase::Up
        }
    }
}

/// The end of an acceleration: how long it takes, and how far it goes.
#[derive(Clone, Copy)]
pub(super) struct Leveling {
    time: f32,
    pub distance: f32,
}

/// Returns the share of the acceleration limit that a change of velocity by `drop` reaches.
fn share_of(drop: f32, kappa: f32) -> f32 {
    let twice = scaled(kappa, 1);
    if below(drop, twice) { sqrt(ratio(drop, twice)) } else { 1.0 }
}

impl Governor {
    /// Drops the ramp, and takes over its present acceleration.
    #[inline(never)]
    pub(super) fn leave_ramp(&mut self) {
        self.take_alpha();
        self.ramp = None;
    }

    /// Takes over the present acceleration of the ramp, if there is one. The ramp goes on.
    #[inline(never)]
    pub(super) fn take_alpha(&mut self) {
        if let Some(ramp) = &self.ramp {
            let alpha = greater(ramp.built() * ramp.pace, -1.0);
            // Rounding may leave an acceleration that is too small to be ended.
            self.alpha = if below(alpha.abs(), 1e-4) { 0.0 } else { alpha };
        }
    }

    /// Lays out a ramp from the present state down to `w`, as hard as the limits allow, after `slack` mm at the top. If
    /// the present deceleration already leads below `w`, it ends at once, below `w`.
    #[inline(never)]
    pub(super) fn lay(&mut self, w: f32, slack: f32, closed: bool) {
        let (alpha, limits) = (self.alpha, &self.limits);
        let build = limits.build;
        let climb = limits.kappa * alpha * alpha;
        let top = self.velocity + climb;
        let mut w = w;
        let mut share = share_of(greater(top - w, 0.0), limits.kappa);
        if alpha < 0.0 && -alpha > share {
            share = -alpha;
            w = greater(top - climb - climb, 0.0);
        }
        let rise = greater(share, 1e-4) * build;
        let half = scaled(limits.jerk, -1);
        // The deceleration is kept only where it reaches its limit.
        let hold =
            if same(share, 1.0) { greater(ratio(top - w, limits.accel), rise) } else { rise };
        let fall = hold + rise;
        let coast = if slack > 0.0 { fall + ratio(slack, top) } else { fall };
        let begin = scaled(fall, -1) * (top + w);
        let time = coast + alpha * build;
        let ramp = Ramp {
            time,
            distance: begin + greater(slack, 0.0),
            velocity: w,
            top,
            rise,
            hold,
            coast,
            half,
            pace: limits.pace,
            begin,
            closed,
        };
        let at_top = !some(alpha);
        let ramp = self.ramp.insert(ramp);
        if !at_top {
            (_, ramp.distance) = ramp.at(time);
        }
    }

    /// Returns how an acceleration ends so that the velocity comes to `top`. Cost: 1,100.
    #[inline(never)]
    pub(super) fn leveling(&self, top: f32) -> Leveling {
        let gain = top - self.velocity;
        let time = ratio(scaled(gain, 1), self.alpha * self.limits.accel);
        Leveling { time, distance: time * (top - gain * (1.0 / 3.0)) }
    }

    /// Ends the acceleration so that the velocity comes to `top`. Cost: 700.
    #[inline(never)]
    pub(super) fn level_off(&mut self, top: f32, how: &Leveling) {
        let Leveling { time, distance } = *how;
        let pace = ratio(self.alpha, time);
        let none = 0.0;
        self.ramp = Some(Ramp {
            time,
            distance,
            velocity: top,
            top,
            rise: none,
            hold: none,
            coast: none,
            half: scaled(pace * self.limits.accel, -1),
            pace,
            begin: none,
            closed: true,
        });
    }

    /// Ends the deceleration as soon as the limits allow, at the velocity `bottom`.
    #[inline(never)]
    pub(super) fn bottom_out(&mut self, bottom: f32) {
        let rise = -self.alpha * self.limits.build;
        let half = scaled(self.limits.jerk, -1);
        let pace = self.limits.pace;
        let ramp = Ramp {
            time: rise,
            distance: 0.0,
            velocity: bottom,
            top: bottom,
            rise,
            hold: rise,
            coast: rise,
            half,
            pace,
            begin: 0.0,
            closed: true,
        };
        let ramp = self.ramp.insert(ramp);
        (_, ramp.distance) = ramp.at(rise);
    }

    /// Computes a slice of the ramp, up to its end if little more is left.
    #[inline(never)]
    pub(super) fn follow(&mut self, seconds: f32) {
        let Some(ramp) = &mut self.ramp else { return };
        let next = ramp.time - seconds;
        let (time, distance);
        if below(scaled(next, 1), seconds) {
            (time, distance) = (ramp.time, ramp.distance);
            (self.velocity, self.alpha) = (ramp.velocity, 0.0);
            self.ramp = None;
            (self.wait, self.margin, self.closing) = (0, MARGIN_FIRST, false);
        } else {
            let (velocity, left) = ramp.at(next);
            (time, distance) = (seconds, ramp.distance - left);
            (ramp.time, ramp.distance) = (next, left);
            self.velocity = if velocity.is_sign_negative() { 0.0 } else { velocity };
        }
        self.add(time, distance, self.potential(distance));
    }
}
