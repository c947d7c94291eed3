//! Canned cycles, step by step, and the words that stay in force from line to line.

use super::{refusal, run};
use crate::gcode::command::{Commands, Stop};
use crate::gcode::interpreter::Interpreter;
use crate::gcode::modal::Turn;
use crate::gcode::setup::Usual;
use crate::gcode::steps::{Step, Steps};
use crate::status::Status;
use crate::units::{AXIS_LETTERS, Length, PerAxis};
use std::format;
use std::string::String;
use std::vec::Vec;

/// Returns the steps of the last of these lines. A move is written as the axes that it moves and their targets: a
/// traverse in upper case, a feed in lower case. Other steps are written as in G-code.
fn steps(lines: &[&str]) -> String {
    let (last, before) = lines.split_last().unwrap();
    let (mut interpreter, _) = run(before);
    told(&mut interpreter, last)
}

fn told(interpreter: &mut Interpreter, line: &str) -> String {
    let mut place = *interpreter.position();
    let mut out = Commands::default();
    interpreter.interpret(line.as_bytes(), &Usual, &mut out).expect(line);
    let mut steps = Steps::default();
    let mut told = Vec::new();
    while let Some(step) = steps.next(&out, &place) {
        told.push(match step {
            Step::Line(target, feed) => {
                let text = moved(&place, &target);
                place = target;
                if feed.is_some() { text } else { text.to_ascii_uppercase() }
            }
            Step::Dwell(ms) => format!("P{ms}"),
            Step::Spindle(spindle) => match spindle.turn {
                Turn::Off => "M5".into(),
                Turn::Clockwise => "M3".into(),
                Turn::Counterclockwise => "M4".into(),
            },
            Step::Stop(Stop::Program) => "M0".into(),
            other => panic!("{other:?}"),
        });
    }
    assert_eq!(&place, interpreter.position());
    told.join(" ")
}

fn moved(from: &PerAxis<Length>, to: &PerAxis<Length>) -> String {
    assert_ne!(from, to, "to where it stands");
    let mut text = String::new();
    for ((from, to), letter) in from.iter().zip(to).zip(AXIS_LETTERS) {
        if from != to {
            let number = format!("{to}");
            let number = number.trim_end_matches('0').trim_end_matches('.');
            text += &format!("{}{number}", char::from(letter));
        }
    }
    text
}

/// Each cycle begins at height 9 with the spindle on. Its hole is at X1 Y2, from R5 down to 1.
#[test]
fn what_is_done_at_a_hole() {
    for (line, expected) in [
        ("G81", "X1Y2 Z5 z1 Z9"),
        ("G82 P.5", "X1Y2 Z5 z1 P500 Z9"),
        ("G83 Q3", "X1Y2 Z5 z2 Z5 Z2.254 z1 Z9"),
        ("G83 Q4", "X1Y2 Z5 z1 Z9"),
        ("G83 Q9", "X1Y2 Z5 z1 Z9"),
        ("G73 Q3", "X1Y2 Z5 z2 Z2.254 z1 Z9"),
        ("G73 Q2", "X1Y2 Z5 z3 Z3.254 z1 Z9"),
        ("G84", "X1Y2 Z5 z1 M5 M4 z9 M5 M3"),
        ("G84 P.5", "X1Y2 Z5 z1 M5 M4 P500 z9 M5 M3"),
        ("G85", "X1Y2 Z5 z1 z9"),
        ("G86 P.5", "X1Y2 Z5 z1 P500 M5 Z9 M3"),
        ("G87 I.1 J-.2 K3", "X1Y2 Z5 X1.1Y1.8 M5 Z1 X1Y2 M3 z3 z1 M5 X1.1Y1.8 Z9 X1Y2 M3"),
        ("G88 P.5", "X1Y2 Z5 z1 P500 M5 M0 Z9 M3"),
        ("G89 P.5", "X1Y2 Z5 z1 P500 z9"),
        ("G89 P0", "X1Y2 Z5 z1 z9"),
    ] {
        let line = format!("{line} X1 Y2 Z1 R5 F100");
        assert_eq!(steps(&["M3 G0 Z9", &line]), expected, "{line}");
        let (z5, to_r) = (format!("G99 {line}"), expected.replace("Z9", "Z5").replace("z9", "z5"));
        assert_eq!(steps(&["M3 G0 Z9", &z5]), to_r, "{z5}");
    }
}

/// A counterclockwise spindle is started again counterclockwise.
#[test]
fn the_spindle_turns_as_before() {
    let lines = ["M4 G0 Z9", "G86 P0 Z1 R5 F100"];
    assert_eq!(steps(&lines), "Z5 z1 M5 Z9 M4");
}

#[test]
fn pecks_stay_below_r() {
    let lines = ["G0 Z9", "G83 Z4.8 R5 Q.1 F100"];
    assert_eq!(steps(&lines), "Z5 z4.9 Z5 z4.8 Z9");
    let lines = ["G0 Z9", "G73 Z4.8 R5 Q.1 F100"];
    assert_eq!(steps(&lines), "Z5 z4.9 Z5 z4.8 Z9");
}

