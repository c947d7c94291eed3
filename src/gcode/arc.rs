//! Arcs: approximates an arc by chords.
//!
//! A [`Walk`] rotates the *spoke*, the vector from the centre to the start, by an angle that grows evenly, and adds the
//! centre. The angle is a binary fraction of a turn in a `u32`, so whole turns wrap and nothing drifts. Sine and cosine
//! are evaluated anew for every chord, so errors do not accumulate along the arc. A point is within 1 um of the circle
//! up to a radius of a few metres, and the last point is the target itself. All other axes advance evenly. Each point
//! is computed from the start, so errors do not accumulate there either.
//!
//! If the radius at the end differs from the radius at the start, within the tolerance of the interpreter, the radius
//! changes evenly along the arc.
//!
//! Each chord lies partly inside and partly outside the arc, so that the mean distance of the path from the centre is
//! the radius. For this all chord ends except the first and the last are outside the arc by two thirds of the sagitta.
//! A chord may then have a sagitta of 1.44 times the tolerance. The first chord sets this limit, because its start is
//! on the arc.
//!
//! Cost on AVR: [`Extent::of`] and [`Walk::new`] 14,000 cycles; a chord 8,700, and 600 for each other axis that moves.

use core::f32::consts::TAU;

use kerf_macros::small;

use super::command::Arc;
use crate::math;
use crate::units::{Length, PerAxis};

/// The least length of a chord: 0.02 mm, in units.
const MIN_CHORD: f32 = 200.0;
/// A change of radius up to this (0.2 um) is left to the last chord.
const SAME_RADIUS: f32 = 2.0;
/// The number of binary fractions in a turn, 2^32.
const TURN: f32 = 4_294_967_296.0;
/// The sagitta of a chord, as a multiple of its deviation from the arc.
const SAGITTA: f32 = 1.44;

/// The progress along the chords of an arc. The arc and its target are not part of it and are passed to each call. See
/// also [`Chords`].
#[derive(Clone, Copy, Debug)]
pub struct Walk {
    start: PerAxis<Length>,
    /// The vector from the centre to the start, moved outwards by two thirds of the sagitta.
    spoke: [f32; 2],
    /// The growth of the radius along the whole arc, as a part of the radius at the start.
    growth: f32,
    /// The angle by which the spoke has turned, in binary fractions of a turn.
    angle: u32,
    /// The angle of one chord, in binary fractions of a turn.
    step: u32,
    /// The number of chords that are done.
    done: u32,
    /// The number of all chords.
    count: u32,
    /// The part of the arc that one chord spans.
    part: f32,
}

/// The size of an arc. All lengths are in units.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// The angle from start to end, as a part of a turn, 0 to 1.
    part: f32,
    /// Radius at the start and at the end.
    radii: [f32; 2],
    /// Length of the arc in its plane.
    planar: f32,
    /// Length of the path: of the arc, or of the helix.
    length: f32,
}

impl Extent {
    /// Returns the extent of the arc from `start` to `target`.
    #[inline(never)]
    #[small]
    pub fn of(start: &PerAxis<Length>, target: &PerAxis<Length>, arc: &Arc) -> Self {
        let radii = [norm(spoke(start, arc)), norm(spoke(target, arc))];
        let part = part(start, target, arc);
        let planar = (part + f32::from(arc.extra_turns)) * TAU * (radii[0] + radii[1]) * 0.5;
        let length = norm([planar, way(start, target, arc.linear)]);
        Self { part, radii, planar, length }
    }

    /// Returns the length of the path, in mm.
    pub fn length(&self) -> f32 {
        self.length * 1e-4
    }

    /// Returns the least radius, in mm.
    pub fn radius(&self) -> f32 {
        self.radii[0].min(self.radii[1]) * 1e-4
    }

    /// Returns the ratio of the length of the path to its length in the plane, 1 or more.
    pub fn slope(&self) -> f32 {
        if self.planar > 0.0 { self.length / self.planar } else { 1.0 }
    }

