//! Modes, feeds, offsets, refusals.

use super::{feed, position, refusal, run};
use crate::gcode::command::{Commands, Feed, Motion, Spindle, Stop};
use crate::gcode::interpreter::Interpreter;
use crate::gcode::modal::{
    ArcDistance, Defaults, Distance, FeedMode, Modal, MotionMode, PathMode, Plane, Retract,
    SpeedMode, Turn, Units, XMode,
};
use crate::gcode::overrides::{Change, Override};
use crate::gcode::setup::{AxisMode, Setup, Usual};
use crate::status::Status;
use crate::units::Length;
use std::vec;

#[test]
fn traverse_and_feed() {
    let (state, out) = run(&["N7 g0 x1 y-2.5 c90"]);
    assert_eq!(out.line, 7);
    assert_eq!(out.motion, Motion::Traverse { target: *state.position() });
    assert_eq!(state.position().map(|at| at.0), [10_000, -25_000, 0, 0, 0, 900_000]);
    let (state, out) = run(&["G1 F100", "X1"]);
    assert_eq!(
        out.motion,
        Motion::Feed { target: *state.position(), feed: Feed::PerMinute(100.0) }
    );
    assert_eq!((out.line, state.line()), (0, 0));
}

#[test]
fn line_numbers_have_three_bytes() {
    for line in [9_999_999, 10_000_000, 16_777_215] {
        let (state, out) = run(&[&std::format!("N{line} G0 X1")]);
        assert_eq!((out.line, state.line()), (line, line));
    }
    for line in ["N16777216", "N16777216 G0 X1", "N100000000 G0 X1", "N4294967295 G0 X1"] {
        assert_eq!(refusal(&[line]), Status::OutOfRange, "{line}");
    }
}

#[test]
fn lines_that_do_nothing() {
    for line in ["", "  ", "%", "(x)", "; x", "G0", "G80", "G40G49G54", "N5", "F0", "/X", "G2"] {
        let (_, out) = run(&[line]);
        assert_eq!(Commands { line: 0, blend: 0, ..out }, Commands::default(), "{line}");
    }
    let info = Interpreter::new().interpret(b"/G0 X1", &Usual, &mut Commands::default()).unwrap();
    assert!(info.deleted);
}

#[test]
fn modes_stay_in_force() {
    let set = Modal {
        motion: MotionMode::Traverse,
        plane: Plane::Zx,
        distance: Distance::Incremental,
        arc_distance: ArcDistance::Absolute,
        feed_mode: FeedMode::InverseTime,
        units: Units::Inch,
        retract: Retract::ToR,
        speed_mode: SpeedMode::Surface,
        x_mode: XMode::Diameter,
        system: 8,
        path: PathMode::Exact,
        tolerance: 123,
        spindle: Turn::Counterclockwise,
        coolant: 3,
    };
    let (state, _) =
        run(&["M7", "G7 G96 S0", "G64 P0.0123", "G0 G18 G20 G91 G90.1 G93 G99 G59.3 G61 M4 M8"]);
    assert_eq!(state.modal(), &set);
}

#[test]
fn the_tolerance_of_the_path_is_modal() {
    let blend = |lines: &[&str]| run(lines).1.blend;
    for (line, tolerance) in [
        ("G64", 10),
        ("G64 P0.001", 10),
        ("G64 P0", 0),
        ("G64 P0.005", 50),
        ("G20 G64 P0.0001", 25),
        ("G64 P0.0254", 254),
        ("G64 P0.1", 254),
        ("G64 P1000", 254),
    ] {
        assert_eq!(blend(&[line, "G21 G1 F100 X1"]), tolerance + 1, "{line}");
    }
    assert_eq!(blend(&["G1 F100 X1"]), 11);
    assert_eq!(blend(&["G64 P0.005", "G0 X1"]), 51);
    assert_eq!(blend(&["G64 P0.005", "G64", "G0 X1"]), 11);
    assert_eq!(blend(&["G64 P0.005", "M30", "G0 X1"]), 11);
    assert_eq!(blend(&["G64 P0.005", "G61", "G64", "G0 X1"]), 11);
    // Corners are exact, and moves are not merged, with G61 and G61.1.
    for line in ["G61", "G61.1"] {
        assert_eq!(blend(&["G64 P0.005", line, "G0 X1"]), 0, "{line}");
    }
    assert_eq!(blend(&["G2 F100 X2 I1"]), 11);
    assert_eq!(blend(&["G61 G2 F100 X2 I1"]), 0);
    assert_eq!(refusal(&["G64 P-0.001"]), Status::PWordNegative);
}

