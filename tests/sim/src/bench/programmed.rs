//! The path that a job programs, and how far the tool is from it.
//!
//! The reader knows what the jobs of [`corpus`](super::corpus) have: lines and arcs in the plane of X and Y, absolute,
//! in mm. Anything else is an error.

use std::f64::consts::TAU;

use anyhow::{Context, Result, bail, ensure};

use crate::oracle::{Word, split};

/// A place of the tool, mm.
pub type Place = [f64; 3];

/// How far a chord of an arc may be off the arc, mm.
const SAGITTA: f64 = 0.000_5;
/// Number of stretches that are passed over together if their box is too far.
const BOX: usize = 32;

/// A path of straight stretches.
pub struct Path {
    corners: Vec<Place>,
}

impl Path {
    /// Reads a job that begins at 0.
    pub fn of(job: &str) -> Result<Self> {
        let mut reader = Reader { code: 0, corners: vec![Place::default()] };
        for line in job.lines() {
            let words = split(line).map_err(|what| anyhow::anyhow!("{what} in {line}"))?;
            reader.line(&words).with_context(|| line.to_string())?;
        }
        Ok(Path { corners: reader.corners })
    }

    /// Returns the greatest distance of places from the path, mm, and the number of that place.
    pub fn farthest(&self, places: &[Place]) -> (f64, usize) {
        let boxes: Vec<_> = (0..self.corners.len())
            .step_by(BOX)
            .map(|from| Bounds::of(&self.corners[from..self.corners.len().min(from + BOX + 1)]))
            .collect();
        let distances = places.iter().map(|place| self.distance(*place, &boxes));
        let farthest = distances.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        farthest.map_or((0.0, 0), |(n, distance)| (distance, n))
    }

    /// Returns the distance of a place from the nearest stretch.
    fn distance(&self, place: Place, boxes: &[Bounds]) -> f64 {
        let mut nearest = f64::INFINITY;
        for (n, bounds) in boxes.iter().enumerate() {
            if bounds.distance(place) >= nearest {
                continue;
            }
            let to = self.corners.len().min((n + 1) * BOX + 1);
            let stretches = self.corners[n * BOX..to].windows(2);
            nearest = stretches.map(|s| distance(place, s[0], s[1])).fold(nearest, f64::min);
        }
        nearest
    }
}

/// The box around some corners.
struct Bounds {
    low: Place,
    high: Place,
}

impl Bounds {
    fn of(corners: &[Place]) -> Self {
        let along = |axis: usize| corners.iter().map(move |corner| corner[axis]);
        Bounds {
            low: std::array::from_fn(|axis| along(axis).fold(f64::INFINITY, f64::min)),
            high: std::array::from_fn(|axis| along(axis).fold(f64::NEG_INFINITY, f64::max)),
        }
    }

    fn distance(&self, place: Place) -> f64 {
        let off = |axis: usize| {
            (self.low[axis] - place[axis]).max(place[axis] - self.high[axis]).max(0.0)
        };
        (0..3).map(|axis| off(axis).powi(2)).sum::<f64>().sqrt()
    }
}

/// Distance of a place from the stretch between two others.
fn distance(place: Place, from: Place, to: Place) -> f64 {
    let way: Place = std::array::from_fn(|axis| to[axis] - from[axis]);
    let off: Place = std::array::from_fn(|axis| place[axis] - from[axis]);
    let dot = |a: Place, b: Place| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let share = match dot(way, way) {
        0.0 => 0.0,
        square => (dot(off, way) / square).clamp(0.0, 1.0),
    };
    let rest: Place = std::array::from_fn(|axis| off[axis] - share * way[axis]);
    dot(rest, rest).sqrt()
}

struct Reader {
    /// The motion mode: 0 to 3.
    code: i64,
    corners: Vec<Place>,
}

