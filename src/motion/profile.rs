//! Speed changes limited in jerk and in acceleration, exactly: how long, how far, how fast at most.
//!
//! A ramp starts and ends with zero acceleration. Its acceleration rises at the jerk limit, holds at
//! the acceleration limit if it gets there, and falls at the jerk limit:
//!
//! ```text
//! acceleration   ____            dv <= A^2/J:  time = 2 sqrt(dv/J)
//!               /    \           otherwise:    time = dv/A + A/J
//!              /      \          length = (v0 + v1)/2 * time, as the shape is symmetrical
//!            -+--+--+--+-> t
//!             jerk  jerk
//! ```
//!
//! Called by exec ([`Ramp`], [`peak`], [`reach`]) and by the look-ahead ([`brake`]). Pure functions.
//!
//! Units: mm, s (degrees for a rotary-only move). Inputs are finite and not negative. A limit below
//! [`NEGLIGIBLE`] means none: without a jerk limit ramps are trapezoids, without either they take
//! no time. Costs are AVR cycles, from the operation costs in [`crate::math`].

use crate::math::sqrt;

/// A jerk or acceleration limit below this is none. Keeps quotients finite.
pub const NEGLIGIBLE: f32 = 1e-9;

/// What a ramp must respect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Acceleration, mm/s^2; 0 for none.
    pub accel: f32,
    /// Jerk, mm/s^3; 0 for none.
    pub jerk: f32,
}

impl Limits {
    /// How long a speed change takes, and how long each of its two jerk phases. Cost: 1,400.
    fn times(&self, dv: f32) -> (f32, f32) {
        let limited = self.accel > NEGLIGIBLE;
        if self.jerk <= NEGLIGIBLE {
            return (if limited { dv / self.accel } else { 0.0 }, 0.0);
        }
        if limited && dv * self.jerk > self.accel * self.accel {
            let phase = self.accel / self.jerk;
            (dv / self.accel + phase, phase)
        } else {
            let phase = sqrt(dv / self.jerk);
            (phase + phase, phase)
        }
    }

    /// The length of the ramp up from `low` to `high`. Cost: 2,000.
    fn length(&self, low: f32, high: f32) -> f32 {
        (low + high) * 0.5 * self.times(high - low).0
    }
}

/// A change of speed, up or down.
#[derive(Clone, Copy, Debug)]
pub struct Ramp {
    v0: f32,
    v1: f32,
    time: f32,
    length: f32,
    /// Duration of each jerk phase.
    phase: f32,
    /// Half the acceleration between the jerk phases, negative for a ramp down.
    half_accel: f32,
    /// A sixth of the jerk at the start, negative for a ramp down.
    sixth_jerk: f32,
}

impl Ramp {
    /// The fastest ramp from `v0` to `v1`. Cost: 2,500.
    pub fn new(v0: f32, v1: f32, limits: &Limits) -> Self {
        let dv = v1 - v0;
        let (time, phase) = limits.times(if dv < 0.0 { -dv } else { dv });
        let sign = |x: f32| if dv < 0.0 { -x } else { x };
        Ramp {
            v0,
            v1,
            time,
            length: (v0 + v1) * 0.5 * time,
            phase,
            half_accel: sign(limits.accel * 0.5),
            sixth_jerk: sign(limits.jerk * (1.0 / 6.0)),
        }
    }

    /// Duration, s.
    pub fn time(&self) -> f32 {
        self.time
    }

    /// Distance covered, mm.
    pub fn length(&self) -> f32 {
        self.length
    }

    /// Travelled `t` seconds after the start; `t` is clamped to the ramp. Precise near the start.
    /// Cost: 900 in the first jerk phase, 1,600 in the middle, 1,300 in the last.
    pub fn distance(&self, t: f32) -> f32 {
        let left = self.time - t;
        if left <= 0.0 {
            self.length
        } else if t <= 0.0 {
            0.0
        } else if t > self.phase && left <= self.phase {
            self.length - (self.v1 * left - self.gained(left))
        } else {
            self.v0 * t + self.gained(t)
        }
    }

    /// Still to travel `t` seconds after the start; `t` is clamped to the ramp. Precise near the
    /// end. Cost: as [`Ramp::distance`], seen from the end.
    pub fn remaining(&self, t: f32) -> f32 {
        let left = self.time - t;
        if left <= 0.0 {
            0.0
        } else if t <= 0.0 {
            self.length
        } else if left > self.phase && t <= self.phase {
            self.length - (self.v0 * t + self.gained(t))
        } else {
            // The ramp run backwards: what it gained forwards, it loses.
            self.v1 * left - self.gained(left)
        }
    }

