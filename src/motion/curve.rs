//! How fast a curve may be taken, so that its axes keep to their acceleration and jerk.
//!
//! On a curve of radius r the path turns with an acceleration of v^2 / r, and that changes with a jerk of
//! v^3 / r^2. An arc's radius is known ([`Curve`]). Lines that are short against a curve tell it by how they turn
//! ([`Bend`]): what the junction deviation says holds for a corner with room enough around it.
//!
//! Called by the planner and its line builder. Units: mm, s. Costs are AVR cycles.

use kerf_macros::small;

use super::divide::{product, quotient, root};
use super::dynamics::Dynamics;
use super::float::{OCTAVE, below, cube_root, greater, least, log, scaled, some, whole};
use super::governor::effective_jerk;
use super::junction::{Heading, ONE};
use super::limits::{Slowest, over};
use super::path::Path;
use super::short::Short;
use crate::math::sqrt;
use crate::units::FIRST_ROTARY;

/// The part of the acceleration that turning on an arc may take; and with slowing down on the arc, which is at right
/// angles to it. The rest is for the corners of the chords, at which the path turns at once.
const TURNING: f32 = 0.75;
/// See [`TURNING`].
const BOTH: f32 = 0.95;
/// As [`TURNING`] under a jerk limit, where slowing down may take all of the acceleration.
const TURNING_JERK: f32 = 0.65;
/// A corner between two chords changes the velocity by no more than the acceleration does in this time, s.
const CORNER_S: f32 = 0.01;
/// 0.5 um, in 2^-14 mm.
const NOISE: f32 = 8.0;
/// No arc is smaller, mm.
const RADIUS_LEAST: f32 = 1e-3;
/// Changes of direction below this count as none, as in `junction`. In 2^-14.
const STRAIGHT: u16 = 31;
/// A curve has this many corners, each like the one before it, before the one that slows it down: rounding of
/// positions makes few such rows.
const CORNERS: u8 = 1;
/// Changes of direction beyond this, some 40 degrees, are no part of a curve. In 2^-14.
const CORNER: u16 = 11_000;

/// The limits of an arc.
#[derive(Clone, Copy, Debug)]
pub struct Curve {
    /// Highest velocity on the path, mm/s.
    velocity: f32,
    /// Highest acceleration along the path where there is no jerk limit; 0 for what axes allow.
    accel: Short,
}

impl Curve {
    /// The limits of an arc of this radius in the plane of `axes` at `feed`, mm/min, and how long its chords may be,
    /// mm. `slope` is the length of its path over that in the plane, more than 1 for a helix.
    ///
    /// Cost: 8,000.
    #[inline(never)]
    #[small]
    pub fn of(
        axes: [u8; 2],
        radius: f32,
        slope: f32,
        feed: f32,
        dynamics: &Dynamics,
    ) -> (Self, f32) {
        let mut slowest = Slowest::default();
        for axis in axes {
            if let Some(axis) = dynamics.axes.get(usize::from(axis)) {
                slowest.look_at(ONE as u16, axis.accel, axis.jerk);
            }
        }
        let (accel, jerk) = (slowest.least.get(), slowest.jerk.get());
        let radius = greater(radius, RADIUS_LEAST);
        let mut curve = Self { velocity: f32::MAX, accel: Short::ZERO };
        let mut longest = f32::MAX;
        if some(jerk) {
            curve.velocity = cube_root(jerk * radius * radius);
        }
        if some(accel) {
            let ramps = some(jerk) && some(effective_jerk(jerk, accel));
            let turning = if ramps { TURNING_JERK } else { TURNING };
            curve.velocity = least(curve.velocity, sqrt(turning * accel * radius));
            let feed = feed * (1.0 / 60.0);
            // An override may double it.
            let top = least(curve.velocity, feed + feed);
            let turns = top * top / radius;
            let both = BOTH * accel;
            curve.accel = Short::new(sqrt(both * both - turns * turns));
            longest = CORNER_S * accel * radius / least(curve.velocity, feed);
        }
        // The radius of curvature of a helix is that of its arc times the square of the slope.
        curve.velocity *= slope;
        (curve, longest)
    }
}

/// How the path turned at the last corner.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bend {
    /// The change of direction, in 2^-14.
    turned: [i16; FIRST_ROTARY],
    /// Length of the last line and of the one before, mm.
    last: Short,
    before: Short,
    /// How many corners in a row were like the one before them, up to [`CORNERS`].
    corners: u8,
}

impl Bend {
    /// The path goes on with a chord of an arc.
    #[inline(never)]
    pub(super) fn chord(&mut self, path: &mut Path, curve: &Curve) {
        *self = Self { last: Short::new(path.length), ..Self::default() };
        path.slow_down(curve.velocity);
        if path.jerk == Short::ZERO && curve.accel != Short::ZERO && curve.accel < path.accel {
            path.accel = curve.accel;
        }
    }

