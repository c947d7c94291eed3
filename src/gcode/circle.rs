//! G2 and G3: computes the circle that the words of a line describe, or refuses the line if they describe none.

use kerf_macros::small;

use super::arc;
use super::axes;
use super::block::Block;
use super::command::{Arc, Commands, Motion};
use super::decimal::Decimal;
use super::limits;
use super::modal::ArcDistance;
use super::setup::{AxisMode, Setup};
use super::state::State;
use super::words::{self, I, OFFSETS, P, R, bit, bit_of};
use crate::math;
use crate::status::Status;
use crate::units::{Length, PerAxis};

/// The smallest radius: 1 um, in units.
const MIN_RADIUS: i32 = 10;
/// The largest R: 150 m, which keeps its square in 64 bits.
const MAX_RADIUS: i32 = 1_500_000_000;
/// The radii at start and end may always differ by this much (5 um) ...
const SLACK: f32 = 50.0;
/// ... or by this part of the radius ...
const SLACK_PART: f32 = 0.001;
/// ... but never by more than this (1 mm).
const MAX_SLACK: f32 = 10_000.0;

/// Words that make a line an arc.
const ARC_WORDS: u32 = words::AXES | OFFSETS | bit(R) | bit(P);

impl State {
    /// Carries out G2 and G3.
    #[inline(never)]
    pub(super) fn arc(
        &mut self,
        block: &Block,
        clockwise: bool,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        if !block.has(ARC_WORDS) {
            return Ok(());
        }
        let feed = self.rate(block, false)?;
        let [first, second, linear] = self.modal.plane.axes();
        if [first, second].iter().any(|axis| setup.mode(*axis) == AxisMode::Disabled) {
            return Err(Status::AxisDisabled);
        }
        // Postprocessors write K0 with G17, which is harmless. Only an offset out of the plane is refused.
        if block.has(bit_of(I + linear)) && !block.get(I + linear).is_some_and(Decimal::is_zero) {
            return Err(Status::ArcSpecification);
        }
        let radius = self.radius(block, first, second)?;
        // The first turn is the arc itself, or the full circle.
        let extra_turns = turns(block)?.saturating_sub(1);
        let start = self.position;
        self.advance(block, false, setup)?;
        let target = self.position;
        if is_far(&start, &target) {
            return Err(Status::OutOfRange);
        }
        let center = [Length::ZERO; 2];
        let mut arc = Arc { first, second, linear, center, clockwise, extra_turns };
        arc.center = match radius {
            Some(radius) => radius_form(&start, &target, &arc, radius)?,
            None => self.center_form(block, &start, &target, &arc)?,
        };
        if may_be_too_far(&start, &arc) && !limits::arc_is_within(&start, &target, &arc, None) {
            return Err(Status::OutOfRange);
        }
        out.motion = Motion::Arc { target, feed, arc };
        Ok(())
    }

    /// Returns R in units; it is negative for the long way round. `None` without R.
    fn radius(&self, block: &Block, first: u8, second: u8) -> Result<Option<Length>, Status> {
        let Some(word) = block.get(R) else { return Ok(None) };
        if block.has(bit_of(I + first) | bit_of(I + second)) {
            return Err(Status::ArcSpecification);
        }
        if !block.has(bit_of(first) | bit_of(second)) {
            return Err(Status::ArcAxisMissing);
        }
        let radius = axes::length(word, self.modal.units)?.units;
        match radius.0.abs() {
            ..MIN_RADIUS => Err(Status::ArcRadiusTolerance),
            MIN_RADIUS..=MAX_RADIUS => Ok(Some(radius)),
            _ => Err(Status::OutOfRange),
        }
    }

    /// Returns the centre from I, J and K. They are measured from the start with G91.1, and from the work origin with
    /// G90.1. G90 and G91 do not matter.
    #[small]
    fn center_form(
        &self,
        block: &Block,
        start: &PerAxis<Length>,
        target: &PerAxis<Length>,
        arc: &Arc,
    ) -> Result<[Length; 2], Status> {
        let from = match self.modal.arc_distance {
            ArcDistance::Absolute => in_plane(&self.origin, arc),
            ArcDistance::Incremental => in_plane(start, arc),
        };
        let words = [arc.first, arc.second].map(|axis| block.get(I + axis));
        let missing = match self.modal.arc_distance {
            ArcDistance::Absolute => words.contains(&None),
            ArcDistance::Incremental => words == [None; 2],
        };
        if missing {
            return Err(Status::ArcOffsetsMissing);
        }
        let mut center = from;
        for (center, word) in center.iter_mut().zip(words) {
            if let Some(word) = word {
                *center = sum(*center, axes::length(word, self.modal.units)?.units.0)?;
            }
        }
        if center == in_plane(start, arc) {
            return Err(Status::ArcOffsetsMissing);
        }
        check_radii(&Arc { center, ..*arc }, start, target)?;
        Ok(center)
    }
}

