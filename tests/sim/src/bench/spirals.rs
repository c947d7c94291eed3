//! Jobs of 2,000 short moves along a spiral at 6,000 mm/min: time from the first step to the last, over
//! the ideal. The ideal is unlimited look-ahead with trapezoids: way / v + v / a.

use std::fmt::Write;

use anyhow::Result;

use super::Figure;
use super::workload::{ACCELERATION, Bed, FAST_BAUD, How};
use crate::report::Report;

const MOVES: u32 = 2_000;
/// mm/min.
const FEED: f64 = 6_000.0;
/// Where the spiral begins, mm from its centre: wide enough for no corner to limit the feed.
const RADIUS: f64 = 30.0;
/// Radial distance of two turns, mm.
const PITCH: f64 = 1.0;

/// Moves of 0.1 mm at the usual speed of the line.
pub fn tenth(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.1, How::default())
}

/// Moves of 0.2 mm.
pub fn fifth(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.2, How::default())
}

/// Moves of 0.5 mm.
pub fn half(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.5, How::default())
}

/// Moves of 0.1 mm on a fast line.
pub fn tenth_fast(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.1, fast())
}

/// Moves of 0.2 mm on a fast line.
pub fn fifth_fast(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.2, fast())
}

/// Moves of 0.5 mm on a fast line.
pub fn half_fast(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.5, fast())
}

/// Moves of 0.1 mm with a low jerk limit.
pub fn tenth_jerk(bed: &Bed) -> Result<Figure> {
    over_ideal(bed, 0.1, How { jerk: true, ..How::default() })
}

fn fast() -> How {
    How { baud: FAST_BAUD, ..How::default() }
}

fn over_ideal(bed: &Bed, chord: f64, how: How) -> Result<Figure> {
    let (_, report) = bed.run(&spiral(chord), how)?;
    let velocity = FEED / 60.0;
    let ideal = f64::from(MOVES) * chord / velocity + velocity / ACCELERATION;
    let value = report.seconds_moving / ideal;
    Ok(Figure { value, note: format!("{:.0} lines/s", lines_per_second(&report)) })
}

/// Lines that were answered in a second.
pub fn lines_per_second(report: &Report) -> f64 {
    report.acknowledged as f64 / report.seconds_to_answer
}

/// The job. It begins where the machine stands, at 0.
pub fn spiral(chord: f64) -> String {
    let mut job = format!("G1 F{FEED}\n");
    let mut angle = 0.0f64;
    let mut at = (0.0, 0.0);
    for _ in 0..MOVES {
        angle += step(angle, at, chord);
        at = point(angle);
        let _ = writeln!(job, "G1X{:.3}Y{:.3}", at.0, at.1);
    }
    job
}

/// The angle of one chord on, by bisection.
fn step(angle: f64, from: (f64, f64), chord: f64) -> f64 {
    let (mut low, mut high) = (0.0, 2.0 * chord / RADIUS);
    for _ in 0..40 {
        let middle = f64::midpoint(low, high);
        let to = point(angle + middle);
        let short = (to.0 - from.0).hypot(to.1 - from.1) < chord;
        *(if short { &mut low } else { &mut high }) = middle;
    }
    low
}

fn point(angle: f64) -> (f64, f64) {
    let radius = RADIUS + PITCH * angle / std::f64::consts::TAU;
    (radius * angle.cos() - RADIUS, radius * angle.sin())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_move_is_a_chord() {
        for chord in [0.1, 0.5] {
            let (mut at, mut count) = ((0.0, 0.0), 0);
            for line in spiral(chord).lines().skip(1) {
                let (x, y) = line.strip_prefix("G1X").and_then(|l| l.split_once('Y')).unwrap();
                let to: (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
                let length = (to.0 - at.0).hypot(to.1 - at.1);
                assert!((length - chord).abs() < 2e-3, "{length}");
                (at, count) = (to, count + 1);
            }
            assert_eq!(count, MOVES);
        }
    }
}