#[test]
fn from_where_to_where() {
    let below = ["G81 X1 Z-1 R2 F9"];
    assert_eq!(steps(&below), "Z2 X1 z-1 Z2");
    let rises_in_a_series = ["G99 G81 X1 Z-1 R2 F9", "X2 R3"];
    assert_eq!(steps(&rises_in_a_series), "Z3 X2 z-1 Z3");
    let back_up_again = ["G0 Z9", "G99 G81 X1 Z-1 R2 F9", "G98 X2"];
    assert_eq!(steps(&back_up_again), "X2 z-1 Z9");
    let in_the_hole = ["G0 Z9", "G81 Z5 R5 F9"];
    assert_eq!(steps(&in_the_hole), "Z5 Z9");
    let other_planes = ["G18 G0 Y9", "G81 X1 Z2 Y-1 R5 F9"];
    assert_eq!(steps(&other_planes), "X1Z2 Y5 y-1 Y9");
    let other_planes = ["G19 G0 X9", "G81 Y1 Z2 X-1 R5 F9"];
    assert_eq!(steps(&other_planes), "Y1Z2 X5 x-1 X9");
}

#[test]
fn repeats() {
    let at_one_place = ["G0 Z9", "G81 X1 Z1 R5 L2 F9"];
    assert_eq!(steps(&at_one_place), "X1 Z5 z1 Z9 Z5 z1 Z9");
    let along = ["G0 X1 Z9", "G91 G99 G81 X1 Y1 Z-4 R-4 L2 F9"];
    assert_eq!(steps(&along), "X2Y1 Z5 z1 Z5 X3Y2 z1 Z5");
    // R is measured from the present place, and the depth from R.
    let on = [along[0], along[1], "X1"];
    assert_eq!(steps(&on), "X4 Z1 z-3 Z1");
}

#[test]
fn words_stay_as_long_as_the_cycle() {
    let first = "G82 X1 Z1 R5 P1 F9";
    assert_eq!(steps(&["G0 Z9", first, "X2"]), "X2 Z5 z1 P1000 Z9");
    assert_eq!(steps(&["G0 Z9", first, "G82 Z2"]), "Z5 z2 P1000 Z9");
    assert_eq!(steps(&["G0 Z9", first, "M3", "G4 P1", "G99 Y1"]), "Y1 Z5 z1 P1000 Z5");
    // G98 returns to the height before the first cycle of a series.
    assert_eq!(steps(&["G0 Z9", "G99 G81 Z1 R5 F9", "G98 G85 Z1 R3"]), "Z3 z1 z9");
    assert_eq!(steps(&["G0 Z9", "G99 G81 Z1 R5 F9", "G0", "G98 G81 Z1 R3"]), "Z3 z1 Z5");
    for (lines, status) in [
        (&[first, "G81 X2"][..], Status::RWordMissing),
        (&[first, "G81 R5 X2"], Status::AxisTargetMissing),
        (&[first, "G89 R5 Z1"], Status::PWordMissing),
        (&[first, "G0", "G82 X2 Z1 R5"], Status::PWordMissing),
        (&[first, "G80", "X2"], Status::AxisNotAllowed),
        (&["F9 G83 Z1 R5"], Status::QWordMissing),
        (&["F9 G73 Z1 R5 Q0"], Status::QWordInvalid),
        (&["F9 G81 Z1 R0"], Status::RWordInvalid),
        (&["F9 G81 Z1 R5 L0"], Status::LWordInvalid),
        (&["F9 G81 Z1 R5 A1"], Status::RotaryNotAllowed),
        (&["G81 Z1 R5"], Status::FeedrateMissing),
        (&["G93 F9 G81 Z1 R5"], Status::InverseTimeNotAllowed),
        (&["F9 G86 Z1 R5 P1"], Status::SpindleMustTurn),
        (&["F9 M4 G84 Z1 R5"], Status::SpindleMustTurn),
        (&["F9 M3 G87 Z1 R5 I1 J1"], Status::ArcOffsetsMissing),
        (&["F9 M3 G87 Z1 R5 I1 J1 K0"], Status::AxisInvalid),
    ] {
        assert_eq!(refusal(lines), status, "{lines:?}");
    }
}

#[test]
fn along_x_the_heights_of_a_cycle_are_diameters_too() {
    // Radius 20 is the bottom, radius 21 is R.
    let at = ["G7 G21 G90 G94", "G0 X50 Y0 Z0", "F100"];
    let line = |line| steps(&[at[0], at[1], at[2], line]);
    assert_eq!(line("G19 G99 G81 X40 R42 Y5"), "Y5 X21 x20 X21");
    assert_eq!(steps(&[at[0], at[1], at[2], "G19", "G99 G81 X40 R42 Y5"]), "Y5 X21 x20 X21");
    // The words that stay in force are not halved again.
    assert_eq!(steps(&[at[0], at[1], at[2], "G19 G99 G81 X40 R42 Y5", "Y6"]), "Y6 x20 X21");
    assert_eq!(line("G91 G19 G99 G81 X-2 R-4 Y5"), "Y5 X23 x22 X23");
    assert_eq!(line("G20 G19 G99 G81 X1 R2 Y0"), "X25.4 x12.7 X25.4");
    // A peck is a distance, as I of an arc is.
    assert_eq!(line("G19 G99 G83 X40 R42 Q1 Y5"), "Y5 X21 x20 X21");
    // In another plane R is no coordinate of X.
    assert_eq!(line("G17 G99 G81 X40 R2 Z-1"), "Z2 X20 z-1 Z2");
    assert_eq!(steps(&["G8 G0 X25", "F100", "G19 G99 G81 X20 R21 Y5"]), "Y5 X21 x20 X21");
    // K of G87 is a height along Z, and I is one along X.
    let bore = |line| steps(&["G7 M3 S100 F100", "G0 X50", line]);
    assert_eq!(
        bore("G19 G99 G87 X40 R42 Y0 J1 K0 I41"),
        steps(&["G8 M3 S100 F100", "G0 X25", "G19 G99 G87 X20 R21 Y0 J1 K0 I20.5"])
    );
}