    /// The path goes on with a line, from heading `from`. Slows it down if the last two corners are those of a
    /// curve that cannot be taken as fast.
    ///
    /// Cost: 150 straight on, 1,000 on a curve that is plainly no limit, else 2,500, and 5,000 under a jerk limit.
    #[inline(never)]
    pub(super) fn line(&mut self, from: &Heading, path: &mut Path, dynamics: &Dynamics) {
        let (last, before) = (self.last, self.before);
        self.last = Short::new(path.length);
        self.before = last;
        let (mut most, mut sum, mut difference) = (0, 0, 0);
        let mut both = [0; FIRST_ROTARY];
        let ends = from.unit.iter().zip(&path.heading.unit);
        for ((turned, both), (a, b)) in self.turned.iter_mut().zip(&mut both).zip(ends) {
            let turns = b.wrapping_sub(*a);
            let before = core::mem::replace(turned, turns);
            if turns | before != 0 {
                *both = turns.wrapping_add(before).unsigned_abs();
                most = turns.unsigned_abs().max(most);
                sum = (*both).max(sum);
                difference = turns.wrapping_sub(before).unsigned_abs().max(difference);
            }
        }
        if !(STRAIGHT..=CORNER).contains(&most) {
            self.turned = [0; FIRST_ROTARY];
            self.corners = 0;
            return;
        }
        // The two turn the same way, and one no more than three times as much as the other.
        if difference > sum / 2 {
            self.corners = 0;
            return;
        }
        if self.corners < CORNERS {
            self.corners += 1;
            return;
        }
        let span = last.get() + scaled(before.get() + path.length, -1);
        // A chamfer between long lines, or the end of a long one.
        if below(scaled(last.get(), 2), span) {
            return;
        }
        let noise = noise(span);
        both = both.map(|size: u16| size.saturating_sub(noise));
        path.bend(&both, span, dynamics);
    }
}

/// How much of a change of direction within `span` mm may be what positions of three decimals have been rounded by,
/// in 2^-14. Cost: 400.
fn noise(span: f32) -> u16 {
    // The reciprocal, 12 % exact.
    let reciprocal = f32::from_bits(0x7EF3_11C7u32.wrapping_sub(span.to_bits()));
    // Never 2^16 or more: the shortest line is 1e-4 mm.
    whole(NOISE * reciprocal).min(ONE as u32) as u16
}

/// To the nearest of eight values in an octave, so that lines of a curve have one velocity in spite of what is rounded.
fn coarse(x: f32) -> f32 {
    f32::from_bits((x.to_bits() + (1 << 19)) & !0xF_FFFF)
}

impl Path {
    /// Keeps to what axes can on a path whose direction changes by `both`, in 2^-14, within `span` mm.
    #[inline(never)]
    fn bend(&mut self, both: &[u16; FIRST_ROTARY], span: f32, dynamics: &Dynamics) {
        let (mut squares, mut most) = (0u32, 0);
        for &size in both {
            squares += product(size, size);
            most = size.max(most);
        }
        if most == 0 {
            return;
        }
        // The square of the curvature, and its logarithm.
        let sum = squares as f32;
        let bent = log(sum) - 28 * OCTAVE - 2 * log(span);
        let (accel, jerk) = (self.slowest.0.get(), self.slowest.1.get());
        // Half an octave for the logarithms' error.
        let keeps = |top: f32, accel: f32, jerk: f32| {
            let top = log(top);
            (!some(accel) || 2 * top + bent / 2 + OCTAVE / 2 < log(accel))
                && (!some(jerk) || 3 * top + bent + OCTAVE / 2 < log(jerk))
        };
        if keeps(self.top, accel, jerk) {
            return;
        }
        let mut slowest = Slowest::default();
        for (&u, axis) in both.iter().zip(&dynamics.axes) {
            // An axis that hardly takes part does not count.
            if u >= STRAIGHT {
                slowest.look_at(u, axis.accel, axis.jerk);
            }
        }
        if slowest.accel != Short::ZERO {
            // The curve turns on: the axis will take part in it as much as the one that does most now.
            let unit = quotient(product(root(squares), slowest.unit), most);
            let square = over(slowest.accel, unit) * span;
            if below(square, self.top * self.top) {
                self.slow_down(coarse(sqrt(square)));
            }
        }
        let jerk = slowest.jerk.get();
        if !keeps(self.top, 0.0, jerk) {
            self.slow_down(coarse(cube_root(0.9 * jerk * span * span / scaled(sum, -28))));
        }
    }

    /// Keeps to a velocity, mm/s.
    fn slow_down(&mut self, velocity: f32) {
        self.top = least(self.top, velocity);
        self.cruise = least(self.cruise, self.top);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::dynamics::Axis;
    use proptest::prelude::*;

    fn dynamics(accel: f32, jerk: f32) -> Dynamics {
        let axis = Axis {
            velocity: 1e3,
            feed: 1e3,
            accel: Short::new(accel),
            jerk: Short::new(jerk),
            deviation: Short::new(0.01),
        };
        Dynamics { axes: [axis; 6], junction: accel, ..Dynamics::default() }
    }

    proptest! {
        #[test]
        fn arcs_keep_to_acceleration_and_jerk(
            radius in 0.2f32..30.0, accel in 20f32..5e3, jerk in prop_oneof![Just(0.0), 50f32..1e6],
            feed in 10f32..20_000.0, slope in 1f32..3.0,
        ) {
            let limits = dynamics(accel, jerk);
            let (curve, longest) = Curve::of([0, 1], radius, slope, feed, &limits);
            // In the plane, under any override.
            let v = curve.velocity.min(feed * slope / 30.0) / slope;
            prop_assert!(v * v / radius <= accel);
            prop_assert!(jerk == 0.0 || v.powi(3) / radius.powi(2) <= jerk * 1.0001);
            let along = curve.accel.get();
            prop_assert!(along > 0.5 * accel && along.hypot(v * v / radius) <= accel);
            let cruise = curve.velocity.min(feed / 60.0);
            prop_assert!(cruise * longest / radius <= accel * CORNER_S * slope * 1.0001);
        }
    }
}
