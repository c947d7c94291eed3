//! The governor: how fast the machine goes in the next few milliseconds.
//!
//! Owned by exec, which asks [`Governor::stretch`] for one stretch after the other: with the way left in
//! the block, its velocity limit, and what is ahead ([`Ahead`]). It goes as fast as it may, always able
//! to slow down in time for all that is queued. Its state is velocity and acceleration, nothing else: it
//! does not care where blocks begin and end, so a ramp goes on over any number of them, and a limit
//! that changes (more blocks, an override, a hold) is taken up at the next stretch from where it is.
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
//! The acceleration is `a = alpha A`, alpha from -1 to 1, and changes by at most J in a second: the seven
//! phases, in steps of a stretch. In each stretch the governor tries to raise alpha, to keep it and to
//! lower it, and takes the first that leaves it safe. Safe is, with `k = A^2 / 2J`:
//!
//! - *for the feed and for a corner near by*: if alpha went to 0 at once the velocity would come to
//!   `v + k alpha^2`, which must not be above the limit.
//! - *for what is far ahead*: lowering alpha to -1, braking, and raising it to 0 again must get it down to
//!   the limit w in time. To get from v (alpha = 0) down to w takes `(v + w)/2 (dv/A + A/J)`; where dv is so
//!   small that alpha does not get to -1, less. In brake potential (2 A l, see `horizon`) that is
//!   `(v + k)^2 - (w - k)^2`. If alpha is not 0, start from the velocity at which it was or will be,
//!   and add or take away the way between:
//!
//!   ```text
//!   v^2 + 2 k v (1 + alpha)^2 + k^2 ((1 + alpha^2)^2 + 8/3 alpha^3)  <=  key - P
//!   ```
//!
//!   The left side plus P does not change while it brakes so: once safe, it stays safe.
//! - *or it is about to land*: the velocity falls to w as a parabola, alpha to 0 with it, at the very place;
//!   from way D that takes `T = 3 D / (v + 2 w)` and starts with `a = -2 (v - w) / T`. As soon as that is no more
//!   than it brakes already, it commits itself to the parabola ([`Landing`]), which ends exactly.
//!
//! Cost on AVR: 1,500 cycles a stretch without a jerk limit, 2,500 for one that ends a block or brakes;
//! with one about 5,000.

use super::float::{greater, lesser};
use super::horizon::{kappa, key};
use super::queue::Anchor;
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

/// What is ahead of the block that runs.
pub trait Ahead {
    /// The square of the velocity at the block's end without a jerk limit.
    fn headroom(&self) -> f32;
    /// The `n`th limit ahead, nearest first.
    fn anchor(&self, n: u8) -> Option<Anchor>;
}

/// An acceleration limit no machine has: stands for none, and keeps floats in range.
pub const ACCEL_MOST: f32 = 1e6;

/// A jerk limit that takes the acceleration to its limit in less is none: stretches are no shorter.
const JERK_TIME_MIN: f32 = 0.001;

/// The jerk to put into a block, 0 for none; `accel` is its acceleration. Cost: 500.
pub fn effective_jerk(jerk: f32, accel: f32) -> f32 {
    if jerk > 0.0 && accel > jerk * JERK_TIME_MIN { jerk } else { 0.0 }
}

/// The last part of a ramp down: `velocity + rate t^2` with t seconds to go.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Landing {
    velocity: f32,
    rate: f32,
    time: f32,
}

impl Landing {
    /// The way to go with `t` seconds to go.
    fn way(&self, t: f32) -> f32 {
        t * (self.velocity + self.rate * t * t * (1.0 / 3.0))
    }
    fn velocity(&self, t: f32) -> f32 {
        self.velocity + self.rate * t * t
    }
}

/// Limits of the block that runs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Limits {
    accel: f32,
    /// 0 for none.
    jerk: f32,
    kappa: f32,
    /// `jerk / accel`: how much alpha may change in a second.
    pace: f32,
}

/// Velocity and acceleration along the path.
#[derive(Debug, Default)]
pub struct Governor {
    velocity: f32,
    /// Share of the acceleration limit, with a jerk limit.
    alpha: f32,
    limits: Limits,
    landing: Option<Landing>,
}

/// A possible next state.
#[derive(Clone, Copy)]
struct Next {
    alpha: f32,
    velocity: f32,
    /// Way left in the block.
    left: f32,
}

impl Governor {
    /// At rest.
    pub const fn new() -> Self {
        let limits = Limits { accel: 0.0, jerk: 0.0, kappa: 0.0, pace: 0.0 };
        Self { velocity: 0.0, alpha: 0.0, limits, landing: None }
    }

