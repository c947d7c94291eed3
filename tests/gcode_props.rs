//! G-code, properties: nothing panics, a refused line leaves no trace, numbers and units are exact,
//! chords lie on their circle.

use std::f64::consts::{PI, TAU};

use kerf::gcode::Interpreter;
use kerf::gcode::arc::Chords;
use kerf::gcode::axes::Usual;
use kerf::gcode::command::{Arc, Commands, Motion};
use kerf::gcode::number::decimal;
use kerf::units::{Length, PerAxis};
use proptest::prelude::*;

/// Lines that come close to being G-code, and often are.
fn line() -> impl Strategy<Value = String> {
    let word = prop_oneof![
        8 => "[GgXYZIJ](0|1|2|3|-?[0-9]{1,3}(\\.[0-9]{0,6})?)",
        4 => "G(0|1|2|3|4|17|18|19|20|21|28\\.3|80|90|91|92|92\\.1|93|94|61\\.1)",
        2 => "[ABCFKPRN]-?[0-9]{1,7}(\\.[0-9]{0,9})?",
        1 => "M(0|1|2|30|60)",
        1 => "[A-Z]|\\(MSG [a-z]*\\)|;[a-z]*|/|%|[XYZ]-?[0-9]{1,12}",
    ];
    prop::collection::vec(word, 0..7).prop_map(|words| words.join(" "))
}

/// Interprets a line and checks what holds for every line.
fn interpret(interpreter: &mut Interpreter, line: &[u8]) -> Commands {
    let before = *interpreter;
    let mut out = Commands::default();
    match interpreter.interpret(line, &Usual, &mut out) {
        Ok(info) => {
            if let Some((start, end)) = info.message {
                assert!(line.get(usize::from(start)..usize::from(end)).is_some());
            }
        }
        Err(_) => {
            assert_eq!(*interpreter, before);
            assert_eq!(out, Commands::default());
        }
    }
    out
}

proptest! {
    #[test]
    fn any_bytes_give_a_result(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        interpret(&mut Interpreter::new(), &bytes);
    }

    #[test]
    fn any_program_gives_results(lines in prop::collection::vec(line(), 0..30)) {
        let mut interpreter = Interpreter::new();
        for line in lines {
            let start = *interpreter.position();
            let out = interpret(&mut interpreter, line.as_bytes());
            match out.motion {
                Motion::None => {}
                Motion::Traverse { target } | Motion::Feed { target, .. } => {
                    prop_assert_eq!(&target, interpreter.position());
                }
                Motion::Arc { target, arc, .. } => {
                    prop_assert_eq!(&target, interpreter.position());
                    let last = Chords::new(&start, &target, &arc, 0.01).take(5_000).last();
                    prop_assert!(last.is_some());
                }
            }
        }
    }

    #[test]
    fn what_is_printed_reads_back(
        whole in any::<u32>(), decimals in 0u32..100_000_000, places in 0usize..=8,
        negative: bool, blanks: bool,
    ) {
        let kept = decimals / 10u32.pow(8 - places as u32) * 10u32.pow(8 - places as u32);
        let digits = &format!("{kept:08}")[..places];
        let mut text = format!("{}{whole}.{digits}", if negative { "-" } else { "" });
        if blanks {
            text = text.chars().flat_map(|digit| [' ', digit]).collect();
        }
        let (rest, value) = decimal(text.as_bytes()).unwrap();
        prop_assert!(rest.is_empty());
        prop_assert_eq!(value.whole, whole);
        prop_assert_eq!(u32::from(value.frac) * 10_000 + u32::from(value.tail), kept);
        prop_assert_eq!(value.negative, negative && (whole, kept) != (0, 0));
    }

    #[test]
    fn lengths_are_rounded_exactly(whole in 0u32..8_000, decimals in 0u32..10_000_000, negative: bool) {
        let text = format!("{}{whole}.{decimals:07}", if negative { "-" } else { "" });
        let (_, value) = decimal(text.as_bytes()).unwrap();
        let magnitude = i128::from(whole) * 10_000_000 + i128::from(decimals);
        let written = if negative { -magnitude } else { magnitude };
        // Ten-thousandths of a unit: 10 in 1e-7 mm, 254 in 1e-7 inch.
        for (exact, scale) in [(value.mm(), 10), (value.inch(), 254)] {
            let exact = exact.unwrap();
            prop_assert_eq!(i128::from(exact.units.0) * 10_000 + i128::from(exact.rest), written * scale);
            let halves = (magnitude * scale + 5_000) / 10_000;
            prop_assert_eq!(i128::from(exact.units.0).abs(), halves);
        }
    }

    /// Incremental moves in alternating units end at the exact sum.
    #[test]
    fn units_may_alternate(moves in prop::collection::vec((any::<bool>(), -2_000_000i64..2_000_000), 1..200)) {
        let mut interpreter = Interpreter::new();
        let mut out = Commands::default();
        interpreter.interpret(b"G91 G0", &Usual, &mut out).unwrap();
        let mut sum = 0i64;
        for (inch, millionths) in moves {
            let (code, scale) = if inch { (20, 2_540) } else { (21, 100) };
            let sign = if millionths < 0 { "-" } else { "" };
            let size = millionths.abs();
            let line = format!("G{code} X{sign}{}.{:06}", size / 1_000_000, size % 1_000_000);
            interpreter.interpret(line.as_bytes(), &Usual, &mut out).unwrap();
            sum += millionths * scale;
        }
        let error = i64::from(interpreter.position()[0].0) * 10_000 - sum;
        prop_assert!(error.abs() <= 5_000, "{error}");
    }
}

/// A circle in one of the planes, as the numbers of an arc's line, in units.
#[derive(Clone, Copy, Debug)]
struct Case {
    plane: usize,
    clockwise: bool,
    center: [i32; 2],
    radius: f64,
    /// Where on the circle, in radians, counter-clockwise from the first axis.
    from: f64,
    /// How far, in radians, in the sense of the arc.
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

    /// Radius and angle (from the start, in the sense of the arc, 0 to 2 pi) of a point.
    fn polar(&self, point: &PerAxis<Length>, start: f64) -> (f64, f64) {
        let [first, second, _] = self.axes();
        let x = f64::from(point[first].0 - self.center[0]);
        let y = f64::from(point[second].0 - self.center[1]);
        let turned = y.atan2(x) - start;
        let turned = if self.clockwise { -turned } else { turned };
        (x.hypot(y), turned.rem_euclid(TAU))
    }
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
        for (i, point) in chords.enumerate() {
            let (r, angle) = case.polar(&point, begin);
            prop_assert!((r - radius).abs() <= 10.0, "1 um: {} from {radius}", r - radius);
            let turned = angle - last.0;
            prop_assert!(turned > 0.0, "chord {i} goes backwards");
            let sagitta = r * (1.0 - (turned / 2.0).cos());
            let short = r * turned <= 505.0;
            prop_assert!(short || sagitta <= f64::from(tolerance) * 10_000.0 * 1.01 + 1.5, "{sagitta}");
            let even = across * (i + 1) as f64 / f64::from(count);
            prop_assert!((f64::from(point[case.axes()[2]].0) - even)
                .abs() <= 1.0);
            last = (angle, point);
        }
        prop_assert_eq!(last.1, target);
    }

    /// The centre that R gives is the centre, and the chords arrive.
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
        let print = |units: i32| {
            let sign = if units < 0 { "-" } else { "" };
            format!("{sign}{}.{:04}", units.unsigned_abs() / 10_000, units.unsigned_abs() % 10_000)
        };
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
}
