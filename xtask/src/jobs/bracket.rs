//! The main example: a mounting bracket of 60 by 40 by 4 mm, cut with a 3 mm tool.
//!
//! Positions are relative to the part's lower left corner. The tool radius is included.

use super::program::{Point, Program, on_circle};

/// The part's corner on the machine.
const ORIGIN: Point = (20.0, 20.0);
const SAFE: f64 = 2.0;

/// The whole program.
pub fn job() -> String {
    let mut p = Program::new("Mounting bracket 60 x 40 x 4 mm, 3 mm tool, zero at the top face");
    p.rapid_z(SAFE);
    scale(&mut p);
    holes(&mut p);
    bearing_seat(&mut p);
    for y in [12.0, 28.0] {
        slot(&mut p, y);
    }
    trochoidal_slot(&mut p);
    outline(&mut p);
    p.note("park");
    p.rapid_z(10.0);
    p.rapid((0.0, 0.0));
    p.line("M30");
    p.text()
}

fn at(x: f64, y: f64) -> Point {
    (ORIGIN.0 + x, ORIGIN.1 + y)
}

/// Returns the numbers from 0 up to `count`, exclusive.
fn upto(count: u8) -> impl Iterator<Item = f64> {
    (0..count).map(f64::from)
}

/// Marks along the right edge, every fifth a longer one.
fn scale(p: &mut Program) {
    p.note("scale: 16 marks, 0.2 deep");
    for mark in upto(16) {
        let y = 15.5 + 0.6 * mark;
        let length = if mark % 5.0 == 0.0 { 4.0 } else { 2.5 };
        p.rapid(at(58.0, y));
        p.plunge(-0.2, 400.0);
        p.cut_at(at(58.0 - length, y), 600.0);
        p.rapid_z(0.5);
    }
    p.rapid_z(SAFE);
}

fn holes(p: &mut Program) {
    let corners = [(5.0, 5.0), (55.0, 5.0), (55.0, 35.0), (5.0, 35.0)];
    let circle = upto(6).map(|n| on_circle((20.0, 20.0), 12.0, 210.0 - 60.0 * n));
    for (n, (x, y)) in corners.into_iter().chain(circle).enumerate() {
        p.note(&format!("hole {}", n + 1));
        p.rapid(at(x, y));
        peck(p);
    }
}

/// Drills in four pecks, and retracts after each to clear chips.
fn peck(p: &mut Program) {
    const BITES: [f64; 4] = [-1.2, -2.4, -3.6, -4.8];
    p.rapid_z(0.5);
    for (n, depth) in BITES.into_iter().enumerate() {
        if n > 0 {
            p.rapid_z(BITES[n - 1] + 0.3);
        }
        p.plunge(depth, 300.0);
        if n == BITES.len() - 1 {
            p.wait(0.1);
        }
        p.rapid_z(0.5);
    }
    p.rapid_z(SAFE);
}

/// A round pocket, cut in rings from the inside outwards.
fn bearing_seat(p: &mut Program) {
    let centre = at(20.0, 20.0);
    p.note("bearing seat, 17 mm wide, 3 deep");
    p.rapid(centre);
    p.rapid_z(0.5);
    for depth in [-1.0, -2.0, -3.0] {
        p.note(&format!("seat at {depth}"));
        p.cut_at(centre, 700.0);
        p.plunge(depth, 300.0);
        for radius in [1.5, 3.0, 4.5, 6.0, 7.0] {
            let (right, left) = ((centre.0 + radius, centre.1), (centre.0 - radius, centre.1));
            p.cut_at(right, 700.0);
            p.arc(right, left, centre, true);
            p.arc(left, right, centre, true);
        }
    }
    p.rapid_z(SAFE);
}

/// A slot of 6 mm between centres, 5 mm wide.
fn slot(p: &mut Program, y: f64) {
    let (left, right, radius) = (46.0, 52.0, 1.0);
    p.note(&format!("slot at Y{}", ORIGIN.1 + y));
    p.rapid(at(left, y - radius));
    p.rapid_z(0.5);
    for depth in [-1.5, -3.0, -4.5] {
        p.plunge(depth, 300.0);
        p.cut_at(at(right, y - radius), 600.0);
        p.arc(at(right, y - radius), at(right, y + radius), at(right, y), true);
        p.cut(at(left, y + radius));
        p.arc(at(left, y + radius), at(left, y - radius), at(left, y), true);
    }
    p.rapid_z(SAFE);
}

/// Circles that move forward slowly, so that the tool never cuts with its full width.
fn trochoidal_slot(p: &mut Program) {
    const RADIUS: f64 = 1.5;
    for (depth, feed) in [(-2.25, 750.0), (-4.5, 650.0)] {
        p.note(&format!("trochoidal slot at {depth}"));
        p.rapid(at(40.0 + RADIUS, 14.0));
        p.rapid_z(0.5);
        p.plunge(depth, 300.0);
        for loop_ in upto(25) {
            let y = 14.0 + 0.5 * loop_;
            let (right, left) = (at(40.0 + RADIUS, y), at(40.0 - RADIUS, y));
            p.cut_at(right, feed);
            p.arc(right, left, at(40.0, y), true);
            p.arc(left, right, at(40.0, y), true);
        }
        p.rapid_z(SAFE);
    }
}

/// Clockwise around the part, with round corners and five notches in each long side.
fn outline(p: &mut Program) {
    p.note("outline");
    p.rapid(at(-1.5, 20.0));
    p.rapid_z(0.5);
    for depth in [-1.5, -3.0, -4.5] {
        p.note(&format!("outline at {depth}"));
        p.plunge(depth, 300.0);
        p.cut_at(at(-1.5, 34.0), 800.0);
        p.arc(at(-1.5, 34.0), at(6.0, 41.5), at(6.0, 34.0), false);
        edge(p, 41.5, 1.0);
        p.cut(at(54.0, 41.5));
        p.arc(at(54.0, 41.5), at(61.5, 34.0), at(54.0, 34.0), false);
        p.cut(at(61.5, 6.0));
        p.arc(at(61.5, 6.0), at(54.0, -1.5), at(54.0, 6.0), false);
        edge(p, -1.5, -1.0);
        p.cut(at(6.0, -1.5));
        p.arc(at(6.0, -1.5), at(-1.5, 6.0), at(6.0, 6.0), false);
        p.cut(at(-1.5, 20.0));
    }
    p.rapid_z(SAFE);
}

/// The notches of a long side, to the right (1) or to the left (-1).
fn edge(p: &mut Program, y: f64, direction: f64) {
    const RADIUS: f64 = 2.0;
    for notch in upto(5) {
        let x = 30.0 + direction * 7.5 * (notch - 2.0);
        let (first, last) = (at(x - direction * RADIUS, y), at(x + direction * RADIUS, y));
        p.cut(first);
        p.arc(first, last, at(x, y), true);
    }
}