#[test]
fn exact_stop_is_modal_and_asks_for_nothing_itself() {
    let (state, out) = run(&["G61.1"]);
    assert_eq!(state.modal().path, PathMode::ExactStop);
    assert_eq!(out, Commands { exact_stop: true, ..Commands::default() });
    assert!(run(&["G61.1", "G0 X1"]).1.exact_stop);
    assert!(!run(&["G61.1", "M30", "G0 X1"]).1.exact_stop);
    for line in ["G61", "G64"] {
        assert!(!run(&["G61.1", line, "G0 X1"]).1.exact_stop, "{line}");
    }
}

/// A machine with X disabled, and with A in radius mode with a radius of 1 mm.
struct Odd;

impl Setup for Odd {
    fn mode(&self, axis: u8) -> AxisMode {
        match axis {
            0 => AxisMode::Disabled,
            3 => AxisMode::Radius,
            _ => AxisMode::Standard,
        }
    }
    fn radius(&self, _axis: u8) -> u32 {
        1_000_000
    }
    fn travel(&self, _axis: u8) -> Option<(Length, Length)> {
        None
    }
}

fn odd(lines: &[&str]) -> Result<[i32; 6], Status> {
    let (mut state, mut out) = (Interpreter::new(), Commands::default());
    for line in lines {
        state.interpret(line.as_bytes(), &Odd, &mut out)?;
    }
    Ok(state.position().map(|at| at.0))
}

#[test]
fn words_of_a_disabled_axis_mean_nothing() {
    assert_eq!(odd(&["G0 X1 Y1"]), Ok([0, 10_000, 0, 0, 0, 0]));
    assert_eq!(odd(&["G28.3 X1", "G91 G0 X1", "G92 X5", "G90 X3"]), Ok([0; 6]));
    assert_eq!(odd(&["G1 F100 X5"]), Ok([0; 6]));
    assert_eq!(odd(&["G2 I5 F100"]), Err(Status::AxisDisabled));
    assert_eq!(odd(&["G18 G3 Z2 K1 F100"]), Err(Status::AxisDisabled));
    assert_eq!(odd(&["G19 G3 Z2 K1 X7 F100"]), Ok([0, 0, 20_000, 0, 0, 0]));
}

#[test]
fn words_of_a_radius_axis_are_lengths() {
    assert_eq!(odd(&["G0 A1"]), Ok([0, 0, 0, 572_958, 0, 0]));
    assert_eq!(odd(&["G20 G0 A1 B1"]), Ok([0, 0, 0, 14_553_128, 10_000, 0]));
    assert_eq!(odd(&["G28.3 A1", "G92 A0", "G0 A1"]), Ok([0, 0, 0, 1_145_916, 0, 0]));
    // The residue of rounding is added to the next move.
    let mut lines = vec!["G91 G0"];
    lines.extend(["A0.0001"; 1000]);
    assert_eq!(odd(&lines), Ok([0, 0, 0, 57_296, 0, 0]));
    assert_eq!(odd(&["G0 A200000"]), Err(Status::OutOfRange));
}

#[test]
fn program_end_resets() {
    let modes = "G20 G61 G19 G91 G90.1 G99 G93 G55 M3 S9 M8 M49";
    let (state, out) = run(&[modes, "F1 G1 X1", "G92 X5", "M30"]);
    assert_eq!(out.stop, Stop::End);
    let reset = Modal { motion: MotionMode::Feed, ..Modal::new(&Defaults::USUAL) };
    assert_eq!(state.modal(), &reset);
    assert_eq!(state.work_offset()[0], Length::ZERO);
    assert_eq!(state.position()[0], Length(254_000));
    assert_eq!(state.feed_rate(), 0.0);
    assert_eq!(run(&["G92 X5", "M2", "G92.3"]).0.work_offset()[0], Length::ZERO);
    assert_eq!(run(&["M50 P.5"]).1.overrides, Some(Change::to(Override::Feed, 500)));
    assert_eq!(run(&["M48"]).1.overrides, Some(Change::ALL_ON));
    assert_eq!(refusal(&["G1 F9", "M2", "X1"]), Status::FeedrateMissing);
    assert_eq!(run(&["M2"]).1.stop, Stop::End);
    for line in ["M0", "M1", "M60"] {
        assert_eq!(run(&[line]).1.stop, Stop::Program, "{line}");
    }
    assert!(matches!(run(&["G0 X1 M2"]).1.motion, Motion::Traverse { .. }));
}

#[test]
fn tools_have_five_digits() {
    for tool in [0, 99, 255, 256, 390, 8_888, 65_535] {
        let (state, _) = run(&[&std::format!("M6T{tool}")]);
        assert_eq!(u32::from(state.tool()), tool);
        assert_eq!(u32::from(state.selected_tool()), tool);
    }
    assert_eq!(refusal(&["T65536"]), Status::TWordInvalid);
    // 256 is not taken for 0, nor 257 for 1.
    for tool in ["T256 M6", "T257 M6", "T390 M6", "T65535 M6"] {
        assert_eq!(refusal(&[tool, "G43"]), Status::HWordInvalid, "{tool}");
    }
}

