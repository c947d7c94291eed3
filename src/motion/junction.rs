//! Cornering: how fast the corner between two straight moves may be taken.
//!
//! The velocity limit is that of an imaginary arc that rounds the corner within the junction deviation. On that arc the
//! centripetal acceleration is at most the junction acceleration (the method of TinyG and grbl). The path itself is not
//! rounded: at the corner the velocity of each axis changes at once. Where there are [means](super::smooth), these round
//! the corner, and no axis may jump by more than they turn into its acceleration limit ([`limit_axes`]).
//!
//! Called by the line builder. Units: mm (degrees for rotary axes), s. Costs are AVR cycles.

use kerf_macros::small;

use super::dynamics::Dynamics;
use super::float::{below, scaled, some};
use super::limits::over;
use super::short::{Log, OCTAVE, Short};
use crate::hal::arithmetic::product;
use crate::math::sqrt;
use crate::units::PerAxis;

/// The square of the largest change of direction that counts as none, in 2^-28. It is about 0.1 degree: rounding
/// positions to 0.1 um turns 0.1 mm segments of a straight line by as much.
pub(super) const STRAIGHT: u32 = 1000;
/// The square of the sine of half the angle from which on a corner counts as a reversal. It is about 0.4 degree from a
/// full reversal; closer angles are rounding errors.
const REVERSED: f32 = 1.0 - 1e-5;

/// The square of the largest change of direction for [`rough`], in 2^-28: some 30 degrees.
const WIDE: u32 = 1 << 26;
/// The constant of [`rough`]: the logarithm of the square of a corner's velocity, less the logarithms of deviation
/// and acceleration, plus the logarithm of the square of the change of direction in 2^-28. It takes `c (1 + c) = 1.9`
/// as at [`WIDE`], a quarter of the square, and the error of the logarithms into account.
const STRAIGHT_ON: i16 = 30 * OCTAVE + 238 - 27;

/// The logarithm of the units of a heading.
const UNIT_LOG: i16 = 14 * OCTAVE;
/// More than the error of a comparison of sums of two logarithms.
const LOG_ERROR: i16 = OCTAVE / 4;

/// The direction of a move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Heading {
    /// Unit vector: the travel of each axis per unit of the path, in 2^-14, up to [`ONE`].
    pub unit: PerAxis<i16>,
    /// Junction deviation in this direction, mm.
    pub deviation: Short,
}

/// 1 in the units of a heading.
pub const ONE: i16 = 1 << 14;

/// Returns the junction deviation along `unit` where the axes' deviations differ. Cost: 1,000, and 900 for each axis
/// that moves.
#[inline(never)]
#[small]
pub(super) fn mean_deviation(unit: &PerAxis<i16>, dynamics: &Dynamics) -> Short {
    let (mut norm, mut sum) = (0.0, 0.0);
    for (&u, axis) in unit.iter().zip(&dynamics.axes) {
        if u != 0 {
            let u = f32::from(u);
            let part = u * axis.deviation.get();
            norm += u * u;
            sum += part * part;
        }
    }
    if some(norm) { Short::new(sqrt(sum / norm)) } else { Short::ZERO }
}

/// The velocity limits of the blocks on both sides of a corner, mm/s.
#[derive(Clone, Copy, Debug)]
pub struct Velocities {
    /// At 100 %, or less.
    pub cruise: f32,
    /// Under any override.
    pub top: f32,
}

/// Returns the highest velocity at a corner, mm/s. The path has [turned](turn) there by `turned` between lines of these
/// junction deviations; the junction `acceleration` is in mm/s^2. The result is 0 for a reversal, and [`f32::MAX`]
/// where the path is straight or the velocity is above the top. A velocity above the cruise velocity, which matters
/// under an override only, is up to a tenth too low.
///
/// Cost: 300; 2,000 more for a corner that limits the cruise velocity.
#[inline(never)]
pub fn limit(
    turned: u32,
    (a, b): (Short, Short),
    acceleration: f32,
    velocities: &Velocities,
) -> f32 {
    if turned < STRAIGHT {
        return f32::MAX;
    }
    let same = a == b;
    if same && turned < WIDE {
        let rough = rough(turned, a, acceleration);
        if rough >= Short::above(velocities.top) {
            return f32::MAX;
        }
        if rough >= Short::above(velocities.cruise) {
            return rough.get();
        }
    }
    let deviation = if same { a.get() } else { mean(a.get(), b.get()) };
    // The square of the sine of half the angle.
    let sine = scaled(turned as f32, -30);
    arc(sine, deviation * acceleration, velocities.top)
}

