//! Cornering: how fast the corner between two straight moves may be taken.
//!
//! The corner is thought of as rounded by an arc that stays within the junction deviation of it; on
//! that arc the centripetal acceleration may be the junction acceleration (TinyG's and grbl's
//! method). The velocity itself is not rounded: at the corner each axis' velocity changes at once.
//!
//! Called by the line builder. Units: mm (degrees for rotary axes), s. Costs are AVR cycles.

use crate::math::sqrt;
use crate::units::PerAxis;

/// Squared sine of half a change of direction, about 0.1 degree, that counts as none: positions in
/// units of 0.1 um turn 0.1 mm segments of a straight line by as much.
const STRAIGHT: f32 = 1e-6;
/// Beyond this the direction is reversed, about 0.4 degree from it; rounding decides what is left.
const REVERSED: f32 = 1.0 - 1e-5;

/// The direction of a move.
#[derive(Clone, Copy, Debug, Default)]
pub struct Heading {
    /// How far each axis travels for a unit of the path. A unit vector but for moves of linear and
    /// rotary axes together, whose path is that of the linear ones: then it is longer.
    pub unit: PerAxis<f32>,
    /// Junction deviation in this direction.
    deviation: f32,
}

impl Heading {
    /// The heading along `unit` with the junction deviation of each axis. Cost: 900 + 750 for each
    /// axis that moves.
    pub fn new(unit: PerAxis<f32>, deviation: impl Fn(usize) -> f32) -> Self {
        let (mut norm, mut sum) = (0.0, 0.0);
        for (axis, &u) in unit.iter().enumerate() {
            if u != 0.0 {
                let part = u * deviation(axis);
                norm += u * u;
                sum += part * part;
            }
        }
        if norm > 1.001 {
            sum /= norm;
        }
        Heading { unit, deviation: sqrt(sum) }
    }
}

/// The highest velocity from heading `a` into heading `b`, mm/s, with the junction `acceleration`,
/// mm/s^2: 0 for a reversal, [`f32::MAX`] straight on.
///
/// The axes' velocities change by `(b.unit - a.unit) * velocity`, also where the two paths are
/// measured differently (linear, rotary, both), so that it is this difference that counts.
///
/// Cost: 2,300 + 430 for each axis that moves.
pub fn limit(a: &Heading, b: &Heading, acceleration: f32) -> f32 {
    // |b - a| = 2 sin(angle / 2): precise for small angles, which 1 - cos(angle) is not.
    let mut sine = 0.0;
    for (&from, &to) in a.unit.iter().zip(&b.unit) {
        if from != to {
            let change = 0.5 * (to - from);
            sine += change * change;
        }
    }
    if sine < STRAIGHT {
        return f32::MAX;
    }
    if sine > REVERSED {
        return 0.0;
    }
    // Radius = deviation * c / (1 - c) with c = cos(angle / 2).
    let cosine = sqrt(1.0 - sine);
    let deviation = 0.5 * (a.deviation + b.deviation);
    sqrt(deviation * acceleration * cosine * (1.0 + cosine) / sine)
}
