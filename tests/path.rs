//! How near the emitted steps keep to the programmed path, and how evenly they come where one block follows another.

#[allow(dead_code, reason = "each test uses a part")]
#[path = "support/rig.rs"]
mod rig;

use kerf::boards::MOTORS;
use kerf::units::{Length, PerAxis};
use rig::{Config, Rig, at};

/// Steps in a unit of length: `Config` has 80 a mm.
const STEPS: f64 = 1.0 / 125.0;

type Point = [f64; MOTORS];

/// A random number from 0 to 1, of a linear congruence.
struct Random(u64);

impl Random {
    fn part(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.part())
    }
}

/// What a path is made of.
#[derive(Clone, Copy, Debug)]
struct Kind {
    axes: usize,
    /// The way of each line, mm: the least, and the most.
    way: (f64, f64),
    /// How far a line may turn from the one before, rad.
    turn: f64,
}

/// Off the path: the most and the root of the mean square, steps.
#[derive(Clone, Copy, Debug, Default)]
struct Off {
    most: f64,
    square: f64,
    count: f64,
}

impl Off {
    fn add(&mut self, off: f64) {
        self.most = self.most.max(off);
        self.square += off * off;
        self.count += 1.0;
    }

    fn rms(&self) -> f64 {
        (self.square / self.count).sqrt()
    }
}

/// How far a point is off a line.
fn distance(point: &Point, a: &Point, b: &Point) -> f64 {
    let along: Point = std::array::from_fn(|m| b[m] - a[m]);
    let off: Point = std::array::from_fn(|m| point[m] - a[m]);
    let square: f64 = along.iter().map(|x| x * x).sum();
    let product: f64 = along.iter().zip(&off).map(|(a, b)| a * b).sum();
    let part = if square > 0.0 { (product / square).clamp(0.0, 1.0) } else { 0.0 };
    (0..MOTORS).map(|m| (off[m] - along[m] * part).powi(2)).sum::<f64>().sqrt()
}

/// Points of a random path, from the origin on.
fn path(random: &mut Random, kind: &Kind, lines: usize) -> Vec<PerAxis<Length>> {
    let mut place = [0.0; MOTORS];
    let mut heading: Point = std::array::from_fn(|_| random.part() - 0.5);
    let mut points = Vec::new();
    for _ in 0..lines {
        let way = random.between(kind.way.0, kind.way.1);
        for heading in &mut heading {
            *heading += kind.turn * (random.part() - 0.5);
        }
        let size = heading[..kind.axes].iter().map(|x| x * x).sum::<f64>().sqrt();
        for (place, heading) in place.iter_mut().zip(&mut heading).take(kind.axes) {
            *heading /= size;
            *place += *heading * way;
        }
        points.push(at(place));
    }
    points
}

/// Runs a path, and measures after each tick in which a motor steps.
fn off(points: &[PerAxis<Length>], velocity: f32, accel: f32, jerk: f32) -> Off {
    let mut rig = Rig::new(Config::new(500.0, accel, jerk));
    rig.pins.keep_trail = true;
    let mut ideal = vec![[0.0; MOTORS]];
    for (n, to) in points.iter().enumerate() {
        while rig.free() == 0 {
            rig.turn();
        }
        rig.line(*to, velocity, n as u32 + 1);
        ideal.push(std::array::from_fn(|m| f64::from(to[m].0) * STEPS));
    }
    rig.finish();
    assert_eq!(rig.pins.position, rig.target());
    let mut off = Off::default();
    let mut near = 0;
    for point in &rig.pins.trail {
        let point = point.map(|x| x as f64);
        let to = |n: usize| distance(&point, &ideal[n], &ideal[n + 1]);
        // No loop of a path is so small that a later part of it could be taken for this one.
        let last = (near + 4).min(ideal.len() - 2);
        let best = (near..=last).min_by(|a, b| to(*a).total_cmp(&to(*b))).unwrap();
        off.add(to(best));
        near = best;
    }
    off
}

/// The worst of several.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    most: f64,
    rms: f64,
}

impl Worst {
    fn add(&mut self, off: Off) {
        self.most = self.most.max(off.most);
        self.rms = self.rms.max(off.rms());
    }
}

/// Short and long lines of so many axes, with corners and almost without, slow and fast.
fn lines(axes: usize) -> Worst {
    let mut random = Random(axes as u64);
    let mut worst = Worst::default();
    for way in [(0.05, 0.2), (0.2, 1.0), (1.0, 5.0)] {
        for turn in [0.1, 1.0] {
            for velocity in [10.0, 60.0, 300.0] {
                let points = path(&mut random, &Kind { axes, way, turn }, 400);
                worst.add(off(&points, velocity, 5_000.0, 0.0));
                worst.add(off(&points, velocity, 5_000.0, 1e6));
            }
        }
    }
    worst
}

/// The chords of circles.
fn circles() -> Worst {
    let mut worst = Worst::default();
    for (radius, turn) in [(0.5, 0.3), (3.0, 0.1), (20.0, 0.03)] {
        for velocity in [5.0, 50.0, 200.0] {
            let place = |n: u16| {
                let angle = turn * f64::from(n);
                at([radius * angle.sin(), radius * (1.0 - angle.cos())])
            };
            let points: Vec<_> = (1..=400).map(place).collect();
            worst.add(off(&points, velocity, 5_000.0, 0.0));
        }
    }
    worst
}

/// The best that steps of two motors can do: half a step each is 0.71 from a line between, and evenly spread 0.29
/// (`1 / sqrt 12`) from it; of three and four that is 0.41 and 0.5.
#[test]
fn steps_keep_to_the_path() {
    let worst = [lines(2), lines(3), lines(4), circles()];
    let most = [(1.4, 0.47), (1.6, 0.61), (1.75, 0.73), (1.4, 0.45)];
    println!("{worst:#?}");
    for (worst, (most, rms)) in worst.iter().zip(most) {
        assert!(worst.most <= most && worst.rms <= rms, "{worst:?} of {most}, {rms}");
    }
}
