//! The bed of a printer as a plane through three points. The plane gives the height of the bed at a place, so that
//! moves follow the bed.
//!
//! Pure code, kept beside the settings because the planner, reports and G29 all read it. Lengths are in machine
//! coordinates, as integers. Every caller gets one number for the height at a place, so nothing drifts when the
//! height is subtracted again.

use crate::capability::Capability;
use crate::math::round;
use crate::units::{Length, PerAxis};

/// The number of beds: 1 in an image with bed levelling, else 0.
pub const BEDS: usize = Capability::BedPlane.is_built_in() as usize;

/// A point of the bed: X, Y, and the Z at which the nozzle touches the bed.
pub type Point = [Length; 3];

/// The number of points that define the plane.
pub const POINTS: usize = 3;

/// The steepest slope allowed, along X and along Y: 1 in 20.
const STEEPEST: f32 = 0.05;
/// The largest coordinate of a point: 10 m.
const FAR: u32 = 100_000_000;
/// The least square of the triangle's longest side: that of 10 mm.
const LEAST: f32 = 100_000.0 * 100_000.0;
/// The least height of the triangle, as a fraction of its longest side.
const THINNEST: f32 = 1.0 / 16.0;

/// The index of the Z axis.
const Z: usize = 2;

/// Why a point is refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fault {
    /// The points are nearly on a line, or all within 10 mm.
    Line,
    /// The bed rises by more than 1 in 20.
    Steep,
    /// A coordinate of the point exceeds 10 m.
    Far,
    /// There are already three other points.
    Full,
}

/// The known points, and the plane through them.
#[derive(Clone, Copy, Debug)]
pub struct Bed {
    points: [Point; POINTS],
    count: u8,
    /// The slope of Z along X and along Y.
    slopes: [f32; 2],
    follows: bool,
}

#[small]
impl Bed {
    /// A bed without points.
    pub const NONE: Self =
        Self { points: [[Length::ZERO; 3]; POINTS], count: 0, slopes: [0.0; 2], follows: false };

    /// Returns the known points.
    pub fn points(&self) -> &[Point] {
        self.points.get(..self.count.into()).unwrap_or(&[])
    }

    /// Whether the plane is known.
    pub fn is_known(&self) -> bool {
        usize::from(self.count) == POINTS
    }

    /// Whether moves follow the plane.
    pub fn follows(&self) -> bool {
        self.follows
    }

    /// Sets whether moves follow the plane. They only follow a plane that is known. Called by the planner only,
    /// because the machine position that belongs to a motor position changes with it.
    pub fn follow(&mut self, follows: bool) {
        self.follows = follows && self.is_known();
    }

    /// Forgets the points. To be called only while moves do not follow the plane.
    pub fn forget(&mut self) {
        self.count = 0;
    }

    /// Shifts the points when the machine position `from` is redefined as `to`, as by G28.3. While moves follow the
    /// plane, Z of the points stays.
    #[inline(never)]
    pub fn rename(&mut self, from: &PerAxis<Length>, to: &PerAxis<Length>) {
        for (axis, (from, to)) in from.iter().zip(to).enumerate() {
            if axis == Z && self.follows {
                continue;
            }
            for point in &mut self.points {
                if let Some(at) = point.get_mut(axis) {
                    *at = at.saturating_add(to.saturating_sub(*from));
                }
            }
        }
    }

    /// Adds a point. It replaces a point at the same X and Y. The third point makes the plane known. A fault changes
    /// nothing. Cost on AVR: 8,000 cycles with the third point.
    #[inline(never)]
    pub fn add(&mut self, point: Point) -> Result<(), Fault> {
        if point.iter().any(|at| at.0.unsigned_abs() > FAR) {
            return Err(Fault::Far);
        }
        let is_here =
            |other: &Point| other.first() == point.first() && other.get(1) == point.get(1);
        let at = self.points().iter().position(is_here).unwrap_or(self.count.into());
        let mut points = self.points;
        *points.get_mut(at).ok_or(Fault::Full)? = point;
        let count = self.points().len().max(at + 1);
        if count == POINTS {
            self.slopes = slopes(&points)?;
        }
        (self.points, self.count) = (points, count as u8);
        Ok(())
    }

    /// Returns the height of the bed at a place, which is added to Z. An `f32` has 24 bits, so single units of a length
    /// are lost where the bed rises by more than 800 mm.
    #[inline(never)]
    fn lift(&self, x: Length, y: Length) -> Length {
        let [[from_x, from_y, z], ..] = self.points;
        let [along_x, along_y] = self.slopes;
        let rise = along_x * between(from_x, x) + along_y * between(from_y, y);
        z.saturating_add(Length(round(rise)))
    }