impl Reader {
    fn line(&mut self, words: &[Word]) -> Result<()> {
        let mut to = self.corners[self.corners.len() - 1];
        let (mut centre, mut turns, mut moves) = ([0.0; 2], 1.0, false);
        for word in words {
            let value = word.number();
            match word.letter {
                'G' => match word.value.tenths() {
                    code @ (0 | 10 | 20 | 30) => self.code = code / 10,
                    170 | 210 | 640 | 900 | 940 => {}
                    _ => bail!("G{value} is not known here"),
                },
                'X' | 'Y' | 'Z' => {
                    to[usize::from(word.letter as u8 - b'X')] = value;
                    moves = true;
                }
                'I' => centre[0] = value,
                'J' => centre[1] = value,
                'P' => turns = value,
                'F' | 'N' | 'M' => {}
                other => bail!("{other} is not known here"),
            }
        }
        match self.code {
            _ if !moves => {}
            0 | 1 => self.corners.push(to),
            code => self.arc(to, centre, turns, code == 3)?,
        }
        Ok(())
    }

    /// Adds the chords of an arc or helix.
    fn arc(&mut self, to: Place, [i, j]: [f64; 2], turns: f64, left: bool) -> Result<()> {
        let from = self.corners[self.corners.len() - 1];
        let (centre, radius) = ([from[0] + i, from[1] + j], i.hypot(j));
        ensure!(radius > 0.0, "an arc without a centre");
        let begin = (-j).atan2(-i);
        let end = (to[1] - centre[1]).atan2(to[0] - centre[0]);
        let once = if left { end - begin } else { begin - end }.rem_euclid(TAU);
        // An arc that ends where it begins is a whole circle.
        let once = if once < 1e-6 { TAU } else { once };
        let sweep = once + TAU * (turns - 1.0);
        let chords = (sweep / (8.0 * SAGITTA / radius).sqrt()).ceil().max(1.0) as u32;
        for n in 1..chords {
            let share = f64::from(n) / f64::from(chords);
            let turned = if left { begin + share * sweep } else { begin - share * sweep };
            let (sin, cos) = turned.sin_cos();
            let z = from[2] + share * (to[2] - from[2]);
            self.corners.push([centre[0] + radius * cos, centre[1] + radius * sin, z]);
        }
        self.corners.push(to);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::corpus;
    use super::*;

    #[test]
    fn distances_from_lines_and_arcs() {
        let path = Path::of("G1 X10 F100\nG3 X10 Y10 I0 J5\nG1 X0 Z2").unwrap();
        let near = |place, want: f64| {
            let (off, _) = path.farthest(&[place]);
            assert!((off - want).abs() < 2.0 * SAGITTA, "{place:?}: {off}");
        };
        near([5.0, 1.0, 0.0], 1.0);
        near([15.0, 5.0, 0.0], 0.0);
        near([10.0, 5.0, 0.0], 5.0);
        near([0.0, 10.0, 3.0], 1.0);
        near([-3.0, 0.0, 4.0], 5.0);
    }

    #[test]
    fn a_helix_has_its_turns() {
        let path = Path::of("G2 Z-3 I2 J0 P3").unwrap();
        let (off, _) = path.farthest(&[[0.0, 0.0, -1.0], [4.0, 0.0, -1.5], [2.0, 2.0, -0.25]]);
        assert!(off < 2.0 * SAGITTA, "{off}");
    }

    #[test]
    fn every_job_of_the_corpus_is_read() {
        for (name, job) in corpus::jobs() {
            let path = Path::of(&job).unwrap_or_else(|e| panic!("{name}: {e:#}"));
            assert!(path.corners.len() > 8, "{name}");
            assert!(path.farthest(&path.corners).0 < 1e-9, "{name}");
        }
    }

    #[test]
    fn what_is_not_known_is_an_error() {
        assert!(Path::of("G91 X1").is_err());
        assert!(Path::of("G38.2 X1").is_err());
    }
}
