//! The velocity limit of a curve, from the acceleration and jerk limits of its axes.
//!
//! On a curve of radius r the path turns with an acceleration of v^2 / r, which changes with a jerk of v^3 / r^2. The
//! radius of an arc is known ([`Curve`]). That of a curve of short lines is found from the changes of direction
//! ([`Bend`]). The junction deviation does not cover such lines: it is valid for a corner between lines that are long
//! enough.
//!
//! Called by the planner and its line builder. Units: mm, s. Costs are AVR cycles.

use kerf_macros::small;

use super::dynamics::{Axis, Dynamics};
use super::float::{cube_root, greater, least, some};
use super::junction::{Heading, ONE, turn};
use super::limits::Slowest;
use super::path::Path;
use super::short::{Log, OCTAVE, Short};
use crate::hal::SHORT_SHARE;
use crate::hal::arithmetic::product;
use crate::math::sqrt;
use crate::units::FIRST_ROTARY;

/// The share of the acceleration that turning on an arc may take.
const TURNING: f32 = 0.75;
/// The share that turning and slowing down may take together: on an arc they are at right angles. The remainder is for
/// the corners between chords, at which the path turns at once.
const BOTH: f32 = 0.95;
/// A corner between two chords changes the velocity by no more than the acceleration does in this time, s.
const CORNER_S: f32 = 0.01;
/// How far rounding moves a position, as a logarithm: 0.5 um, in 2^-14 mm.
const NOISE: Log = Log(3 * OCTAVE);
/// A curve is certain if it turns by this many times as much as rounding of positions may turn a path, as a logarithm.
const PLAIN: i16 = 7 * OCTAVE / 2;
/// More than the error of the logarithm of a velocity.
const SPARE: i16 = 8;
/// The share of the jerk that rounding a velocity up may take, as a logarithm: a tenth.
const JERK_SPARE: i16 = 39;
/// The least radius of an arc, mm.
const RADIUS_LEAST: f32 = 1e-3;
/// Changes of direction below this count as none, as in `junction`. In 2^-14.
const STRAIGHT: u16 = 31;
/// How many corners in a row must be like the one before them until a further one is slowed down. Rounding of positions
/// makes few such rows.
const CORNERS: u8 = 1;
/// Changes of direction beyond this, some 40 degrees, do not belong to a curve. In 2^-14.
const CORNER: u16 = 11_000;

/// Whether an arc is no faster than the slower of its axes: its velocity is even. Otherwise chords that are parallel to
/// no axis are faster, where the feed is beyond what an axis can do. Small chips have no room for this, and no such
/// feeds.
const EVEN: bool = SHORT_SHARE == 1.0;

/// The limits of an arc.
#[derive(Clone, Copy, Debug)]
pub struct Curve {
    /// Highest velocity on the path, mm/s.
    velocity: f32,
    /// Highest acceleration along the path; 0 for what axes allow.
    accel: Short,
    /// Whether a chord of the arc has been made: the next one follows without a corner.
    pub(super) goes_on: bool,
}

impl Curve {
    /// Returns the limits of an arc, and the longest length of its chords, mm. The arc has this radius in the plane of
    /// `axes`, and a `feed` in mm/min. `slope` is the length of its path over its length in the plane, more than 1 for
    /// a helix.
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
        let mut curve = Self { velocity: f32::MAX, accel: Short::ZERO, goes_on: false };
        for axis in axes {
            if let Some(axis) = dynamics.axes.get(usize::from(axis)) {
                slowest.look(ONE as u16, axis.accel, axis.jerk);
                if EVEN && some(axis.feed) {
                    curve.velocity = least(curve.velocity, axis.feed);
                }
            }
        }
        let (accel, jerk) = (slowest.least.get(), slowest.jerk.get());
        let radius = greater(radius, RADIUS_LEAST);
        let mut longest = f32::MAX;
        if some(jerk) {
            curve.velocity = least(curve.velocity, cube_root(jerk * radius * radius));
        }
        if some(accel) {
            curve.velocity = least(curve.velocity, sqrt(TURNING * accel * radius));
            let feed = feed * (1.0 / 60.0);
            // An override may double the feed.
            let top = least(curve.velocity, feed + feed);
            let turns = top * top / radius;
            let both = BOTH * accel;
            curve.accel = Short::new(sqrt(both * both - turns * turns));
            // At a corner the velocity then changes by what the turning acceleration does in [`CORNER_S`].
            longest = CORNER_S * TURNING * accel * radius / least(curve.velocity, feed);
        }
        // The radius of curvature of a helix is that of its arc times the square of the slope.
        curve.velocity *= slope;
        (curve, longest)
    }

    /// Notes that a chord has been made.
    pub fn go_on(&mut self) {
        self.goes_on = true;
    }
}

