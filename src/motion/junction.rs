//! Cornering: how fast the corner between two straight moves may be taken.
//!
//! The corner is thought of as rounded by an arc that stays within the junction deviation of it; on
//! that arc the centripetal acceleration may be the junction acceleration (TinyG's and grbl's
//! method). The velocity itself is not rounded: at the corner each axis' velocity changes at once.
//!
//! Called by the line builder. Units: mm (degrees for rotary axes), s. Costs are AVR cycles.

use kerf_macros::small;

use super::dynamics::Dynamics;
use super::float::{OCTAVE, below, log, scaled, some};
use crate::hal::arithmetic::product;
use crate::math::sqrt;
use crate::units::PerAxis;

/// The square of a change of direction, about 0.1 degree, that counts as none: positions in units of
/// 0.1 um turn 0.1 mm segments of a straight line by as much. In 2^-28.
const STRAIGHT: u32 = 1000;
/// Beyond this the direction is reversed, about 0.4 degree from it; rounding decides what is left.
const REVERSED: f32 = 1.0 - 1e-5;

/// The direction of a move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Heading {
    /// How far each axis travels for a unit of the path, in 2^-14: up to [`ONE`].
    pub unit: PerAxis<i16>,
    /// Junction deviation in this direction, mm.
    pub deviation: f32,
}

/// 1 in the units of a heading.
pub const ONE: i16 = 1 << 14;

/// The junction deviation along `unit`. Cost: 150 where all axes that move have the same, else
/// 1,000 + 900 for each axis that moves.
pub fn deviation(unit: &PerAxis<i16>, dynamics: &Dynamics) -> f32 {
    let mut same = None;
    for (&u, axis) in unit.iter().zip(&dynamics.axes) {
        if u != 0 && *same.get_or_insert(axis.deviation) != axis.deviation {
            return mean_deviation(unit, dynamics);
        }
    }
    same.unwrap_or_default().get()
}

#[inline(never)]
#[small]
fn mean_deviation(unit: &PerAxis<i16>, dynamics: &Dynamics) -> f32 {
    let (mut norm, mut sum) = (0.0, 0.0);
    for (&u, axis) in unit.iter().zip(&dynamics.axes) {
        if u != 0 {
            let u = f32::from(u);
            let part = u * axis.deviation.get();
            norm += u * u;
            sum += part * part;
        }
    }
    if some(norm) { sqrt(sum / norm) } else { 0.0 }
}

/// The highest velocity from heading `a` into heading `b`, mm/s, with the junction `acceleration`,
/// mm/s^2: 0 for a reversal, [`f32::MAX`] straight on, or where it is above `most`.
///
/// The axes' velocities change by `(b.unit - a.unit) * velocity`, also where the two paths are
/// measured differently (linear, rotary, both), so that it is this difference that counts.
///
/// Cost: 350 + 50 for each axis that moves where the corner is plainly no limit, else 800 more; 1,600
/// more for one below `most`.
#[inline(never)]
pub fn limit(a: &Heading, b: &Heading, acceleration: f32, most: f32) -> f32 {
    let sum = turn(&a.unit, &b.unit);
    if sum < STRAIGHT {
        return f32::MAX;
    }
    let same = a.deviation.to_bits() == b.deviation.to_bits();
    // Far below what limits: 4 product > sum most^2, with an octave for the logarithms' error.
    let plain = |sum: i32| {
        let limit = log(a.deviation) + log(acceleration) + 2 * OCTAVE;
        sum + 2 * log(most) + OCTAVE < limit
    };
    if same && sum < 1 << 16 && plain(-12 * OCTAVE) {
        return f32::MAX;
    }
    // The square of twice the sine.
    let sum = scaled(sum as f32, -28);
    if same && below(sum, 1.44) && plain(log(sum)) {
        return f32::MAX;
    }
    let deviation = if same { a.deviation } else { mean(a.deviation, b.deviation) };
    arc(scaled(sum, -2), deviation * acceleration, most)
}

/// The square of the change of direction, in 2^-28.
#[inline(never)]
fn turn(a: &PerAxis<i16>, b: &PerAxis<i16>) -> u32 {
    // |b - a| = 2 sin(angle / 2): precise for small angles, which 1 - cos(angle) is not.
    let mut sum = 0u32;
    for (from, to) in a.iter().zip(b) {
        let change = to.abs_diff(*from);
        if change != 0 {
            // At most 8 in 2^-28: each of the two, linear and rotary, up to 2 long.
            sum = sum.wrapping_add(product(change, change));
        }
    }
    sum
}

/// Not inlined: or it would be worked out where it is not asked for.
#[inline(never)]
fn mean(a: f32, b: f32) -> f32 {
    0.5 * (a + b)
}

/// The velocity on the arc, from the square of the sine of half the angle and the product of deviation
/// and acceleration.
#[inline(never)]
fn arc(sine: f32, product: f32, most: f32) -> f32 {
    // Up to 75 degrees the factor of the cosine below is above 1.
    if below(sine, 0.36) && below(sine * most * most, product) {
        return f32::MAX;
    }
    if below(REVERSED, sine) {
        return 0.0;
    }
    // Radius = deviation * c / (1 - c) with c = cos(angle / 2).
    let cosine = sqrt(1.0 - sine);
    sqrt(product * cosine * (1.0 + cosine) / sine)
}
