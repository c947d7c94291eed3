//! Checks that hold for the chords of any arc.

use kerf::gcode::arc::Chords;
use kerf::gcode::command::Arc;
use kerf::units::{Length, PerAxis};

/// Most chords that are checked: an arc may have thousands of millions.
const LOOKED_AT: u32 = 2_000;

/// Walks along an arc. Checks that chord ends lie on the circle or outside it within [`outside`], that their number is
/// that of [`Chords::total`], and that the last chord ends at the end of the arc.
pub fn check(start: &PerAxis<Length>, target: &PerAxis<Length>, arc: &Arc, tolerance: f32) {
    let chords = Chords::new(start, target, arc, tolerance);
    let total = chords.total();
    assert!(total > 0);
    assert!(chords.length() >= 0.0, "{} mm of {arc:?}", chords.length());
    let (inner, outer) = radii(start, target, arc);
    let outer = outer + outside(outer, tolerance);
    let fits = is_within_reach(outer, arc);
    let mut last = (0, *start);
    for (n, point) in (1..=LOOKED_AT).zip(chords) {
        let radius = radius(&point, arc);
        assert!(
            !fits || (inner..=outer).contains(&radius),
            "{radius} of {inner}..{outer} in {arc:?}"
        );
        last = (n, point);
    }
    assert_eq!(last.0, total.min(LOOKED_AT));
    assert!(last.0 < total || last.1 == *target, "{:?} is not the end {target:?}", last.1);
}

/// Returns the range of the radius of chord ends, without [`outside`]: 0.1 um units, with 2 um and a millionth allowed
/// for errors of floats.
fn radii(start: &PerAxis<Length>, target: &PerAxis<Length>, arc: &Arc) -> (f64, f64) {
    let (from, to) = (radius(start, arc), radius(target, arc));
    let (inner, outer) = (from.min(to), from.max(to));
    let slack = 20.0 + outer * 1e-6;
    (inner - slack, outer + slack)
}

/// Returns how far chord ends may lie outside a circle, in 0.1 um. They lie outside so that each chord deviates to both
/// sides of the circle. The result is a little more than two thirds of the sagitta, for chords of this tolerance (mm),
/// for the shortest chords of 0.02 mm, or for a seventh of a circle.
fn outside(radius: f64, tolerance: f32) -> f64 {
    let units = f64::from(tolerance) * f64::from(Length::PER_MM);
    units.max(200.0 * 200.0 / 8.0 / radius).min(0.1 * radius)
}

/// Whether the whole circle is within the range of lengths. Otherwise a part of it is cut off.
fn is_within_reach(outer: f64, arc: &Arc) -> bool {
    let reach = f64::from(i32::MAX);
    arc.center.iter().all(|center| f64::from(center.0).abs() + outer <= reach)
}

fn radius(point: &PerAxis<Length>, arc: &Arc) -> f64 {
    let [first, second] = arc.center;
    let way =
        |axis: u8, center: Length| f64::from(point[usize::from(axis)].0) - f64::from(center.0);
    way(arc.first, first).hypot(way(arc.second, second))
}