/// The change of direction at the last corner.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bend {
    /// The change of direction of each axis, in 2^-14.
    turned: [i16; FIRST_ROTARY],
    /// Length of the last line and of the line before it, mm.
    last: Short,
    before: Short,
    /// How many corners in a row were like the one before them, up to [`CORNERS`].
    corners: u8,
}

impl Bend {
    /// Continues with a chord of an arc, which gets the limits of the arc.
    #[inline(never)]
    pub(super) fn chord(&mut self, path: &mut Path, curve: &Curve) {
        *self = Self { last: Short::new(path.length), ..Self::default() };
        let (mut velocity, mut accel) = (curve.velocity, curve.accel);
        if some(path.stretch) {
            // The limits of the arc are in mm, and the path of this chord is measured in degrees.
            velocity *= path.stretch;
            accel = Short::new(accel.get() * path.stretch);
        }
        path.slow_down(velocity);
        if accel != Short::ZERO && accel < path.accel {
            path.accel = accel;
        }
    }

    /// Continues with a line, after one with heading `from`. Slows the line down if the last two corners are those of a
    /// curve with a lower velocity limit. Returns the result of [`turn`] for this corner.
    ///
    /// Cost: 400 at a corner that belongs to no curve, 800 on a curve that certainly sets no limit, else 1,000 to
    /// 1,400.
    #[inline(never)]
    pub(super) fn line(&mut self, from: &Heading, path: &mut Path, dynamics: &Dynamics) -> u32 {
        let (last, before) = (self.last, self.before);
        self.last = Short::new(path.length);
        self.before = last;
        let (mut most, mut sum, mut difference, mut halves) = (0, 0, 0, 0);
        let mut square = 0u32;
        let mut both = [0; FIRST_ROTARY];
        let ends = from.unit.iter().zip(&path.heading.unit);
        for ((turned, both), (a, b)) in self.turned.iter_mut().zip(&mut both).zip(ends) {
            let turns = b.wrapping_sub(*a);
            let before = core::mem::replace(turned, turns);
            if turns | before != 0 {
                let size = turns.unsigned_abs();
                square = square.wrapping_add(product(size, size));
                *both = turns.wrapping_add(before).unsigned_abs();
                most = size.max(most);
                sum = (*both).max(sum);
                halves = (*both / 2).wrapping_add(halves);
                difference = turns.wrapping_sub(before).unsigned_abs().max(difference);
            }
        }
        let (_, from) = from.unit.split_at(FIRST_ROTARY);
        if path.moved >> FIRST_ROTARY != 0 || from.iter().any(|u| *u != 0) {
            let (_, to) = path.heading.unit.split_at(FIRST_ROTARY);
            square = square.wrapping_add(turn(from, to));
        }
        if self.is_curve(most, sum, difference)
            && let Some(span) = span(before, last, self.last)
        {
            path.keep_to_bend(&mut both, sum / 2 + halves, span, dynamics);
        }
        square
    }

    /// Whether the last corners are those of a curve. `most` is the greatest change of direction of an axis, `sum`
    /// that of two corners together, and `difference` the greatest by which the two corners differ.
    #[inline(always)]
    fn is_curve(&mut self, most: u16, sum: u16, difference: u16) -> bool {
        if !(STRAIGHT..=CORNER).contains(&most) {
            self.turned = [0; FIRST_ROTARY];
            self.corners = 0;
            return false;
        }
        // On a curve both corners turn in one direction, and neither turns more than three times as much as the other.
        if difference > sum / 2 {
            self.corners = 0;
            return false;
        }
        let follows = self.corners >= CORNERS;
        if !follows {
            self.corners += 1;
        }
        follows
    }
}