/// Whether some point of the circle may be beyond the range of lengths. The test replaces the radius by the sum of its
/// components along the two axes, which is never smaller.
#[small]
fn may_be_too_far(start: &PerAxis<Length>, arc: &Arc) -> bool {
    let from = in_plane(start, arc);
    let way = |a: Length, b: Length| a.saturating_sub(b).0.saturating_abs();
    let [first, second] = arc.center;
    let radius = way(from[0], first).saturating_add(way(from[1], second));
    [first, second].iter().any(|at| at.0.saturating_abs().saturating_add(radius) == i32::MAX)
}

/// Whether some axis goes farther than a length can express. The advance of an axis along an arc is computed from this
/// distance.
#[inline(never)]
#[small]
fn is_far(start: &PerAxis<Length>, target: &PerAxis<Length>) -> bool {
    for (start, target) in start.iter().zip(target) {
        if target.checked_sub(*start).is_none() {
            return true;
        }
    }
    false
}

/// Returns P, the number of turns that are begun. 0 without P.
#[small]
fn turns(block: &Block) -> Result<u16, Status> {
    match block.get(P) {
        None => Ok(0),
        Some(Decimal { negative: true, .. }) => Err(Status::PWordNegative),
        Some(word) => {
            let turns = word.integer().ok().and_then(|turns| turns.try_into().ok());
            turns.ok_or(Status::PWordInvalid)
        }
    }
}

/// Refuses a centre from which start and end are not equally far. Also refuses a centre from which start and end,
/// although different points, lie in the same direction.
fn check_radii(arc: &Arc, start: &PerAxis<Length>, target: &PerAxis<Length>) -> Result<(), Status> {
    let [from, to] = [arc::spoke(start, arc), arc::spoke(target, arc)];
    let radius = math::sqrt(from[0] * from[0] + from[1] * from[1]);
    let error = (radius - math::sqrt(to[0] * to[0] + to[1] * to[1])).abs();
    if error > MAX_SLACK || (error > SLACK && error > SLACK_PART * radius) {
        return Err(Status::ArcSpecification);
    }
    let parallel = from[0] * to[1] == from[1] * to[0];
    let alike = from[0] * to[0] + from[1] * to[1] > 0.0;
    if parallel && alike && !arc::closes(start, target, arc) {
        return Err(Status::ArcEndpointIsStart);
    }
    Ok(())
}

/// Returns the centre from R. It lies on the perpendicular through the middle of the chord, at the distance
/// h = sqrt(r^2 - (chord / 2)^2).
///
/// The difference of squares is computed exactly, in 64 bits. Otherwise the centre of a half circle would be off by the
/// square root of a rounding error.
#[small]
fn radius_form(
    start: &PerAxis<Length>,
    target: &PerAxis<Length>,
    arc: &Arc,
    radius: Length,
) -> Result<[Length; 2], Status> {
    let (from, to) = (in_plane(start, arc), in_plane(target, arc));
    let chord = [difference(to[0], from[0])?, difference(to[1], from[1])?];
    if chord.iter().all(|way| *way == 0) {
        return Err(Status::ArcEndpointIsStart);
    }
    let square = |x: i32| i64::from(x) * i64::from(x);
    let chord_squared = square(chord[0]).saturating_add(square(chord[1]));
    let excess = 4 * square(radius.0) - chord_squared;
    // If half the chord is longer than R by up to 5 um and up to a twentieth of R, the arc is taken as a half circle.
    // At least one unit is tolerated, which is the rounding error of the ends.
    let size = radius.0.abs();
    let slack = (size / 20).clamp(1, SLACK as i32);
    if excess < -8 * i64::from(slack) * i64::from(size) {
        return Err(Status::ArcRadiusTolerance);
    }
    // 2 h / chord. For the short way counter-clockwise the centre lies to the left of the chord.
    let ratio = root(excess.max(0) as u64) / root(chord_squared as u64);
    let left = if arc.clockwise == (radius.0 < 0) { 0.5 } else { -0.5 };
    let across = |component: i32| math::round(component as f32 * ratio * left);
    let first = sum(from[0], chord[0] / 2).and_then(|middle| sum(middle, -across(chord[1])))?;
    let second = sum(from[1], chord[1] / 2).and_then(|middle| sum(middle, across(chord[0])))?;
    Ok([first, second])
}

/// Returns the square root of an integer of any size, with the precision of a float.
fn root(mut square: u64) -> f32 {
    let mut scale = 1.0;
    while square > u64::from(u32::MAX) {
        square >>= 8;
        scale *= 16.0;
    }
    math::sqrt(square as u32 as f32) * scale
}

/// Returns the two coordinates of a point in the plane of an arc.
#[inline(never)]
fn in_plane(point: &PerAxis<Length>, arc: &Arc) -> [Length; 2] {
    [arc.first, arc.second].map(|axis| point.get(usize::from(axis)).copied().unwrap_or_default())
}

fn sum(length: Length, units: i32) -> Result<Length, Status> {
    length.checked_add(Length(units)).ok_or(Status::OutOfRange)
}

fn difference(a: Length, b: Length) -> Result<i32, Status> {
    a.checked_sub(b).map(|difference| difference.0).ok_or(Status::OutOfRange)
}