    /// Velocity `t` seconds after the start; `t` is clamped to the ramp. Cost: 900.
    pub fn velocity(&self, t: f32) -> f32 {
        let left = self.time - t;
        if left <= 0.0 {
            self.v1
        } else if t <= 0.0 {
            self.v0
        } else if t <= self.phase {
            self.v0 + 3.0 * self.sixth_jerk * t * t
        } else if left <= self.phase {
            self.v1 - 3.0 * self.sixth_jerk * left * left
        } else {
            self.v0 + self.half_accel * (t + t - self.phase)
        }
    }

    /// What the acceleration adds to `v0 * t` up to `t`, in the first two phases. Cost: 500, 1,000.
    fn gained(&self, t: f32) -> f32 {
        if t <= self.phase {
            self.sixth_jerk * t * t * t
        } else {
            let held = t - self.phase;
            self.half_accel * (held * (held + self.phase) + self.phase * self.phase * (1.0 / 3.0))
        }
    }
}

/// The highest velocity, at least `v`, that a ramp from `v` reaches within `length`; time reversed,
/// the highest from which it can slow down to `v`.
///
/// Never above the true value: `Ramp::new(v, reach(..), ..)` is not longer than `length` by more
/// than 1e-6 of it. Below it by at most 0.05 % of the speed change (and 1e-6 of the velocity).
///
/// Cost: 2,900 when the acceleration limit is reached, 5,100 when the jerk limit rules, 1,100 less
/// for that without an acceleration limit.
pub fn reach(v: f32, length: f32, limits: &Limits) -> f32 {
    let &Limits { accel, jerk } = limits;
    if length <= 0.0 {
        return v;
    }
    if accel > NEGLIGIBLE {
        let phase = if jerk > NEGLIGIBLE { accel / jerk } else { 0.0 };
        let knee = accel * phase;
        // Longer than the shortest ramp that reaches the acceleration limit? Then
        // (v + w)/2 * ((w - v)/A + A/J) = length, solved for w.
        if length >= (v + v + knee) * phase {
            let low = v - 0.5 * knee;
            let w = sqrt(low * low + 2.0 * length * accel) - 0.5 * knee;
            return greater(next_below(w), v);
        }
    } else if jerk <= NEGLIGIBLE {
        return f32::MAX;
    }
    let phase = jerk_phase(v, length, jerk);
    greater(next_below(v + jerk * phase * phase), v)
}

/// The highest velocity at which `length` may be entered if it is to be left at `exit`, or at any
/// higher velocity that is found possible later.
///
/// That is not simply `reach(exit, ..)`: a ramp from w down to w/3 is 9 % *longer* than one down to
/// 0, so that `reach` falls with `exit` at first, by up to 5.5 %. A machine that entered at
/// `reach(0)` could not keep to a later, higher `exit`. So this is the greatest function below
/// `reach` that never falls as `exit` rises, or a little less. It is at least `exit`.
///
/// Cost: 100 to 500 more than [`reach`].
pub fn brake(exit: f32, length: f32, limits: &Limits) -> f32 {
    let &Limits { accel, jerk } = limits;
    // `reach` rises from exit^3 = length^2 J / 32 on, and from exit = A^2 / 2J on. The first in
    // logarithms: their error is below 0.28 octaves in total, to the safe side with the 36.
    let cubed = 3 * log(exit) + 5 * 128;
    let rises = jerk <= NEGLIGIBLE
        || cubed > 2 * log(length) + log(jerk) + 36
        || (accel > NEGLIGIBLE && 2.0 * exit * jerk >= accel * accel);
    if rises {
        reach(exit, length, limits)
    } else {
        greater(0.944 * reach(0.0, length, limits), exit)
    }
}

/// The time y of a jerk phase with (2 v + J y^2) y = length, or up to 0.022 % less. Cost: 3,500.
fn jerk_phase(v: f32, length: f32, jerk: f32) -> f32 {
    let twice = v + v;
    let mut y = rough_phase(v, length, jerk);
    // The cubic is convex, so that Newton's iterates are not below the root. The rough root is
    // within 15 % of it, the first iterate within 1.4 %, the second within 0.016 %.
    for _ in 0..2 {
        let jy = jerk * y;
        let jyy = jy * y;
        let jyyy = jyy * y;
        y = (jyyy + jyyy + length) / (3.0 * jyy + twice);
    }
    y * (1.0 - 2.2e-4)
}