    /// Velocity, mm/s.
    pub fn velocity(&self) -> f32 {
        self.velocity
    }

    /// The machine stands still.
    pub fn stop(&mut self) {
        self.velocity = 0.0;
        self.alpha = 0.0;
        self.landing = None;
    }

    /// A block with these limits begins, mm/s^2 and mm/s^3.
    pub fn begin(&mut self, accel: f32, jerk: f32) {
        if accel == self.limits.accel && jerk == self.limits.jerk {
            return;
        }
        self.landing = None;
        let mut pace = 0.0;
        if jerk > 0.0 {
            // The acceleration goes on, if it may.
            let alpha = self.alpha * self.limits.accel / accel;
            self.alpha = lesser(greater(alpha, -1.0), 1.0);
            pace = jerk / accel;
        } else {
            self.alpha = 0.0;
        }
        self.limits = Limits { accel, jerk, kappa: kappa(accel, jerk), pace };
    }

    /// What is ahead has changed.
    pub fn look_again(&mut self) {
        if let Some(landing) = self.landing.take() {
            let accel = 2.0 * landing.rate * landing.time;
            self.alpha = greater(-accel / self.limits.accel, -1.0);
        }
    }

    /// The next stretch, of about `seconds`, in a block with `left` mm to go at up to `cruise` mm/s.
    #[inline(never)]
    pub fn stretch(&mut self, left: f32, cruise: f32, ahead: &impl Ahead, seconds: f32) -> Stretch {
        if self.limits.jerk == 0.0 {
            return self.trapezoid(left, cruise, ahead.headroom(), seconds);
        }
        match self.landing {
            Some(landing) if landing.way(landing.time) >= LANDED * left => {
                self.land(landing, left, seconds)
            }
            // Landed a little before the end of the block.
            Some(_) => {
                self.landing = None;
                self.alpha = 0.0;
                self.smooth(left, cruise, ahead, seconds)
            }
            None => self.smooth(left, cruise, ahead, seconds),
        }
    }

    fn trapezoid(&mut self, left: f32, cruise: f32, headroom: f32, seconds: f32) -> Stretch {
        let v = self.velocity;
        let gain = self.limits.accel * seconds;
        // Short blocks are a stretch at once.
        if left > v * seconds {
            let half = 0.5 * seconds;
            let mut next = lesser(v + gain, cruise);
            let mut distance = (v + next) * half;
            let twice = self.limits.accel + self.limits.accel;
            if next * next > headroom + twice * (left - distance) {
                let b = 0.5 * gain;
                next = sqrt(b * b + headroom + twice * left - gain * v) - b;
                next = greater(lesser(next, cruise), greater(v - gain, 0.0));
                distance = (v + next) * half;
            }
            if distance + half * next < left {
                self.velocity = next;
                return Stretch { seconds, distance, ends: false };
            }
        }
        self.finish(left, cruise, headroom, seconds)
    }