/// Returns the length of a line plus half of both neighbouring lines, mm. `None` if the line is short compared with
/// them, as a chamfer between long lines is, or the end of a long line. Cost: 150.
#[inline(never)]
fn span(before: Short, line: Short, after: Short) -> Option<Log> {
    let (mantissa, power) = line.parts();
    let mantissa = u16::from(mantissa) | 0x100;
    let mut twice = 2 * mantissa;
    for around in [before, after] {
        let (part, of) = around.parts();
        let mut part = u16::from(part) | 0x100;
        let mut shift = of.wrapping_sub(power) as i8;
        if shift > 3 {
            return None;
        }
        while shift > 0 {
            part <<= 1;
            shift -= 1;
        }
        while shift < 0 && part != 0 {
            part >>= 1;
            shift += 1;
        }
        twice += part;
    }
    let octaves = (i16::from(power) - 127 - 9 - 4) * OCTAVE;
    (twice <= 8 * mantissa).then(|| Log(Log::of(twice << 4).0 + octaves))
}

/// Returns the largest change of direction within `span` mm that rounding positions to three decimals may cause, in
/// 2^-14. Cost: 100.
#[inline(never)]
fn noise(span: Log) -> u16 {
    let (mantissa, power) = Log(NOISE.0 - span.0).power().parts();
    let mut noise = u16::from(mantissa) | 0x100;
    let mut shift = power.wrapping_sub(127 + 8) as i8;
    while shift < 0 && noise != 0 {
        noise >>= 1;
        shift += 1;
    }
    while shift > 0 && noise < ONE as u16 {
        noise <<= 1;
        shift -= 1;
    }
    noise
}

/// Returns a third of a logarithm, which is at least that of 2^-48. Cost: 40.
fn third(log: i16) -> i16 {
    const UP: u16 = 3 << 12;
    (product((log as u16).wrapping_add(UP), 0x5556) >> 16) as i16 - UP as i16 / 3
}

/// The limits of the axes that take part in a curve: the least jerk, and the acceleration, which is equal for all axes
/// unless `mixed`.
#[derive(Default)]
struct Sharp {
    accel: Short,
    jerk: Short,
    mixed: bool,
}

impl Sharp {
    #[inline(always)]
    fn look(&mut self, axis: &Axis) {
        if self.accel == Short::ZERO {
            self.accel = axis.accel;
        } else if axis.accel != self.accel {
            self.mixed = true;
        }
        if axis.jerk != Short::ZERO && (self.jerk == Short::ZERO || axis.jerk < self.jerk) {
            self.jerk = axis.jerk;
        }
    }
}

/// Returns the acceleration limit of the curve where axes have different limits. The curve keeps turning, so each axis
/// will take part in it as much as the one that does most now.
#[inline(never)]
#[small]
fn acceleration(both: &[u16; FIRST_ROTARY], dynamics: &Dynamics) -> Log {
    let most = both.iter().fold(0, |most, size| most.max(*size));
    let mut least = i16::MAX;
    for (&size, axis) in both.iter().zip(&dynamics.axes) {
        // An axis that hardly takes part does not count.
        if size >= STRAIGHT && axis.accel != Short::ZERO {
            let along = axis.accel.log().0 + Log::of(most).0 - Log::of(size).0;
            least = least.min(along);
        }
    }
    Log(least)
}

/// Returns the curvature of a path whose direction changes by `both`, in 2^-14, within `span` mm: its logarithm.
#[inline(always)]
fn curvature(both: Log, span: Log) -> i16 {
    both.0 - 14 * OCTAVE - span.0
}

/// Returns the velocity limit of a path of this curvature for an acceleration, v^2 / r, and a jerk, v^3 / r^2; 0 stands
/// for no limit. The curvature and the result are logarithms.
#[inline(never)]
fn fastest(curvature: i16, accel: Short, jerk: Short) -> i16 {
    let mut velocity = i16::MAX;
    if accel != Short::ZERO {
        velocity = (accel.log().0 - curvature) / 2;
    }
    if jerk != Short::ZERO {
        velocity = velocity.min(third(jerk.log().0 - JERK_SPARE - 2 * curvature));
    }
    velocity
}