/// The root of `J y^3 + 2 v y = length` within 15 %, without a float operation: the bits of a float
/// are its logarithm, roughly. Works in 1/128 octave. Cost: 120.
fn rough_phase(v: f32, length: f32, jerk: f32) -> f32 {
    let one = log(1.0);
    // Where the cubic term rules, and where the linear one does: each alone is above the root.
    let cubic = (((log(length) - log(jerk)) * 21_845) >> 16) + one;
    let linear = log(length) - log(v) + one - 128;
    // Where they meet the root is 0.68 of either, 0.55 octaves less. The 8 centres the error.
    let dip = (64 - ((cubic - linear).abs() >> 2)).max(0) + 8;
    let root = cubic.min(linear) - dip;
    f32::from_bits((root.max(128) as u32) << 16)
}

/// The logarithm of a number that is not negative in 1/128 octaves, plus a constant; up to 12 too
/// small. Cost: 20.
fn log(x: f32) -> i32 {
    (x.to_bits() >> 16 & 0x7FFF) as i32
}

/// The lesser of two numbers. On AVR `f32::min` is a call that also sees to NaN. Cost: 70.
pub(crate) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater of two numbers. Cost: 70.
pub(crate) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// A few roundings less, at least 0. Cost: 20.
fn next_below(x: f32) -> f32 {
    f32::from_bits(x.to_bits().saturating_sub(8))
}

/// The highest velocity in `max(v0, v1)..=cruise` with which a ramp from `v0` up to it and a ramp
/// down from it to `v1` fit in `length`, or up to 0.05 % of the rise less. Never one that does not
/// fit, unless already the ramp between `v0` and `v1` does not: then it is `max(v0, v1)`.
///
/// Cost: 200 if `v0` or `v1` is `cruise`; `reach` if they are equal; 2,900 if both ramps get to the
/// acceleration limit; 4,200 more if `cruise` fits; else about 14,000 (two iterations, rarely three, at most 8).
pub fn peak(v0: f32, v1: f32, length: f32, cruise: f32, limits: &Limits) -> f32 {
    let (low, high) = if v0 < v1 { (v0, v1) } else { (v1, v0) };
    if high >= cruise {
        return high;
    }
    if low == high {
        return lesser(reach(low, 0.5 * length, limits), cruise);
    }
    let &Limits { accel, jerk } = limits;
    if accel > NEGLIGIBLE {
        // Both ramps at the acceleration limit: a quadratic, as in `reach`.
        let knee = if jerk > NEGLIGIBLE { accel * (accel / jerk) } else { 0.0 };
        let (a, b) = (low - 0.5 * knee, high - 0.5 * knee);
        let p = sqrt(length * accel + 0.5 * (a * a + b * b)) - 0.5 * knee;
        if p >= high + knee || jerk <= NEGLIGIBLE {
            return lesser(greater(next_below(p), high), cruise);
        }
    } else if jerk <= NEGLIGIBLE {
        return cruise;
    }
    if limits.length(low, cruise) + limits.length(high, cruise) <= length {
        return cruise;
    }
    lesser(greater(between(low, high, length, limits), high), cruise)
}

/// [`peak`] when the ramp from `high` does not get to the acceleration limit. Cost: 3,000 + 3,500
/// an iteration.
fn between(low: f32, high: f32, length: f32, limits: &Limits) -> f32 {
    let &Limits { accel, jerk } = limits;
    let slack = length - limits.length(low, high);
    if slack <= 1e-6 * length {
        return high;
    }
    let (knee, half) =
        if accel > NEGLIGIBLE { (accel * (accel / jerk), 0.5 / accel) } else { (f32::MAX, 0.0) };
    let shift = (high - low) / jerk;
    // In terms of x, the jerk phase of the ramp from `high`, the sum of the lengths is convex, so
    // that Newton's iterates are not below the root (but the first guess may be).
    let mut x = rough_phase(high, 0.7 * slack, jerk);
    for _ in 0..8 {
        let jxx = jerk * x * x;
        let p = high + jxx;
        let sum = p + low;
        let dv = p - low;
        // The ramp from `low`: its length, and the derivative of that by x.
        let (long, slope) = if dv > knee {
            (half * sum * (dv + knee), (half + half) * (sum + dv + knee) * jerk * x)
        } else {
            let s = greater(sqrt(x * x + shift), f32::MIN_POSITIVE);
            (sum * s, x * (sum + dv + dv) / s)
        };
        let step = ((high + p) * x + long - length) / (high + p + jxx + jxx + slope);
        x -= step;
        // The error left is the square of this step, relatively.
        if step.abs() <= 0.01 * x {
            break;
        }
    }
    let x = greater(x, 0.0) * (1.0 - 1.3e-4);
    next_below(high + jerk * x * x)
}