    /// All the rest of a block in one.
    #[inline(never)]
    fn finish(&mut self, left: f32, cruise: f32, headroom: f32, nominal: f32) -> Stretch {
        let v = self.velocity;
        let gain = 2.0 * self.limits.accel * left;
        let square = v * v + gain;
        let mut next = sqrt(lesser(square, headroom));
        if next > cruise {
            next = cruise;
        }
        self.velocity = next;
        let sum = v + next;
        let mut seconds = 2.0 * nominal;
        if sum * nominal > left {
            seconds = (left + left) / sum;
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

    fn smooth(&mut self, left: f32, cruise: f32, ahead: &impl Ahead, nominal: f32) -> Stretch {
        let v = self.velocity;
        // What the first stretch from rest comes to.
        let first = self.limits.jerk * nominal * nominal;
        if v < 0.01 * first {
            self.alpha = greater(self.alpha, 0.0);
        }
        let mut seconds = nominal;
        let mut ends = false;
        if left <= v * nominal {
            seconds = left / v;
            ends = true;
        }
        let mut next = self.choose(left, cruise, ahead, seconds, ends);
        let half = 0.5 * seconds;
        if !ends && (v + next.velocity) * half + half * next.velocity >= left {
            // What would be left is not worth a stretch.
            ends = true;
            let sum = v + next.velocity;
            let exact = if sum * nominal > left { (left + left) / sum } else { 2.0 * nominal };
            if exact < seconds {
                seconds = exact;
                next = self.choose(left, cruise, ahead, seconds, ends);
            }
        }
        if next.velocity <= v && v < 0.01 * first && v < 0.5 * cruise {
            return self.creep(left, nominal);
        }
        let mut distance = (v + next.velocity) * 0.5 * seconds;
        if ends {
            self.arrive(&mut next, ahead);
            let sum = v + next.velocity;
            seconds = if sum * nominal > left { (left + left) / sum } else { 2.0 * nominal };
            distance = left;
        }
        self.velocity = next.velocity;
        self.alpha = next.alpha;
        if next.alpha < 0.0 {
            self.landing = self.landing_ahead(&next, ahead, ends);
        }
        Stretch { seconds, distance, ends }
    }

    /// A limit at the very end of the block is kept exactly: stretches are not as fine.
    fn arrive(&self, next: &mut Next, ahead: &impl Ahead) {
        if let Some(anchor) = ahead.anchor(0)
            && anchor.ahead <= 0.0
            && next.velocity > anchor.velocity
        {
            next.velocity = anchor.velocity;
            next.alpha = 0.0;
        }
    }

    /// From rest to rest over what is too short to get going: a fraction of a step, most likely.
    #[inline(never)]
    fn creep(&mut self, left: f32, nominal: f32) -> Stretch {
        self.stop();
        // Four jerk phases: left = J T^3 / 32.
        let seconds = cube_root(32.0 * left / self.limits.jerk);
        Stretch { seconds: greater(seconds, nominal), distance: left, ends: true }
    }

    /// The best state to be in after `seconds`.
    // In line: more than 18 bytes of arguments go wrong on AVR (`xtask/src/elf/stack_args.rs`).
    #[inline(always)]
    fn choose(&self, left: f32, cruise: f32, ahead: &impl Ahead, seconds: f32, ends: bool) -> Next {
        let change = self.limits.pace * seconds;
        let up = lesser(self.alpha + change, 1.0);
        let down = greater(self.alpha - change, -1.0);
        // Up to the feed and no further.
        let highest = match self.level_off(cruise, change, seconds) {
            Some(velocity) => self.at(velocity, 0.0, left, seconds, ends),
            None => {
                let alpha = greater(lesser(up, self.towards(cruise, seconds)), down);
                self.next(alpha, left, seconds, ends)
            }
        };
        if self.safe(&highest, cruise, ahead) {
            return highest;
        }
        // To cruise is worth a stop on the way up or down.
        if (self.alpha < 0.0) != (highest.alpha < 0.0) || (self.alpha > 0.0 && down < 0.0) {
            let level = self.next(0.0, left, seconds, ends);
            if self.safe(&level, cruise, ahead) {
                return level;
            }
        }
        let same = self.next(lesser(self.alpha, highest.alpha), left, seconds, ends);
        if self.safe(&same, cruise, ahead) {
            return same;
        }
        self.next(down, left, seconds, ends)
    }

    /// The velocity itself if it is so near that the acceleration need not build up.
    fn level_off(&self, cruise: f32, change: f32, seconds: f32) -> Option<f32> {
        let change = lesser(change, 1.0);
        let near = self.limits.accel * change * seconds;
        let way = cruise - self.velocity;
        let level = self.alpha <= change && -self.alpha <= change;
        (level && way <= near && -way <= near).then_some(cruise)
    }

    /// The alpha with which the velocity comes to `cruise` if alpha goes to 0 from there:
    /// `v' + k alpha'^2 = cruise`.
    fn towards(&self, cruise: f32, seconds: f32) -> f32 {
        let half = 0.5 * self.limits.accel * seconds;
        let way = cruise - self.velocity - half * self.alpha;
        if way <= 0.0 {
            return way / half;
        }
        let b = 0.5 * half;
        let kappa = self.limits.kappa;
        // The quotient that does not cancel.
        way / (b + sqrt(b * b + kappa * way))
    }

    // In line: more than 18 bytes of arguments go wrong on AVR (`xtask/src/elf/stack_args.rs`).
    #[inline(always)]
    fn at(&self, velocity: f32, alpha: f32, left: f32, seconds: f32, ends: bool) -> Next {
        let way = 0.5 * (self.velocity + velocity) * seconds;
        let left = if ends { 0.0 } else { greater(left - way, 0.0) };
        Next { alpha, velocity, left }
    }

    /// The state when alpha has gone to `alpha` as fast as it may, and stayed there.
    fn next(&self, alpha: f32, left: f32, seconds: f32, ends: bool) -> Next {
        let mut mean = 0.5 * (self.alpha + alpha);
        let change = alpha - self.alpha;
        let most = self.limits.pace * seconds;
        let change = if change < 0.0 { -change } else { change };
        if change < 0.99 * most {
            mean += 0.5 * (alpha - self.alpha) * (1.0 - change / most);
        }
        let velocity = self.velocity + mean * self.limits.accel * seconds;
        self.at(greater(velocity, 0.0), alpha, left, seconds, ends)
    }

    fn safe(&self, next: &Next, cruise: f32, ahead: &impl Ahead) -> bool {
        let kappa = self.limits.kappa;
        let alpha = next.alpha;
        let ease = if alpha > 0.0 { kappa * alpha * alpha } else { 0.0 };
        let level = next.velocity + ease;
        // A feed that is lower now than it was is gone down to.
        if level > cruise * ROUNDING && level > self.velocity * ROUNDING {
            return false;
        }
        let within = 2.0 * self.limits.accel * next.left;
        let mut needed = None;
        let mut n = 0;
        while let Some(anchor) = ahead.anchor(n) {
            let slack = anchor.ahead + within;
            let w = anchor.velocity;
            let base = key(w, kappa);
            let near = slack < (w + kappa) * (w + kappa) - base;
            if near && level <= w * ROUNDING {
                n += 1;
                continue;
            }
            if alpha < 0.0 && near && next.velocity <= w * ROUNDING {
                n += 1;
                continue;
            }
            if !near {
                let needed = *needed.get_or_insert_with(|| self.needed(next));
                if needed <= (base + slack) * ROUNDING {
                    return true;
                }
            }
            return self.landing(next, w, slack).is_some();
        }
        true
    }

    /// The potential it takes to brake from a state.
    fn needed(&self, next: &Next) -> f32 {
        let (v, alpha, kappa) = (next.velocity, next.alpha, self.limits.kappa);
        let more = 1.0 + alpha;
        let square = alpha * alpha;
        let even = 1.0 + square;
        v * v
            + 2.0 * kappa * v * more * more
            + kappa * kappa * (even * even + square * alpha * (8.0 / 3.0))
    }

    /// The landing from a state at `w`, `slack` ahead, if it takes no more than it brakes already.
    // In line: more than 18 bytes of arguments go wrong on AVR (`xtask/src/elf/stack_args.rs`).
    #[inline(always)]
    fn landing(&self, next: &Next, w: f32, slack: f32) -> Option<Landing> {
        let drop = next.velocity - w;
        if next.alpha >= 0.0 || drop <= 0.0 || slack <= 0.0 {
            return None;
        }
        let limits = &self.limits;
        let way = 0.5 * slack / limits.accel;
        let time = 3.0 * way / (next.velocity + w + w);
        let brake = 2.0 * drop;
        // Not more than it brakes now, and not faster back to nothing than the jerk allows.
        if brake > -next.alpha * limits.accel * time * 1.01
            || brake > limits.jerk * time * time * 1.01
        {
            return None;
        }
        Some(Landing { velocity: w, rate: drop / (time * time), time })
    }

    /// The landing at whatever made it brake.
    fn landing_ahead(&self, next: &Next, ahead: &impl Ahead, ends: bool) -> Option<Landing> {
        let _ = ends;
        let within = 2.0 * self.limits.accel * next.left;
        let mut n = 0;
        while let Some(anchor) = ahead.anchor(n) {
            if anchor.velocity < next.velocity {
                return self.landing(next, anchor.velocity, anchor.ahead + within);
            }
            n += 1;
        }
        None
    }

    fn land(&mut self, landing: Landing, left: f32, nominal: f32) -> Stretch {
        let before = landing.way(landing.time);
        let time = greater(landing.time - nominal, 0.0);
        let distance = before - landing.way(time);
        let next = landing.velocity(time);
        if distance + 0.5 * nominal * next < left && time > 0.5 * nominal {
            self.landing = Some(Landing { time, ..landing });
            self.velocity = next;
            return Stretch { seconds: nominal, distance, ends: false };
        }
        // To the end of the block: when is that?
        let goal = before - left;
        let mut time = landing.time;
        for _ in 0..3 {
            let speed = greater(landing.velocity(time), 1e-3);
            time = greater(time - (landing.way(time) - goal) / speed, 0.0);
        }
        let next = landing.velocity(time);
        self.velocity = next;
        let mut seconds = landing.time - time;
        if time <= 0.1 * nominal || goal <= 0.01 * left {
            self.landing = None;
            self.alpha = 0.0;
            self.velocity = landing.velocity;
            seconds = landing.time;
        } else {
            self.landing = Some(Landing { time, ..landing });
        }
        Stretch { seconds, distance: left, ends: true }
    }
}

/// Up to 5 % more than the cube root of a positive number: the bits of a float are nearly its logarithm.
fn cube_root(x: f32) -> f32 {
    f32::from_bits(x.to_bits() / 3 + 0x2A51_19F2) * 1.05
}

/// A landing that covers so much of what is left of the block goes to its end.
const LANDED: f32 = 0.99;

/// What floats may be off.
const ROUNDING: f32 = 1.00002;