#[test]
fn program_names_have_no_effect() {
    for line in
        ["O1", "o0001 (PART)", "O12345;x", "N10 O7", "%prog1", "% 1234", "%_N_A_MPF", "%O1 x"]
    {
        let (_, out) = run(&[line]);
        assert!(out.is_empty(), "{line}");
    }
    for line in ["o100 sub", "o<name> call", "o1 while [1]", "O1 if", "O#1 call", "o1 do", "O"] {
        assert_eq!(refusal(&[line]), Status::BadNumber, "{line}");
    }
    // What is G-code behind a percent sign runs, as behind one that the receive interrupt has taken.
    assert_eq!(position(&["% G0 X1"])[0], 10_000);
    assert_eq!(refusal(&["G0 X1 %"]), Status::MalformedCommand);
}

#[test]
fn a_mark_of_utf8_is_no_text() {
    assert_eq!(position(&["\u{FEFF}G0 X1"])[0], 10_000);
    assert_eq!(position(&["  \u{FEFF} (x) G0 X1"])[0], 10_000);
    assert!(run(&["\u{FEFF}"]).1.is_empty());
    assert_eq!(refusal(&["G0 \u{FEFF}X1"]), Status::MalformedCommand);
    assert_eq!(refusal(&["\u{FFFE}G0 X1"]), Status::MalformedCommand);
}

#[test]
fn a_tool_change_stops_the_spindle() {
    let (state, out) = run(&["M3 S100", "T2 M6 S200"]);
    assert_eq!((state.tool(), state.modal().spindle), (2, Turn::Off));
    assert_eq!((out.changes_tool, out.spindle), (true, None));
    let (_, out) = run(&["M3 S100", "M6", "S300"]);
    assert!(out.is_empty());
    let (_, out) = run(&["M3 S100", "M6 M4"]);
    assert_eq!(out.spindle, Some(Spindle { turn: Turn::Counterclockwise, speed: 100.0 }));
    assert_eq!(refusal(&["M3", "M6", "F9 G86 X1 Z-1 R1 P0"]), Status::SpindleMustTurn);
}

#[test]
fn heights_of_a_cycle_are_those_of_its_plane() {
    let before = ["G0 X5 Y9 Z7", "F9 G18 G81 Y0 R1"];
    let after = |line| position(&[&before[..], &[line]].concat())[..3].to_vec();
    assert_eq!(after("G17 G81 Z0 R1"), [50_000, 90_000, 70_000]);
    assert_eq!(after("G19 G81 X0 R1"), [50_000, 90_000, 70_000]);
    assert_eq!(after("G19 G82 X0 R1 P0"), [50_000, 90_000, 70_000]);
    assert_eq!(refusal(&[before[0], before[1], "G17 X1"]), Status::RWordMissing);
}

#[test]
fn feed_is_in_the_units_of_its_line() {
    assert_eq!(feed(&["G20 F10 G1 X1"]), Feed::PerMinute(254.0));
    assert_eq!(feed(&["G20", "G21 F10 G1 X1"]), Feed::PerMinute(10.0));
    assert_eq!(feed(&["G20 F10", "G21 G1 X1"]), Feed::PerMinute(254.0));
    assert_eq!(run(&["G20 F10"]).0.feed_rate(), 254.0);
    // Degrees do not depend on G20.
    assert_eq!(feed(&["G20 F10 G1 A1"]), Feed::PerMinute(10.0));
    assert_eq!(feed(&["G20 F10 G1 A1 X1"]), Feed::PerMinute(254.0));
}

#[test]
fn feed_must_be_there() {
    let missing = Status::FeedrateMissing;
    for lines in [&["G1 X1"][..], &["G1"], &["F0 G1 X1"], &["G93 G1 X1"], &["G2 X1 I1"]] {
        assert_eq!(refusal(lines), missing, "{lines:?}");
    }
    assert_eq!(refusal(&["F100", "G93", "G1 X1"]), missing);
    assert_eq!(refusal(&["F100", "G93 G1 X1 F2", "X2"]), missing);
    assert_eq!(refusal(&["F100", "G93 G1 X1 F2", "G94 X2"]), missing);
    assert_eq!(refusal(&["G93 G1 X1 F0"]), missing);
    assert_eq!(refusal(&["F-1"]), Status::OutOfRange);
    assert_eq!(refusal(&["G93 G1 X1 F-1"]), Status::OutOfRange);
}

#[test]
fn inverse_time() {
    assert_eq!(feed(&["G93 G1 X1 F4"]), Feed::Minutes(0.25));
    assert_eq!(feed(&["G20 G93 G1 X1 F4", "X2 F2"]), Feed::Minutes(0.5));
    assert_eq!(feed(&["G93", "G94 F100 G1 X1"]), Feed::PerMinute(100.0));
    // With G93, F is accepted and ignored on lines that do not feed.
    run(&["G93 G0 X1 F4"]);
    run(&["G93 F4"]);
}