/// Returns the velocity of a corner that is not [`WIDE`], up to a tenth too low, by logarithms: the result of [`arc`]
/// for a cosine of 1, less the error of that approximation. Cost: 170.
#[inline(never)]
fn rough(sum: u32, deviation: Short, acceleration: f32) -> Short {
    if deviation == Short::ZERO || !some(acceleration) {
        return Short::ZERO;
    }
    let product = deviation.log().0 + Log::of_float(acceleration).0;
    Log((product + STRAIGHT_ON - Log::of_wide(sum).0) / 2).power()
}

/// Returns `top`, or less if an axis would jump by more than [`Axis::corner`](super::dynamics::Axis::corner) at a corner
/// between these directions, mm/s. The path has [turned](turn) there by `turned`.
///
/// Cost: 60 where the path is straight or no axis could jump as far; 250 for each axis that may.
#[inline(never)]
pub fn limit_axes(
    (a, b): (&PerAxis<i16>, &PerAxis<i16>),
    turned: u32,
    dynamics: &Dynamics,
    top: f32,
) -> f32 {
    if turned < STRAIGHT || !some(top) {
        return top;
    }
    let most = Short::above(top);
    let fast = most.log().0;
    let mut limit = most;
    for ((from, to), axis) in a.iter().zip(b).zip(&dynamics.axes) {
        let change = to.abs_diff(*from);
        if change == 0 || axis.corner == Short::ZERO {
            continue;
        }
        // Logarithms mostly decide.
        if axis.corner.log().0 + UNIT_LOG < Log::of(change).0 + fast + LOG_ERROR {
            limit = limit.min(over(axis.corner, change));
        }
    }
    if limit < most { limit.get() } else { top }
}

/// Returns the square of the change of direction, in 2^-28. Cost: 60 + 30 for each axis whose direction changes.
///
/// The velocities of the axes change by `(b - a) * velocity`, also where the two paths are measured differently
/// (linear, rotary, both). So the result is the square of this difference.
#[inline(never)]
pub fn turn(a: &[i16], b: &[i16]) -> u32 {
    // |b - a| = 2 sin(angle / 2): precise for small angles, which 1 - cos(angle) is not.
    let mut sum = 0u32;
    for (from, to) in a.iter().zip(b) {
        let change = to.abs_diff(*from);
        if change != 0 {
            // At most 8, in 2^-28: the linear and the rotary part of the difference are each up to 2 long.
            sum = sum.wrapping_add(product(change, change));
        }
    }
    sum
}

/// Not inlined: otherwise the mean would be computed where it is not needed.
#[inline(never)]
fn mean(a: f32, b: f32) -> f32 {
    0.5 * (a + b)
}

/// Returns the velocity on the arc, from the square of the sine of half the angle and the product of deviation and
/// acceleration; [`f32::MAX`] if it is plainly above `most`.
#[inline(never)]
#[small]
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rough_corners_are_up_to_a_tenth_slower(
            angle in 0.002f64..0.5, start in 0f64..6.3, deviation in 1e-4f32..10.0, acceleration in 1f32..1e6,
        ) {
            let deviation = Short::new(deviation);
            let heading = |angle: f64| {
                let (y, x) = angle.sin_cos();
                let unit = [x, y, 0.0, 0.0, 0.0, 0.0].map(|u| (u * f64::from(ONE)).round() as i16);
                Heading { unit, deviation }
            };
            let (a, b) = (heading(start), heading(start + angle));
            let at = |cruise, top| {
                let velocities = Velocities { cruise, top };
                limit(turn(&a.unit, &b.unit), (a.deviation, b.deviation), acceleration, &velocities)
            };
            let exact = at(1e20, 1e20);
            prop_assume!(exact != f32::MAX);
            let rough = at(0.0, 1e20);
            prop_assert!(rough <= exact && rough > 0.9 * exact, "{rough} of {exact}");
            prop_assert!(at(0.0, 0.89 * exact) == f32::MAX);
            prop_assert!(at(exact, 1.01 * exact) == exact);
        }
    }
}
