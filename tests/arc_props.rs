//! Properties of arcs: chords lie on their circle and follow its direction in every plane, ends are exact, turns are
//! counted, other axes advance evenly.

use std::f64::consts::{PI, TAU};

use kerf::gcode::Interpreter;
use kerf::gcode::arc::Chords;
use kerf::gcode::command::{Arc, Commands, Motion};
use kerf::gcode::setup::Usual;
use kerf::units::{Length, PerAxis};
use proptest::prelude::*;

/// A circle in one of the planes, as the numbers of an arc's line, in units of length.
#[derive(Clone, Copy, Debug)]
struct Case {
    plane: usize,
    clockwise: bool,
    center: [i32; 2],
    radius: f64,
    /// Angle of the start, in radians, counter-clockwise from the first axis.
    from: f64,
    /// Length of the arc, in radians, in its direction.
    sweep: f64,
    across: i32,
}

impl Case {
    fn axes(&self) -> [usize; 3] {
        [[0, 1, 2], [2, 0, 1], [1, 2, 0]][self.plane]
    }

    fn point(&self, angle: f64, across: i32) -> PerAxis<Length> {
        let mut point = [Length::ZERO; 6];
        let [first, second, linear] = self.axes();
        point[first] = Length(self.center[0] + (self.radius * angle.cos()).round() as i32);
        point[second] = Length(self.center[1] + (self.radius * angle.sin()).round() as i32);
        point[linear] = Length(across);
        point
    }

    fn arc(&self) -> Arc {
        let [first, second, linear] = self.axes().map(|axis| axis as u8);
        let (center, clockwise) = (self.center.map(Length), self.clockwise);
        Arc { first, second, linear, center, clockwise, extra_turns: 0 }
    }

    /// Returns how far points of a chord are outside the circle, in units of length.
    fn offsets(&self, from: &PerAxis<Length>, to: &PerAxis<Length>, radius: f64) -> Vec<f64> {
        let [first, second, _] = self.axes();
        let at = |axis: usize, n: usize, part: f64| {
            let (from, to) = (f64::from(from[axis].0), f64::from(to[axis].0));
            from + (to - from) * part - f64::from(self.center[n])
        };
        let parts = (0..100).map(|n| (f64::from(n) + 0.5) / 100.0);
        parts.map(|part| at(first, 0, part).hypot(at(second, 1, part)) - radius).collect()
    }

    /// Returns the radius of a point and its angle from the start, in the direction of the arc, 0 to 2 pi.
    fn polar(&self, point: &PerAxis<Length>, start: f64) -> (f64, f64) {
        let [first, second, _] = self.axes();
        let x = f64::from(point[first].0 - self.center[0]);
        let y = f64::from(point[second].0 - self.center[1]);
        let turned = y.atan2(x) - start;
        let turned = if self.clockwise { -turned } else { turned };
        (x.hypot(y), turned.rem_euclid(TAU))
    }
}

/// Returns a number of units as text.
fn print(units: i32) -> String {
    let sign = if units < 0 { "-" } else { "" };
    format!("{sign}{}.{:04}", units.unsigned_abs() / 10_000, units.unsigned_abs() % 10_000)
}

fn case() -> impl Strategy<Value = Case> {
    let angles = (0.0..TAU, 0.01..TAU - 0.01);
    let places = (-5_000_000..5_000_000, -5_000_000..5_000_000, -100_000..100_000);
    (0usize..3, any::<bool>(), 10_000.0..5_000_000.0, angles, places).prop_map(
        |(plane, clockwise, radius, (from, sweep), (x, y, across))| Case {
            plane,
            clockwise,
            center: [x, y],
            radius,
            from,
            sweep,
            across,
        },
    )
}

