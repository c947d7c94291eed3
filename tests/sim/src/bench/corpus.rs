//! Jobs whose corners, curves and slopes demand much of the limits of axes. All begin at 0, in mm.

use std::f64::consts::TAU;
use std::fmt::Write;

use super::pauses::{SPIRAL, SQUARE};
use super::workload::{arcs, braid, pocket};

/// Returns the jobs with their names.
pub fn jobs() -> Vec<(&'static str, String)> {
    vec![
        ("braid-0.1", braid(0.1, 3_000.0)),
        ("braid-0.33", braid(0.33, 5_000.0)),
        ("zigzag", zigzag()),
        ("raster", raster()),
        ("pocket", pocket()),
        ("slots", slots()),
        ("arcs", arcs()),
        ("spiral", SPIRAL.to_string()),
        ("finish", finish()),
        ("infill", infill()),
        ("square", SQUARE.to_string()),
    ]
}

/// Lines to and fro at acute angles, from 0.3 mm to 12 mm long.
fn zigzag() -> String {
    let mut job = String::from("G64 G1 F5000\n");
    let (mut y, mut reach) = (0.0, 0.3);
    for n in 0..60 {
        y += 0.15 * reach;
        let x = if n % 2 == 0 { reach } else { 0.0 };
        let _ = writeln!(job, "G1 X{x:.3} Y{y:.3}");
        reach *= 1.065;
    }
    job + "G0 X0 Y0\n"
}

/// Rows of 20 mm, 0.4 mm apart.
fn raster() -> String {
    let mut job = String::from("G64 G1 F5000\n");
    for row in 0..24 {
        let (x, y) = (if row % 2 == 0 { 20.0 } else { 0.0 }, 0.4 * f64::from(row));
        let _ = writeln!(job, "G1 X{x} Y{y:.1}\nG1 Y{:.1}", y + 0.4);
    }
    job + "G0 X0 Y0\n"
}

/// Slots with round ends, each entered along a ramp and left upwards.
fn slots() -> String {
    const LENGTH: f64 = 14.0;
    let mut job = String::from("G17 G64 G0 Z1\n");
    for n in 0..5 {
        let (y, radius) = (6.0 * f64::from(n), 0.4 + 0.5 * f64::from(n));
        let _ = writeln!(job, "G0 X0 Y{y:.2}\nG1 Z0 F400\nG1 X{LENGTH} Z-0.6 F3000");
        let (low, high) = (y, y + 2.0 * radius);
        let _ = writeln!(job, "G3 X{LENGTH} Y{high:.2} I0 J{radius:.2}\nG1 X0");
        let _ = writeln!(job, "G3 X0 Y{low:.2} I0 J{:.2}\nG1 X{LENGTH}\nG1 Z-1.2 F400", -radius);
        let _ = writeln!(job, "G1 X0 F3000\nG0 Z1");
    }
    job + "G0 X0 Y0 Z0\n"
}

/// Rows over a wavy surface in lines of about 0.3 mm, as CAM programs write them.
fn finish() -> String {
    let height = |x: f64, y: f64| 0.8 * (0.9 * x).sin() * (0.7 * y).cos() + 0.4 * (2.3 * x).cos();
    let mut job = String::from("G64 G1 F2400\n");
    for row in 0..8 {
        let y = 0.5 * f64::from(row);
        for n in 0..=70 {
            let along = 0.3 * f64::from(n);
            let x = if row % 2 == 0 { along } else { 21.0 - along };
            let _ = writeln!(job, "G1 X{x:.3} Y{y:.3} Z{:.3}", height(x, y));
        }
    }
    job + "G0 Z2\nG0 X0 Y0\nG0 Z0\n"
}

/// A layer as slicers write it: two outlines of many sides, and a zigzag at 45 degrees within.
fn infill() -> String {
    const SIDES: u32 = 40;
    const STEP: f64 = 0.6;
    let mut job = String::from("G64\n");
    for radius in [12.0, 11.6] {
        for n in 0..=SIDES {
            let (sin, cos) = (TAU * f64::from(n) / f64::from(SIDES)).sin_cos();
            let code = if n == 0 { "G0" } else { "G1 F3600" };
            let _ = writeln!(job, "{code} X{:.3} Y{:.3}", radius * cos, radius * sin);
        }
    }
    // Chords of a circle of 11 mm, at distances from -10.5 mm on; each goes the other way than the one before it.
    for n in 0..36 {
        let off = STEP * f64::from(n) - 10.5;
        let half = (121.0 - off * off).sqrt();
        let ends = if n % 2 == 0 { [-half, half] } else { [half, -half] };
        for along in ends {
            let (x, y) = ((along - off) / 2f64.sqrt(), (along + off) / 2f64.sqrt());
            let _ = writeln!(job, "G1 X{x:.3} Y{y:.3} F5000");
        }
    }
    job + "G0 X0 Y0\n"
}