    /// Returns the number of chords that keep within `tolerance` mm of the arc and are not longer than `longest` mm.
    ///
    /// A chord of sagitta s is 2 sqrt(s (2 r - s)) long. A chord is never longer than the radius, so that a full circle
    /// has at least seven chords with any tolerance.
    #[inline(never)]
    #[small]
    fn count(&self, tolerance: f32, longest: f32) -> u32 {
        const UNITS: f32 = Length::PER_MM as f32;
        let (radius, sagitta) = (self.radii[0].max(self.radii[1]), tolerance * (UNITS * SAGITTA));
        let chord = 2.0 * math::sqrt(sagitta * (2.0 * radius - sagitta));
        let chord =
            if sagitta < radius { chord.min(longest * UNITS).max(MIN_CHORD) } else { radius };
        let chord = chord.min(radius);
        // The cast saturates, and gives 0 for 0 / 0.
        let count = self.planar / chord;
        let whole = count as u32;
        let whole = if (whole as f32) < count { whole.saturating_add(1) } else { whole };
        // A single chord has both ends on the arc, so it deviates by all of its sagitta.
        let alone = whole == 1 && count * (SAGITTA * 0.84) > 1.0 && self.planar > MIN_CHORD;
        if alone { 2 } else { whole.clamp(1, i32::MAX as u32) }
    }
}

impl Walk {
    /// Returns the walk along the arc from `start`, which has this extent. The chords deviate from the arc by
    /// `tolerance` mm at most, and are not longer than `longest` mm.
    #[inline(never)]
    #[small]
    pub fn new(
        start: &PerAxis<Length>,
        arc: &Arc,
        extent: &Extent,
        tolerance: f32,
        longest: f32,
    ) -> Self {
        let count = extent.count(tolerance, longest);
        let [radius, end_radius] = extent.radii;
        let grows = (end_radius - radius).abs() > SAME_RADIUS && radius > 0.0;
        // A whole turn saturates to slightly less than a turn. The last chord makes up for it, because it ends at the
        // target.
        let turned = u64::from(arc.extra_turns) << 32 | u64::from((extent.part * TURN) as u32);
        let step = (turned / u64::from(count)) as u32;
        // Two thirds of the sagitta, which is r angle^2 / 8. The next term of the series matters from half a radian on.
        let angle = step as f32 * (TAU / TURN);
        let square = angle * angle;
        let outside = 1.0 + square * (1.0 / 12.0 + square * (1.0 / 240.0));
        Self {
            start: *start,
            spoke: spoke(start, arc).map(|component| component * outside),
            growth: if grows { end_radius / radius - 1.0 } else { 0.0 },
            angle: 0,
            step: if arc.clockwise { step.wrapping_neg() } else { step },
            done: 0,
            count,
            part: 1.0 / count as f32,
        }
    }

    /// Returns the end of the next chord. `None` after the last chord.
    pub fn next(&mut self, arc: &Arc, target: &PerAxis<Length>) -> Option<PerAxis<Length>> {
        if self.done >= self.count {
            return None;
        }
        self.done += 1;
        if self.done == self.count {
            return Some(*target);
        }
        self.angle = self.angle.wrapping_add(self.step);
        let done = self.done as f32 * self.part;
        let mut point = self.others(target, done);
        let axes = [arc.first, arc.second];
        for (axis, length) in axes.into_iter().zip(self.in_plane(arc, done)) {
            if let Some(at) = point.get_mut(usize::from(axis)) {
                *at = length;
            }
        }
        Some(point)
    }

    /// Returns a point with the coordinates of the axes outside the plane. `done` is the part of the arc that is done.
    fn others(&self, target: &PerAxis<Length>, done: f32) -> PerAxis<Length> {
        let mut point = self.start;
        for (at, target) in point.iter_mut().zip(target) {
            if at != target {
                let way = target.saturating_sub(*at).0;
                *at = at.saturating_add(Length(math::round(way as f32 * done)));
            }
        }
        point
    }