/// Rounds a velocity to one of eight values in an octave: 2 % up or 6 % down. So the lines of a curve have equal
/// velocities in spite of rounding errors.
#[inline(always)]
fn even(velocity: i16) -> i16 {
    (velocity + OCTAVE / 32) & !(OCTAVE / 8 - 1)
}

impl Path {
    /// Applies the limits of the axes on a path whose direction changes by `both`, in 2^-14, within `span` mm. `length`
    /// is an upper bound of the length of `both`. Velocities above the feed, which only an override uses, may be up to
    /// a quarter too low.
    #[inline(never)]
    fn keep_to_bend(
        &mut self,
        both: &mut [u16; FIRST_ROTARY],
        length: u16,
        span: Log,
        dynamics: &Dynamics,
    ) {
        let length = Log::of(length);
        let limit = fastest(curvature(length, span), self.slowest.0, self.slowest.1);
        if limit >= Log::of_float(self.top).0 {
            return;
        }
        let is_plain = !self.mixed && length.0 + span.0 >= NOISE.0 + PLAIN;
        if is_plain && Log::of_float(self.cruise).0 < even(limit) - SPARE {
            self.top = Log(even(limit)).power().get();
        } else {
            self.bend(both, span, dynamics);
        }
    }

    /// Applies the limits of the axes on a path whose direction changes by `both`, in 2^-14, within `span` mm.
    #[inline(never)]
    fn bend(&mut self, both: &mut [u16; FIRST_ROTARY], span: Log, dynamics: &Dynamics) {
        let noise = noise(span);
        let mut squares = 0u32;
        let mut slowest = Sharp::default();
        for (size, axis) in both.iter_mut().zip(&dynamics.axes) {
            *size = size.saturating_sub(noise);
            if *size >= STRAIGHT {
                squares += product(*size, *size);
                slowest.look(axis);
            }
        }
        if squares == 0 {
            return;
        }
        let curvature = curvature(Log(Log::of_wide(squares).0 / 2), span);
        let accel =
            if slowest.mixed { acceleration(both, dynamics).power() } else { slowest.accel };
        let velocity = fastest(curvature, accel, slowest.jerk);
        if velocity < Log::of_float(self.top).0 {
            self.slow_down(Log(even(velocity)).power().get());
        }
    }

    /// Limits the velocity of the path, mm/s.
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
            corner: Short::ZERO,
        };
        Dynamics { axes: [axis; 6], junction: accel, ..Dynamics::default() }
    }

    #[test]
    fn thirds() {
        for log in -48 * OCTAVE..=i16::MAX {
            assert!((3 * i32::from(third(log)) - i32::from(log)).abs() <= 3, "{log}");
        }
    }

    #[test]
    fn an_arc_on_which_a_rotary_axis_goes_farther_is_limited_in_degrees() {
        let curve = Curve { velocity: 20.0, accel: Short::new(64.0), goes_on: false };
        let mut path = Path { length: 8.0, stretch: 4.0, ..Path::default() };
        (path.cruise, path.top, path.accel) = (500.0, 1_000.0, Short::new(1_000.0));
        Bend::default().chord(&mut path, &curve);
        assert_eq!((path.cruise, path.top, path.accel.get()), (80.0, 80.0, 256.0));
    }

    proptest! {
        #[test]
        fn what_overrides_ask_for_on_a_bend_is_up_to_a_quarter_less(
            turns in [0u16..3_000, 0u16..3_000, 0u16..3_000],
            span in 0.02f32..20.0, accel in 20f32..5e3, jerk in prop_oneof![Just(0.0), 50f32..1e6],
        ) {
            let limits = dynamics(accel, jerk);
            let top_from = |cruise: f32| {
                let slowest = (Short::new(accel), Short::new(jerk));
                let mut path = Path { cruise, top: 1e6, slowest, ..Path::default() };
                let length = turns.iter().max().unwrap() / 2 + turns.iter().map(|turn| turn / 2).sum::<u16>();
                path.keep_to_bend(&mut turns.clone(), length, Short::new(span).log(), &limits);
                path.top
            };
            prop_assume!(turns.iter().max().unwrap() >= &STRAIGHT);
            let (rough, exact) = (top_from(1e-6), top_from(1e6));
            prop_assert!(rough > 0.75 * exact && rough < 1.1 * exact, "{rough} of {exact}");
        }

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
