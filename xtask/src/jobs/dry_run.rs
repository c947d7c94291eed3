//! Computes where a job goes and the least time that it takes.

use std::f64::consts::TAU;

/// The highest feed, mm/min.
const FASTEST: f64 = 800.0;

/// The result of a dry run.
pub struct DryRun {
    /// Number of lines without the comment lines.
    pub lines: usize,
    /// Number of arcs.
    pub arcs: usize,
    /// Least and greatest position.
    pub x: (f64, f64),
    /// Least and greatest position.
    pub y: (f64, f64),
    /// Least and greatest position.
    pub z: (f64, f64),
    /// Least and greatest feed.
    pub feed: (f64, f64),
    /// Time without ramps, s.
    pub seconds: f64,
    /// The largest distance of an arc's end from its circle.
    pub radius_error: f64,
}

/// Reads the words that the examples use. Any other word is an error in the example.
pub fn dry_run(job: &str) -> DryRun {
    let nowhere = (f64::INFINITY, f64::NEG_INFINITY);
    let mut run = DryRun {
        lines: 0,
        arcs: 0,
        x: nowhere,
        y: nowhere,
        z: nowhere,
        feed: nowhere,
        seconds: 0.0,
        radius_error: 0.0,
    };
    let (mut at, mut feed) = ([0.0; 3], 0.0);
    for line in job.lines().filter(|line| !line.starts_with('(')) {
        run.lines += 1;
        let words: Vec<_> = line.split(' ').map(|w| (&w[..1], w[1..].parse().unwrap())).collect();
        let word = |letter| words.iter().find(|w| w.0 == letter).map(|w| w.1);
        let motion: f64 = word("G").unwrap_or(-1.0);
        let to = ["X", "Y", "Z"].map(word);
        let to: [f64; 3] = std::array::from_fn(|axis| to[axis].unwrap_or(at[axis]));
        if let Some(value) = word("F") {
            feed = value;
            widen(&mut run.feed, feed);
        }
        let length = match motion {
            2.0 | 3.0 => {
                run.arcs += 1;
                let offset = [word("I").unwrap(), word("J").unwrap()];
                let (length, error) = arc(at, to, offset, motion == 3.0);
                run.radius_error = run.radius_error.max(error);
                length
            }
            0.0 | 1.0 => distance(at, to),
            4.0 => {
                run.seconds += word("P").unwrap();
                0.0
            }
            21.0 | -1.0 => 0.0,
            other => panic!("G{other} in an example"),
        };
        let speed = if motion == 0.0 { FASTEST } else { feed.min(FASTEST) };
        if length > 0.0 {
            run.seconds += length / speed * 60.0;
        }
        at = to;
        widen(&mut run.x, at[0]);
        widen(&mut run.y, at[1]);
        widen(&mut run.z, at[2]);
    }
    run
}

fn widen(range: &mut (f64, f64), value: f64) {
    *range = (range.0.min(value), range.1.max(value));
}

fn distance(from: [f64; 3], to: [f64; 3]) -> f64 {
    from.iter().zip(to).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Returns the length of an arc, and the difference of its two radii.
fn arc(from: [f64; 3], to: [f64; 3], offset: [f64; 2], counter_clockwise: bool) -> (f64, f64) {
    let end = [to[0] - from[0] - offset[0], to[1] - from[1] - offset[1]];
    let radius = offset[0].hypot(offset[1]);
    let sweep = end[1].atan2(end[0]) - (-offset[1]).atan2(-offset[0]);
    let sweep = if counter_clockwise { sweep } else { -sweep }.rem_euclid(TAU);
    // An angle just below a full turn is a rounding error of 0.
    let sweep = if sweep > TAU - 1e-3 { 0.0 } else { sweep };
    (sweep * radius, (end[0].hypot(end[1]) - radius).abs())
}