    /// Returns the two coordinates in the plane.
    fn in_plane(&self, arc: &Arc, done: f32) -> [Length; 2] {
        // The angle is taken as signed, because a float is more precise the smaller it is.
        let angle = self.angle as i32 as f32 * (TAU / TURN);
        let (sin, cos) = (math::sin(angle), math::cos(angle));
        let [x, y] = self.spoke;
        let mut offset = [x * cos - y * sin, x * sin + y * cos];
        if self.growth != 0.0 {
            let scale = 1.0 + self.growth * done;
            offset = offset.map(|component| component * scale);
        }
        let [first, second] = arc.center;
        [(first, offset[0]), (second, offset[1])]
            .map(|(center, offset)| center.saturating_add(Length(math::round(offset))))
    }
}

/// The ends of the chords of an arc, in order; the last one is the target.
pub struct Chords<'a> {
    arc: &'a Arc,
    target: &'a PerAxis<Length>,
    length: f32,
    walk: Walk,
}

impl<'a> Chords<'a> {
    /// Returns the chords of the arc from `start` to `target`. They deviate from it by `tolerance` mm at most.
    pub fn new(
        start: &PerAxis<Length>,
        target: &'a PerAxis<Length>,
        arc: &'a Arc,
        tolerance: f32,
    ) -> Self {
        let extent = Extent::of(start, target, arc);
        let walk = Walk::new(start, arc, &extent, tolerance, f32::MAX);
        Self { arc, target, length: extent.length(), walk }
    }

    /// Returns the length of the whole path (arc, or helix), in mm.
    pub fn length(&self) -> f32 {
        self.length
    }

    /// Returns the number of all chords.
    pub fn total(&self) -> u32 {
        self.walk.count
    }
}

impl Iterator for Chords<'_> {
    type Item = PerAxis<Length>;

    fn next(&mut self) -> Option<PerAxis<Length>> {
        self.walk.next(self.arc, self.target)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = usize::try_from(self.walk.count - self.walk.done);
        (left.unwrap_or(usize::MAX), left.ok())
    }
}

/// Whether an arc ends in its plane where it began. It is then a full circle.
pub fn closes(start: &PerAxis<Length>, target: &PerAxis<Length>, arc: &Arc) -> bool {
    [arc.first, arc.second].iter().all(|axis| {
        let axis = usize::from(*axis);
        start.get(axis) == target.get(axis)
    })
}

/// Returns the vector from the centre to a point, in units.
pub(super) fn spoke(point: &PerAxis<Length>, arc: &Arc) -> [f32; 2] {
    let [first, second] = arc.center;
    [(arc.first, first), (arc.second, second)].map(|(axis, center)| {
        let at = point.get(usize::from(axis)).copied().unwrap_or_default();
        at.saturating_sub(center).0 as f32
    })
}

/// Returns the angle from start to end, as a part of a turn, 0 to 1. Further turns are not counted.
pub(super) fn part(start: &PerAxis<Length>, target: &PerAxis<Length>, arc: &Arc) -> f32 {
    if closes(start, target, arc) {
        return 1.0;
    }
    turned(spoke(start, arc), spoke(target, arc), arc.clockwise)
}

/// Returns the angle from one spoke to another in the direction of the arc, as a part of a turn, 0 to 1.
pub(super) fn turned(from: [f32; 2], to: [f32; 2], clockwise: bool) -> f32 {
    // Computed from the difference of the spokes, which is exact, so that short arcs of large radius keep their
    // precision.
    let cross = from[0] * (to[1] - from[1]) - from[1] * (to[0] - from[0]);
    let dot = from[0] * to[0] + from[1] * to[1];
    let angle = math::atan2(if clockwise { -cross } else { cross }, dot) * (1.0 / TAU);
    if angle > 0.0 { angle } else { angle + 1.0 }
}

/// Returns how far an axis goes, in units.
fn way(start: &PerAxis<Length>, target: &PerAxis<Length>, axis: u8) -> f32 {
    let at = |point: &PerAxis<Length>| point.get(usize::from(axis)).map_or(0.0, |at| at.0 as f32);
    at(target) - at(start)
}