proptest! {
    #[test]
    fn chords_follow_the_circle(case in case(), tolerance in 0.001f32..0.1) {
        let signed = if case.clockwise { -case.sweep } else { case.sweep };
        let (start, target) = (case.point(case.from, 0), case.point(case.from + signed, case.across));
        let arc = case.arc();
        let chords = Chords::new(&start, &target, &arc, tolerance);
        let (planar, across) = (case.radius * case.sweep, f64::from(case.across));
        let length = planar.hypot(across) / 10_000.0;
        prop_assert!((f64::from(chords.length()) / length - 1.0).abs() < 1e-3);
        let count = chords.total();
        let (radius, begin) = (case.polar(&start, 0.0).0, {
            let [first, second, _] = case.axes();
            let x = f64::from(start[first].0 - case.center[0]);
            f64::from(start[second].0 - case.center[1]).atan2(x)
        });
        let mut last = (0.0, start);
        // Mean distance from the circle, of inner chords only.
        let (mut sum, mut inner) = (0.0, 0.0);
        for (i, point) in chords.enumerate() {
            let (_, angle) = case.polar(&point, begin);
            let turned = angle - last.0;
            prop_assert!(turned > 0.0, "chord {i} goes backwards");
            let short = radius * turned <= 205.0;
            let most = f64::from(tolerance) * 10_000.0 * 1.01 + 1.5;
            let offsets = case.offsets(&last.1, &point, radius);
            let worst = offsets.iter().map(|d| d.abs()).fold(0.0, f64::max);
            prop_assert!(short || worst <= most, "chord {i} of {count} is {worst} units off");
            if i > 0 && i as u32 + 1 < count {
                sum += offsets.iter().sum::<f64>() / offsets.len() as f64;
                inner += 1.0;
            }
            let even = across * (i + 1) as f64 / f64::from(count);
            prop_assert!((f64::from(point[case.axes()[2]].0) - even)
                .abs() <= 1.0);
            last = (angle, point);
        }
        if inner > 0.0 {
            let mean: f64 = sum / inner;
            let most = 1.0 + f64::from(tolerance) * 100.0 + radius * 1e-6;
            prop_assert!(mean.abs() <= most, "{mean} units in the mean");
        }
        prop_assert_eq!(last.1, target);
    }

    /// The centre that R gives is the centre of the circle, and the chords reach the end.
    #[test]
    fn radius_form_finds_the_centre(case in case()) {
        // Near a half circle and near a full one the centre depends on the last digit: keep away.
        let long = case.sweep > PI;
        let sweep = if long { 3.25 + (case.sweep - PI) * 0.87 } else { 0.1 + case.sweep * 0.93 };
        let signed = if case.clockwise { -sweep } else { sweep };
        let (start, target) = (case.point(case.from, 0), case.point(case.from + signed, 0));
        let mut interpreter = Interpreter::new();
        let mut out = Commands::default();
        interpreter.set_position(&start);
        let [first, second, _] = case.axes();
        let letter = ["X", "Y", "Z"];
        let radius = if long { -case.radius.round() } else { case.radius.round() } as i32;
        let line = format!(
            "G{} F100 G{} {}{} {}{} R{}",
            17 + case.plane,
            if case.clockwise { 2 } else { 3 },
            letter[first], print(target[first].0),
            letter[second], print(target[second].0),
            print(radius),
        );
        interpreter.interpret(line.as_bytes(), &Usual, &mut out).unwrap();
        let Motion::Arc { arc, .. } = out.motion else { panic!("no arc") };
        for (found, center) in arc.center.iter().zip(case.center) {
            prop_assert!((found.0 - center).abs() <= 40, "{} {center}", found.0);
        }
        prop_assert_eq!(Chords::new(&start, &target, &arc, 0.01).last(), Some(target));
    }

    /// From the line to the last chord: centre form, any plane, any direction, any number of turns, with a helix and
    /// a rotary axis.
    #[test]
    fn a_line_goes_round_as_often_as_it_says(
        case in case(), turns in 0u32..4, full: bool, angle in -3_600_000i32..3_600_000, incremental: bool,
    ) {
        let signed = if case.clockwise { -case.sweep } else { case.sweep };
        let start = case.point(case.from, 0);
        let mut target = if full { start } else { case.point(case.from + signed, 0) };
        let [first, second, linear] = case.axes();
        target[linear] = Length(case.across);
        target[3] = Length(angle);
        let words: String = [first, second, linear, 3].iter().map(|&axis| {
            let origin = if incremental { start[axis].0 } else { 0 };
            format!(" {}{}", ["X", "Y", "Z", "A"][axis], print(target[axis].0 - origin))
        }).collect();
        let offset = |i: usize| print(case.center[i] - start[[first, second][i]].0);
        let line = format!(
            "G{} F100 G{} G{}{words} {}{} {}{} P{turns}",
            17 + case.plane,
            if incremental { 91 } else { 90 },
            if case.clockwise { 2 } else { 3 },
            ["I", "J", "K"][first], offset(0), ["I", "J", "K"][second], offset(1),
        );
        let (mut interpreter, mut out) = (Interpreter::new(), Commands::default());
        interpreter.set_position(&start);
        interpreter.interpret(line.as_bytes(), &Usual, &mut out).unwrap();
        let Motion::Arc { arc, target: end, .. } = out.motion else { panic!("no arc") };
        prop_assert_eq!(end, target);
        prop_assert_eq!(arc.center, case.center.map(Length));
        // P is the number of turns that are begun. P0 means one, too.
        let sweep = if full { TAU } else { case.sweep };
        let wanted = sweep + TAU * f64::from(turns.saturating_sub(1));
        let chords = Chords::new(&start, &target, &arc, 0.05);
        let count = f64::from(chords.total());
        let (mut turned, mut last) = (0.0, case.polar(&start, 0.0).1);
        for (i, point) in chords.enumerate() {
            let (_, at) = case.polar(&point, 0.0);
            turned += (at - last).rem_euclid(TAU);
            last = at;
            let even = f64::from(angle) * (i + 1) as f64 / count;
            prop_assert!((f64::from(point[3].0) - even).abs() <= 2.0);
        }
        prop_assert!((turned - wanted).abs() < 1e-3, "{turned} of {wanted}");
    }
}