    /// Converts machine coordinates to the position of the motors. Cost on AVR: 2,000 cycles.
    #[inline(never)]
    pub fn lifted(&self, at: &PerAxis<Length>) -> PerAxis<Length> {
        let mut lifted = *at;
        let [x, y, z, ..] = &mut lifted;
        *z = self.lifted_z(*x, *y, *z);
        lifted
    }

    /// Converts Z in machine coordinates to Z of the motors, at a place. Cost: that of [`Self::lifted`].
    #[inline(never)]
    pub fn lifted_z(&self, x: Length, y: Length, z: Length) -> Length {
        z.saturating_add(self.lift(x, y))
    }

    /// Converts Z of the motors to Z in machine coordinates, at a place. The exact inverse of [`Self::lifted_z`].
    /// Cost: that of [`Self::lifted`].
    #[inline(never)]
    pub fn lowered_z(&self, x: Length, y: Length, z: Length) -> Length {
        z.saturating_sub(self.lift(x, y))
    }
}

/// A vector from one point to another.
type Way = [f32; 3];

/// Returns the distance between two positions of one axis.
#[inline(never)]
#[small]
fn between(from: Length, to: Length) -> f32 {
    to.saturating_sub(from).0 as f32
}

/// Returns the vector between two points.
#[inline(never)]
#[small]
fn way(from: &Point, to: &Point) -> Way {
    let mut way = [0.0; 3];
    for ((way, from), to) in way.iter_mut().zip(from).zip(to) {
        *way = between(*from, *to);
    }
    way
}

/// Returns the square of a vector's length in the plane of X and Y.
#[inline(never)]
#[small]
fn square([x, y, _]: &Way) -> f32 {
    x * x + y * y
}

/// Returns `a * b - c * d`: the cross product of two vectors in a plane, which is twice the area of their triangle.
#[inline(never)]
#[small]
fn cross(a: f32, b: f32, c: f32, d: f32) -> f32 {
    a * b - c * d
}

