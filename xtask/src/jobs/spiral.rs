//! Many short segments at a high feed, which need look-ahead.

use super::program::{Program, on_circle};

const SEGMENTS: u32 = 2000;
const CHORD: f64 = 0.1;
/// Radial distance between turns, mm.
const PITCH: f64 = 1.0;
const CENTRE: (f64, f64) = (20.0, 20.0);

/// An Archimedean spiral outwards, 2,000 chords of 0.1 mm.
pub fn job() -> String {
    let mut p = Program::new("A spiral of 2000 segments of 0.1 mm at 6000 mm/min");
    let mut degrees = 360.0;
    p.rapid(point(degrees));
    for segment in 0..SEGMENTS {
        degrees = next(degrees);
        let to = point(degrees);
        let feed = if segment == 0 { " F6000" } else { "" };
        p.line(&format!("G1 X{:.4} Y{:.4}{feed}", to.0, to.1));
    }
    p.line("M2");
    p.text()
}

fn point(degrees: f64) -> (f64, f64) {
    on_circle(CENTRE, PITCH * degrees / 360.0, degrees)
}

/// Finds, by bisection, the angle that is one chord further along the spiral.
fn next(from: f64) -> f64 {
    let start = point(from);
    let (mut low, mut high) = (from, from + 30.0);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        let to = point(middle);
        if (to.0 - start.0).hypot(to.1 - start.1) < CHORD { low = middle } else { high = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_chord_is_a_tenth() {
        let mut degrees = 360.0;
        for _ in 0..SEGMENTS {
            let (from, to) = (point(degrees), point(next(degrees)));
            let chord = (to.0 - from.0).hypot(to.1 - from.1);
            assert!((chord - CHORD).abs() < 1e-9, "{chord}");
            degrees = next(degrees);
        }
        assert!(job().lines().filter(|line| line.starts_with("G1")).count() == 2000);
    }
}
