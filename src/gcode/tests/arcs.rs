//! The circles that lines describe.

use super::{position, refusal, run};
use crate::gcode::command::{Arc, Motion};
use crate::status::Status;

fn arc(lines: &[&str]) -> Arc {
    match run(lines).1.motion {
        Motion::Arc { arc, .. } => arc,
        other => panic!("{lines:?}: {other:?}"),
    }
}

fn center(lines: &[&str]) -> [i32; 2] {
    arc(lines).center.map(|length| length.0)
}

const AT_10_0: &str = "F100 G0 X10 Y0";

#[test]
fn center_form() {
    let quarter = arc(&[AT_10_0, "G3 X0 Y10 I-10"]);
    assert_eq!((quarter.first, quarter.second, quarter.linear), (0, 1, 2));
    assert_eq!(quarter.center.map(|length| length.0), [0, 0]);
    assert!(!quarter.clockwise && quarter.extra_turns == 0);
    assert!(arc(&[AT_10_0, "G2 X0 Y10 I-10"]).clockwise);
    // Offsets are measured from the start, in inches too. The mode stays in force.
    assert_eq!(center(&["F1 G0 X254", "G20", "G91 G3 X-10 Y10 I-10 J0", "X-10 Y-10 J-10"]), [0, 0]);
    // A full circle, and a helix.
    assert_eq!(center(&[AT_10_0, "G2 J5"]), [100_000, 50_000]);
    assert_eq!(position(&[AT_10_0, "G2 J5 Z-1 A90"])[..4], [100_000, 0, -10_000, 900_000]);
}

#[test]
fn planes_turn_from_first_to_second() {
    let axes = |arc: Arc| (arc.first, arc.second, arc.linear);
    let zx = arc(&["F1 G18", "G2 X5 Z5 K5"]);
    assert_eq!(axes(zx), (2, 0, 1));
    assert_eq!(zx.center.map(|length| length.0), [50_000, 0]);
    assert_eq!(axes(arc(&["F1 G19", "G3 Y5 Z5 K5"])), (1, 2, 0));
}

#[test]
fn radius_form() {
    assert_eq!(center(&[AT_10_0, "G3 X0 Y10 R10"]), [0, 0]);
    assert_eq!(center(&[AT_10_0, "G2 X0 Y10 R-10"]), [0, 0]);
    assert_eq!(center(&[AT_10_0, "G2 X0 Y10 R10"]), [100_000, 100_000]);
    assert_eq!(center(&[AT_10_0, "G3 X0 Y10 R-10"]), [100_000, 100_000]);
    // Half circles, with an exact R and with an R that is 4 um short.
    assert_eq!(center(&[AT_10_0, "G3 X-10 R10"]), [0, 0]);
    assert_eq!(center(&[AT_10_0, "G3 X-10 R9.996"]), [0, 0]);
    assert_eq!(center(&["F1 G18 G0 Z10", "G3 X10 Z0 R10"]), [0, 0]);
    assert_eq!(center(&["G20 F1 G0 X1", "G3 X0 Y1 R1"]), [0, 0]);
}

#[test]
fn turns() {
    for line in ["G3 I-10", "G3 X0 Y10 I-10", "G3 X0 Y10 R10"] {
        for (turns, extra) in [("", 0), ("P0", 0), ("P1", 0), ("P2", 1), ("P3", 2)] {
            let extra_turns = arc(&[AT_10_0, &std::format!("{line} {turns}")]).extra_turns;
            assert_eq!(extra_turns, extra, "{line} {turns}");
        }
    }
    assert_eq!(refusal(&[AT_10_0, "G3 I-10 P-1"]), Status::PWordNegative);
    for line in ["G3 I-10 P1.5", "G3 I-10 P65536"] {
        assert_eq!(refusal(&[AT_10_0, line]), Status::PWordInvalid, "{line}");
    }
}

#[test]
fn incomplete_arcs() {
    for (line, status) in [
        ("G2 R10", Status::ArcAxisMissing),
        ("G2 Z1 R10", Status::ArcAxisMissing),
        ("G2 X0 Y10", Status::ArcOffsetsMissing),
        ("G2 Z5", Status::ArcOffsetsMissing),
        ("G2 X0 Y10 I0 J0", Status::ArcOffsetsMissing),
        ("G2 X0 Y10 I-10 K1", Status::ArcSpecification),
        ("G18 G2 X0 Z10 I-10 J1", Status::ArcSpecification),
        ("G2 X0 Y10 I-10 R10", Status::ArcSpecification),
    ] {
        assert_eq!(refusal(&[AT_10_0, line]), status, "{line}");
    }
    // With G2 in force, a line with axis words still has to describe a circle.
    assert_eq!(refusal(&[AT_10_0, "G2 I5", "X5"]), Status::ArcOffsetsMissing);
    run(&[AT_10_0, "G2 I5", "F200"]);
}

#[test]
fn impossible_arcs() {
    for (line, status) in [
        ("G2 X0 Y10 R0.09", Status::ArcRadiusTolerance),
        ("G2 X10.0017 R0.0009", Status::ArcRadiusTolerance),
        ("G2 X10.0023 R0.001", Status::ArcRadiusTolerance),
        ("G2 X10.044 R0.02", Status::ArcRadiusTolerance),
        ("G2 X-10 R9.99", Status::ArcRadiusTolerance),
        ("G2 X-10 R0", Status::ArcRadiusTolerance),
        ("G2 X1000000 R10", Status::OutOfRange),
        ("G2 X-10 R160000", Status::OutOfRange),
        ("G2 X10 Y0 R10", Status::ArcEndpointIsStart),
        ("G2 X10 Y0 Z5 R10", Status::ArcEndpointIsStart),
        ("G2 X10.004 I-10", Status::ArcEndpointIsStart),
        ("G2 X0 Y10.02 I-10", Status::ArcSpecification),
        ("G2 X0 Y-200000 I200000", Status::ArcSpecification),
        ("G2 X0 Y10 I-214748", Status::ArcSpecification),
    ] {
        assert_eq!(refusal(&[AT_10_0, line]), status, "{line}");
    }
    // Small circles: a radius of 1 um, and a case from a real program.
    assert_eq!(center(&[AT_10_0, "G2 X10.002 R0.001"]), [100_010, 0]);
    run(&["F1 G20 G0 X0.00392 Y0.000795", "G2 R0.002 X0.00199 Y0.0002"]);
    // The radii may differ by 5 um, or by a thousandth of the radius up to 1 mm.
    run(&[AT_10_0, "G3 X0 Y10.0049 I-10"]);
    run(&["F1 G0 X500", "G3 X0 Y500.4 I-500"]);
    assert_eq!(refusal(&["F1 G0 X5000", "G3 X0 Y5002 I-5000"]), Status::ArcSpecification);
}

#[test]
fn a_refused_arc_leaves_no_trace() {
    refusal(&["G0 X1", "G18 F5 G2 X5 Z5 R1"]);
    refusal(&["F5 G2 X2 I1", "G91 G92.1 X5 I1"]);
}

#[test]
fn circles_stay_within_the_range_of_lengths() {
    assert_eq!(refusal(&["F800", "G3 Y3 I131515.5"]), Status::OutOfRange);
    assert_eq!(refusal(&["F800 G0 X200000", "G3 J15000"]), Status::OutOfRange);
    // The far side of the circle counts only if the arc reaches it.
    run(&["F800", "G2 Y3 I131515.5"]);
    run(&["F800 G0 X200000", "G3 J14000"]);
}
