//! Threading cycles, line by line.

use super::run;
use crate::gcode::steps::{Step, Steps};
use std::format;
use std::string::String;
use std::vec::Vec;

/// Returns X and Z of all moves of the last of these lines: traverses in upper case, lines of a pass in lower case with
/// their lead.
fn told(lines: &[&str]) -> String {
    let (before, _) = run(&lines[..lines.len() - 1]);
    let (after, out) = run(lines);
    let mut at = *before.position();
    let mut steps = Steps::default();
    let mut told = Vec::new();
    let mm = |length: i32| f64::from(length) / 1e4;
    while let Some(step) = steps.next(&out, &at) {
        match step {
            Step::AwaitSpindle => told.push("wait".into()),
            Step::Line(to, _) => {
                at = to;
                told.push(format!("X{} Z{}", mm(at[0].0), mm(at[2].0)));
            }
            Step::Thread => {
                for line in 0.. {
                    let Some((to, lead)) = steps.pass(&out.motion, &at, line) else { break };
                    at = to;
                    told.push(format!("x{} z{} k{}", mm(at[0].0), mm(at[2].0), mm(lead.0)));
                }
            }
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(&at, after.position());
    told.join(", ")
}

#[test]
fn an_outer_thread_goes_inwards() {
    assert_eq!(
        told(&["G0 X5 Z2", "G76 P1 Z-10 I-1 J0.3 K0.6 H1"]),
        "wait, X3.7 Z2, x3.7 z-10 k1, X5 Z-10, X5 Z2, X3.4 Z2, x3.4 z-10 k1, X5 Z-10, X5 Z2, X3.4 Z2, \
         x3.4 z-10 k1, X5 Z-10"
    );
}

#[test]
fn an_inner_thread_goes_outwards_and_any_way_along_z() {
    assert_eq!(
        told(&["G0 X5 Z-10", "G91 G76 P1 Z12 I1 J0.6 K0.5"]),
        "wait, X6.5 Z-10, x6.5 z2 k1, X5 Z2"
    );
}

#[test]
fn the_area_of_chips_is_alike_with_r2() {
    assert_eq!(told(&["G0 X5 Z2", "G76 P1 Z-10 I-1 J0.3 K0.6 R2"]).matches("k1").count(), 4);
    let second = told(&["G0 X5 Z2", "G76 P1 Z-10 I-1 J0.3 K0.6 R2"]);
    // The second pass is 0.3 times the root of 2 deep.
    assert!(second.contains("x3.5758 z-10"), "{second}");
}

#[test]
fn passes_slide_along_the_flank_and_have_tapers() {
    assert_eq!(
        told(&["G0 X5 Z2", "G76 P1 Z-10 I-1 J0.6 K0.6 Q45 E2 L3"]),
        "wait, X5 Z1.4, X4 Z1.4, x3.4 z-0.6 k1, x3.4 z-8 k1, x4 z-10 k1, X5 Z-10"
    );
    assert_eq!(
        told(&["G0 X5 Z2", "G76 P1 Z-10 I-1 J0.6 K0.6 E0.3 L2"]),
        "wait, X3.4 Z2, x3.4 z-9.7 k1, x4 z-10 k2, X5 Z-10"
    );
}

#[test]
fn diameters_are_halved() {
    assert_eq!(
        told(&["G7 G0 X10 Z2", "G76 P1 Z-10 I-2 J0.6 K1.2"]),
        told(&["G0 X5 Z2", "G76 P1 Z-10 I-1 J0.3 K0.6"])
    );
}