/// Returns the slopes of the plane through the points, along X and along Y.
#[inline(never)]
#[small]
fn slopes([first, second, third]: &[Point; POINTS]) -> Result<[f32; 2], Fault> {
    let (u, v) = (way(first, second), way(first, third));
    let longest = square(&u).max(square(&v)).max(square(&way(second, third)));
    let ([ux, uy, uz], [vx, vy, vz]) = (u, v);
    // Twice the area of the triangle. The two other cross products, divided by it, are the slopes.
    let area = cross(ux, vy, uy, vx);
    if longest < LEAST || area.abs() < longest * THINNEST {
        return Err(Fault::Line);
    }
    let slopes = [cross(uz, vy, uy, vz) / area, cross(ux, vz, uz, vx) / area];
    if slopes.iter().any(|slope| slope.abs() > STEEPEST) {
        return Err(Fault::Steep);
    }
    Ok(slopes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point(x: i32, y: i32, z: i32) -> Point {
        [Length(x), Length(y), Length(z)]
    }

    fn bed(points: &[Point]) -> Result<Bed, Fault> {
        let mut bed = Bed::NONE;
        points.iter().try_for_each(|point| bed.add(*point))?;
        bed.follow(true);
        Ok(bed)
    }

    fn lift(bed: &Bed, x: i32, y: i32) -> i32 {
        bed.lifted(&[Length(x), Length(y), Length(0), Length(7), Length(8), Length(9)])[Z].0
    }

    #[test]
    fn a_plane_goes_through_its_points_and_is_straight_between_them() {
        let points = [point(0, 0, 0), point(1_000_000, 0, 10_000), point(0, 1_000_000, -20_000)];
        let bed = bed(&points).unwrap();
        assert_eq!(lift(&bed, 500_000, 0), 5_000);
        assert_eq!(lift(&bed, 1_000_000, 1_000_000), -10_000);
        assert_eq!(lift(&bed, -1_000_000, 0), -10_000);
    }

    #[test]
    fn a_point_takes_the_place_of_another_and_a_fault_changes_nothing() {
        let mut bed = Bed::NONE;
        assert_eq!(bed.add(point(0, 0, 0)), Ok(()));
        assert_eq!(bed.add(point(0, 0, 500)), Ok(()));
        assert_eq!(bed.points(), [point(0, 0, 500)]);
        bed.follow(true);
        assert!(!bed.follows() && !bed.is_known());
        assert_eq!(bed.add(point(1_000_000, 0, 500)), Ok(()));
        for (third, fault) in [
            (point(2_000_000, 0, 0), Fault::Line),
            (point(500_000, 30_000, 0), Fault::Line),
            (point(0, 1_000_000, 51_000), Fault::Steep),
            (point(0, 1_000_000, -51_000), Fault::Steep),
            (point(0, 100_000_001, 0), Fault::Far),
            (point(0, 0, i32::MIN), Fault::Far),
        ] {
            assert_eq!(bed.add(third), Err(fault), "{third:?}");
            assert_eq!(bed.points().len(), 2);
        }
        assert_eq!(bed.add(point(0, 1_000_000, 49_000)), Ok(()));
        assert_eq!(bed.add(point(1, 1, 0)), Err(Fault::Full));
        assert_eq!(bed.add(point(0, 1_000_000, 80_000)), Err(Fault::Steep));
        bed.follow(true);
        assert_eq!(lift(&bed, 0, 1_000_000), 49_000);
        bed.forget();
        assert!(bed.points().is_empty());
    }

    #[test]
    fn a_bed_stays_where_it_is_when_places_are_called_otherwise() {
        let points = [point(0, 0, 100), point(1_000_000, 0, 10_100), point(0, 1_000_000, 100)];
        let mut bed = bed(&points).unwrap();
        let (from, to) = ([0, 0, 50, 7, 0, 0].map(Length), [300_000, 0, 0, 9, 0, 0].map(Length));
        bed.rename(&from, &to);
        assert_eq!(lift(&bed, 300_000, 0), 100);
        bed.follow(false);
        bed.rename(&to, &from);
        assert_eq!(bed.points(), points.map(|[x, y, z]| [x, y, Length(z.0 + 50)]));
    }

    #[test]
    fn points_near_each_other_are_no_plane() {
        let near = [point(0, 0, 0), point(50_000, 0, 0), point(0, 50_000, 0)];
        assert_eq!(bed(&near).err(), Some(Fault::Line));
        assert_eq!(bed(&near.map(|[x, y, z]| [Length(x.0 * 2), Length(y.0 * 2), z])).err(), None);
    }

    fn anywhere() -> impl Strategy<Value = Point> {
        let axis = || -(FAR as i32)..=FAR as i32;
        (axis(), axis(), -3_000_000..3_000_000).prop_map(|(x, y, z)| point(x, y, z))
    }

    fn within(mm: i32) -> impl Strategy<Value = Point> {
        let axis = -mm * 10_000..=mm * 10_000;
        (axis.clone(), axis, -30_000..30_000).prop_map(|(x, y, z)| point(x, y, z))
    }

    proptest! {
        /// Each point is on the plane, to 0.2 um; to 10 um at distances of metres.
        #[test]
        fn planes_go_through_their_points(
            near in prop::collection::vec(within(300), 3),
            far in prop::collection::vec(anywhere(), 3),
        ) {
            for (points, most) in [(near, 2), (far, 100)] {
                let Ok(bed) = bed(&points) else { continue };
                for [x, y, z] in points {
                    let off = lift(&bed, x.0, y.0) - z.0;
                    prop_assert!(off.abs() <= most, "{off}");
                }
            }
        }

        /// `lowered_z` restores what was lifted, at any place. X, Y and the other axes stay.
        #[test]
        fn what_is_lifted_is_lowered_exactly(
            points in prop::collection::vec(within(200), 3),
            at in prop::array::uniform6(any::<i32>()),
            z in -1_000_000_000..1_000_000_000,
        ) {
            let Ok(bed) = bed(&points) else { return Ok(()) };
            let mut at = at.map(Length);
            at[Z] = Length(z);
            let lifted = bed.lifted(&at);
            prop_assert_eq!(bed.lowered_z(at[0], at[1], lifted[Z]), at[Z]);
            prop_assert_eq!((lifted[0], lifted[1], lifted[3]), (at[0], at[1], at[3]));
        }

        /// The middle of a straight move is lifted by the mean of its ends, so moves stay straight.
        #[test]
        fn straight_ways_stay_straight(
            points in prop::collection::vec(within(200), 3),
            from in within(200),
            to in within(200),
        ) {
            let Ok(bed) = bed(&points) else { return Ok(()) };
            let middle = |axis: usize| (from[axis].0 + to[axis].0) / 2;
            let mean = (lift(&bed, from[0].0, from[1].0) + lift(&bed, to[0].0, to[1].0)) / 2;
            prop_assert!((lift(&bed, middle(0), middle(1)) - mean).abs() <= 2);
        }

        /// Any three points are either taken or refused, without a panic.
        #[test]
        fn no_point_panics(
            points in prop::array::uniform3(prop::array::uniform3(any::<i32>())),
            x: i32,
            y: i32,
        ) {
            if let Ok(bed) = bed(&points.map(|at| at.map(Length))) {
                lift(&bed, x, y);
            }
        }
    }
}
