//! Slow motion: short moves at low feeds, and a very slow plunge.

use super::program::{Point, Program};

/// Most length of one move, mm.
const STEP: f64 = 0.25;
const DEPTH: f64 = -0.05;
const ORIGIN: Point = (15.0, 15.0);
/// The strokes of each letter in a box of 4 by 6 mm.
const LETTERS: [&[&[Point]]; 4] = [
    &[&[(0.0, 0.0), (0.0, 6.0)], &[(4.0, 6.0), (0.0, 3.0), (4.0, 0.0)]],
    &[&[(4.0, 6.0), (0.0, 6.0), (0.0, 0.0), (4.0, 0.0)], &[(0.0, 3.0), (3.0, 3.0)]],
    &[
        &[(0.0, 0.0), (0.0, 6.0), (3.0, 6.0), (4.0, 5.0), (4.0, 4.0), (3.0, 3.0), (0.0, 3.0)],
        &[(2.0, 3.0), (4.0, 0.0)],
    ],
    &[&[(4.0, 6.0), (0.0, 6.0), (0.0, 0.0)], &[(0.0, 3.0), (3.0, 3.0)]],
];

/// The name, letter by letter.
pub fn job() -> String {
    let mut p = Program::new("Engraving: short moves at 60 to 120 mm/min, 0.05 mm deep");
    p.rapid_z(1.0);
    let mut feeds = [60.0, 80.0, 100.0, 120.0].into_iter().cycle();
    let mut plunges = std::iter::once(1.0).chain(std::iter::repeat(60.0));
    for (index, letter) in LETTERS.iter().enumerate() {
        p.note(&format!("letter {}", index + 1));
        let left = ORIGIN.0 + 5.5 * f64::from(u8::try_from(index).expect("four letters"));
        for stroke in *letter {
            let feed = feeds.next().expect("endless");
            let plunge = plunges.next().expect("endless");
            engrave(&mut p, stroke, (left, ORIGIN.1), feed, plunge);
        }
    }
    p.rapid((0.0, 0.0));
    p.line("M2");
    p.text()
}

fn engrave(p: &mut Program, stroke: &[Point], origin: Point, feed: f64, plunge: f64) {
    let place = |point: Point| (origin.0 + point.0, origin.1 + point.1);
    p.rapid(place(stroke[0]));
    p.plunge(0.0, 60.0);
    p.plunge(DEPTH, plunge);
    for (index, line) in stroke.windows(2).enumerate() {
        // Each straight part is a little faster than the part before it.
        let feed = (feed + 5.0 * f64::from(u8::try_from(index).expect("few parts"))).min(120.0);
        for (n, point) in pieces(line[0], line[1]).into_iter().enumerate() {
            if n == 0 { p.cut_at(place(point), feed) } else { p.cut(place(point)) }
        }
    }
    p.rapid_z(1.0);
}

/// Divides a straight line into equal moves of at most `STEP`.
fn pieces(from: Point, to: Point) -> Vec<Point> {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let mut count = 1.0;
    while dx.hypot(dy) / count > STEP {
        count += 1.0;
    }
    let mut points = Vec::new();
    let mut n = 0.0;
    while n < count {
        n += 1.0;
        points.push((from.0 + dx * n / count, from.1 + dy * n / count));
    }
    points
}