#[test]
fn dwell() {
    assert_eq!(run(&["G4 P1.5"]).1.dwell_ms, Some(1_500));
    assert_eq!(run(&["G4 P0"]).1.dwell_ms, Some(0));
    let (_, out) = run(&["G4 P.001 G0 X1"]);
    assert!(out.dwell_ms == Some(1) && out.motion != Motion::None);
    assert_eq!(refusal(&["G4"]), Status::PWordMissing);
    assert_eq!(refusal(&["G0", "G4 X1"]), Status::PWordMissing);
    assert_eq!(refusal(&["G4 P-1"]), Status::PWordNegative);
}

#[test]
fn set_position_in_machine_coordinates() {
    let (state, out) = run(&["G92 X1", "G0 X5", "G20 G28.3 X1 A1"]);
    let named = Motion::SetPosition { position: [254_000, 0, 0, 10_000, 0, 0].map(Length) };
    assert_eq!(out.motion, named);
    assert_eq!(state.position()[0], Length(254_000));
    assert_eq!(state.work_offset()[0], Length(-10_000));
    assert_eq!(refusal(&["G28.3"]), Status::AxisWordMissing);
}

#[test]
fn work_offset() {
    assert_eq!(position(&["G0 X10 Y5", "G92 X1", "G0 X2 Y2"])[..2], [110_000, 20_000]);
    assert_eq!(position(&["G0 X10", "G92 X1", "G91 X1"])[0], 110_000);
    assert_eq!(position(&["G0 X10", "G92 X1", "G92.1 X2"])[0], 20_000);
    assert_eq!(run(&["G0 X10", "G92 X1 Y0"]).0.work_offset()[0], Length(90_000));
    assert_eq!(refusal(&["G92"]), Status::AxisWordMissing);
    assert_eq!(refusal(&["G0 X200000", "G92 X-100000"]), Status::OutOfRange);
    assert_eq!(refusal(&["G0 X200000", "G92 X0", "G0 X100000"]), Status::OutOfRange);
}

#[test]
fn inches_and_increments_do_not_drift() {
    assert_eq!(position(&["G20 G0 X1 Y-.5 A1"])[..4], [254_000, -127_000, 0, 10_000]);
    let mut lines = std::vec!["G20 G91 G0"];
    lines.extend(["X.0001"; 1_000]);
    assert_eq!(position(&lines)[0], 25_400);
    lines.push("G21 X-2.54");
    assert_eq!(position(&lines)[0], 0);
    let mut thirds = std::vec!["G91 G0"];
    thirds.extend(["X-.00003333"; 3_000]);
    assert_eq!(position(&thirds)[0], -1_000);
}

#[test]
fn axis_words_belong_to_one_code() {
    for line in ["G92 X1 G1 F1", "G0 G28.3 X1", "G2 G92 X1"] {
        assert_eq!(refusal(&[line]), Status::AxisConflict, "{line}");
    }
    run(&["G80 G92 X1"]);
    run(&["G0", "G92 X1"]);
    for lines in [&["X1"][..], &["G0", "G80 X1"], &["G4 P1 X1"]] {
        assert_eq!(refusal(lines), Status::AxisNotAllowed, "{lines:?}");
    }
}

#[test]
fn words_that_nothing_uses() {
    for line in
        ["P1", "G0 X1 P1", "R1", "I1", "G0 X1 J1", "G1 F1 X1 R2", "G92 X1 K1", "H1", "L1", "Q1"]
    {
        assert_eq!(refusal(&[line]), Status::WordUnused, "{line}");
    }
}

#[test]
fn a_refused_line_leaves_no_trace() {
    let lines = ["G20 G91 G93 G18 N9 G2 X1", "F50 X1 G0 Q1", "G92 X1 P1", "G0 X1 Y99999999"];
    for line in lines.iter().chain(&["M30 P1", "G28.3 X1 R1", "N1.5", "N-1", "G0 X"]) {
        refusal(&["G0 X1 F5", line]);
    }
    assert_eq!(refusal(&["N1.5"]), Status::BadNumber);
    assert_eq!(refusal(&["G0 X214749"]), Status::OutOfRange);
    assert_eq!(refusal(&["G0 X200000", "G91 X200000"]), Status::OutOfRange);
}

#[test]
fn resynchronised_with_the_machine() {
    let (mut state, mut out) = run(&["G91 G20 G0 X.0001 Y1"]);
    state.set_position(&[Length(7); 6]);
    state.interpret(b"X.0001", &Usual, &mut out).unwrap();
    assert_eq!(state.position().map(|at| at.0), [32, 7, 7, 7, 7, 7]);
}