pub(super) fn norm([x, y]: [f32; 2]) -> f32 {
    math::sqrt(x * x + y * y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const MM: i32 = Length::PER_MM;

    fn point(x: i32, y: i32, z: i32, a: i32) -> PerAxis<Length> {
        [x, y, z, a, 0, 0].map(Length)
    }

    fn xy(center: (i32, i32), clockwise: bool, extra_turns: u16) -> Arc {
        let center = [Length(center.0), Length(center.1)];
        Arc { first: 0, second: 1, linear: 2, center, clockwise, extra_turns }
    }

    #[test]
    fn a_quarter_with_helix_and_rotary_axis() {
        let (start, target) = (point(10 * MM, 0, 0, 0), point(0, 10 * MM, MM, 90 * MM));
        let arc = xy((0, 0), false, 0);
        let chords = Chords::new(&start, &target, &arc, 0.01);
        // A chord is 2 sqrt(0.0144 * 19.9856) = 1.073 mm of the 15.708.
        assert_eq!(chords.total(), 15);
        assert!((chords.length() - 15.7398).abs() < 1e-3);
        let points: Vec<_> = chords.collect();
        assert_eq!(points.len(), 15);
        assert_eq!(points[14], target);
        // This point is a third of the way along the arc, and 9.1 um outside: two thirds of the sagitta.
        assert_eq!(points[4][..2], [Length(86_682), Length(50_046)]);
        for (i, at) in points.iter().enumerate() {
            let even = (i as i32 + 1) * 60_000;
            assert!((at[3].0 - even).abs() <= 1 && (at[2].0 - even / 90).abs() <= 1, "{at:?}");
        }
    }

    #[test]
    fn the_other_way_round_is_three_quarters() {
        let (start, target) = (point(10 * MM, 0, 0, 0), point(0, 10 * MM, 0, 0));
        let arc = xy((0, 0), true, 0);
        let mut chords = Chords::new(&start, &target, &arc, 0.01);
        assert!((chords.length() - 47.1239).abs() < 1e-3);
        assert!(chords.next().unwrap()[1] < Length::ZERO);
        assert_eq!(chords.last(), Some(target));
    }

    #[test]
    fn turns() {
        let start = point(5 * MM, 5 * MM, 0, 0);
        for (extra, turns) in [(0, 1.0), (1, 2.0), (300, 301.0)] {
            let arc = xy((0, 5 * MM), true, extra);
            let chords = Chords::new(&start, &start, &arc, 0.01);
            assert!((chords.length() / (turns * 31.415_926) - 1.0).abs() < 1e-6, "{extra}");
            let points: Vec<_> = chords.collect();
            let crossings = points.windows(2).filter(|w| w[0][1].0 > 50_000 && w[1][1].0 <= 50_000);
            assert_eq!(crossings.count() as f32, turns, "{extra}");
        }
    }

    /// Coarse chords of 0.86 rad have the right mean distance from the centre too.
    #[test]
    fn the_mean_distance_of_coarse_chords_is_the_radius() {
        let (start, target) = (point(10_000, 0, 0, 0), point(4_395, -8_982, 0, 0));
        let arc = xy((0, 0), false, 0);
        let points: Vec<_> = Chords::new(&start, &target, &arc, 0.09).collect();
        assert_eq!(points.len(), 6);
        let chord = |part: f64| {
            let at = |i: usize| {
                let (from, to) = (f64::from(points[1][i].0), f64::from(points[2][i].0));
                from + (to - from) * part
            };
            at(0).hypot(at(1))
        };
        let mean = (0..1_000).map(|n| chord((f64::from(n) + 0.5) / 1_000.0)).sum::<f64>() / 1_000.0;
        assert!((mean - 10_000.0).abs() < 3.0, "{mean}");
    }

    #[test]
    fn degenerate_circles_end() {
        let start = point(1, 0, 0, 0);
        let far = point(2_000_000_000, 0, 0, 0);
        for (start, target, tolerance) in
            [(start, start, 1.0), (start, far, 0.01), (far, far, 0.0), (far, start, f32::NAN)]
        {
            let mut chords = Chords::new(&start, &target, const { &ARC }, tolerance);
            chords.walk.count = chords.walk.count.min(100);
            assert_eq!(chords.last(), Some(target));
        }
        const ARC: Arc = Arc {
            first: 0,
            second: 1,
            linear: 2,
            center: [Length(1), Length(0)],
            clockwise: false,
            extra_turns: 0,
        };
    }
}
