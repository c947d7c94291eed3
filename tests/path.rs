//! How near the emitted steps keep to the programmed path, and how evenly they come where one block follows another.

use kerf::boards::MOTORS;
use kerf::config::StepRatio;
use kerf::dda::STEP;
use kerf::motion::exec::Step;
use kerf::units::{Length, PerAxis};

use crate::rig::{Config, Rig, at};

/// Steps in a unit of length: `Config` has 80 in a mm.
const STEPS: f64 = 1.0 / 125.0;

type Point = [f64; MOTORS];

/// A generator of random numbers from 0 to 1 (linear congruence).
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

/// The properties of a path.
#[derive(Clone, Copy, Debug)]
struct Kind {
    axes: usize,
    /// Length of each line, mm: least and most.
    way: (f64, f64),
    /// Most that a line may turn from the line before it, rad.
    turn: f64,
}

/// Distance from the path, steps: the largest, and the root mean square over time.
#[derive(Clone, Copy, Debug, Default)]
struct Off {
    most: f64,
    square: f64,
    time: f64,
}

impl Off {
    fn add(&mut self, off: f64, time: f64) {
        self.most = self.most.max(off);
        self.square += off * off * time;
        self.time += time;
    }

    fn rms(&self) -> f64 {
        (self.square / self.time).sqrt()
    }
}

/// Returns the distance of a point from a line.
fn distance(point: &Point, a: &Point, b: &Point) -> f64 {
    let along: Point = std::array::from_fn(|m| b[m] - a[m]);
    let off: Point = std::array::from_fn(|m| point[m] - a[m]);
    let square: f64 = along.iter().map(|x| x * x).sum();
    let product: f64 = along.iter().zip(&off).map(|(a, b)| a * b).sum();
    let part = if square > 0.0 { (product / square).clamp(0.0, 1.0) } else { 0.0 };
    (0..MOTORS).map(|m| (off[m] - along[m] * part).powi(2)).sum::<f64>().sqrt()
}

/// Returns the points of a random path that begins at the origin.
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

/// Runs a path, and measures how far the motors are from the nearest point of the path, whatever their planned place
/// at that time.
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
    for pair in rig.pins.trail.windows(2) {
        let [(point, from), (_, to)] = pair else { unreachable!() };
        let time = (to - from) as f64;
        let point = point.map(|x| x as f64);
        let to = |n: usize| distance(&point, &ideal[n], &ideal[n + 1]);
        // Loops of a path are large enough that no later part of it can be mistaken for this part.
        let last = (near + 4).min(ideal.len() - 2);
        let best = (near..=last).min_by(|a, b| to(*a).total_cmp(&to(*b))).unwrap();
        off.add(to(best), time);
        near = best;
    }
    off
}

/// The worst of several paths.
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

/// Short and long lines of `axes` axes, with sharp and slight corners, slow and fast.
fn lines(axes: usize) -> Worst {
    let mut random = Random(axes as u64);
    let mut worst = Worst::default();
    for way in [(0.05, 0.2), (0.2, 1.0), (1.0, 5.0)] {
        for turn in [0.1, 1.0] {
            for velocity in [10.0, 60.0, 300.0] {
                let points = path(&mut random, &Kind { axes, way, turn }, 400);
                worst.add(off(&points, velocity, 5_000.0, 0.0));
            }
        }
    }
    worst
}

/// Returns the ends of `chords` chords of a circle that begins at the origin; each turns by `turn`, rad.
fn circle(radius: f64, turn: f64, chords: u32) -> Vec<PerAxis<Length>> {
    let angles = (1..=chords).map(|n| turn * f64::from(n));
    angles.map(|angle| at([radius * angle.sin(), radius * (1.0 - angle.cos())])).collect()
}

/// The chords of circles.
fn circles() -> Worst {
    let mut worst = Worst::default();
    for (radius, turn) in [(0.5, 0.3), (3.0, 0.1), (20.0, 0.03)] {
        for velocity in [5.0, 50.0, 200.0] {
            worst.add(off(&circle(radius, turn, 400), velocity, 5_000.0, 0.0));
        }
    }
    worst
}

/// The error is near the error of rounding alone. Positions on these paths that are rounded to the nearest step at
/// all times are up to 0.71 steps off with two motors, 0.29 in the root mean square. Blocks that ended on whole steps
/// had 1.36.
#[test]
fn steps_keep_to_the_path() {
    let worst = [lines(2), lines(3), lines(4), circles()];
    let most = [(0.8, 0.32), (0.95, 0.43), (1.06, 0.52), (0.8, 0.32)];
    for (worst, (most, rms)) in worst.iter().zip(most) {
        assert!(worst.most <= most && worst.rms <= rms, "{worst:?} of {most}, {rms}");
    }
}

/// Means round corners. What they round grows with the acceleration: 41 um at a right angle that is passed at rest, at
/// 5,000 mm/s^2, and 4 um at 500. Corners within the means add up.
#[test]
fn means_round_corners_by_little() {
    let mut random = Random(7);
    for (accel, jerk, most) in [(500.0, 18_519.0, 4.5), (5_000.0, 1e6, 4.5)] {
        let mut worst = Worst::default();
        for way in [(0.05, 0.2), (0.2, 1.0), (1.0, 5.0)] {
            for turn in [0.1, 1.0] {
                for velocity in [10.0, 60.0, 300.0] {
                    let points = path(&mut random, &Kind { axes: 2, way, turn }, 400);
                    worst.add(off(&points, velocity, accel, jerk));
                }
            }
        }
        assert!(worst.most <= most, "{worst:?} of {most} steps at {accel} mm/s^2");
    }
}

/// A line too long for parts of a step makes up for the parts that the lines before it have left, even for motors
/// that it does not move.
#[test]
fn long_lines_end_exactly() {
    let mut random = Random(7);
    for _ in 0..3_000 {
        let mut rig = Rig::new(Config::new(1_000.0, 200_000.0, 0.0));
        rig.keep = false;
        let mut place = [0.0; MOTORS];
        for n in 0..4 {
            for place in &mut place {
                *place += (random.part() - 0.5) * 0.5;
            }
            rig.line(at(place), 300.0, n);
        }
        let axis = (random.part() * 4.0) as usize;
        place[axis] += if random.part() < 0.5 { 30.0 } else { -30.0 };
        rig.line(at(place), 300.0, 5);
        rig.finish();
        assert_eq!(rig.pins.position, rig.target());
    }
}

/// When the length of ticks changes, the steps of the dominant motor stay even, in lockstep and out of it: in ramps,
/// at cruise, and where a feedhold begins and ends. This holds where it is fast; near rest each step is a ramp of its
/// own.
#[test]
fn steps_are_even_whatever_ticks_become() {
    for (jerk, minor) in [(0.0, 0.0), (0.0, 0.37), (1e5, 0.0), (1e5, 0.37)] {
        for velocity in [35.0f32, 60.0, 130.0, 250.0] {
            let mut rig = Rig::new(Config::new(500.0, 1_000.0, jerk));
            rig.pins.keep_edges = true;
            for n in 1..=24 {
                let x = 5.03 * f64::from(n);
                rig.line(at([x, x * minor]), velocity, n as u32);
            }
            for turn in 0.. {
                if turn == 190 || turn == 260 {
                    rig.hold(turn == 190);
                }
                if matches!(rig.turn(), Step::Idle) {
                    break;
                }
            }
            rig.finish();
            let gaps: Vec<_> = rig.pins.edges[0].windows(2).map(|w| w[1] - w[0]).collect();
            let worst = gaps.windows(2).filter(|g| g[0].min(g[1]) < 2_600);
            let worst = worst.map(|g| g[0].abs_diff(g[1]) as f64 / g[0].min(g[1]) as f64);
            let worst = worst.fold(0.0, f64::max);
            assert!(worst < 0.12, "{worst} at {velocity} mm/s, {minor}, {jerk}");
        }
    }
}

/// A corner at the newest block of a full queue is seen as soon as the block is queued.
#[test]
fn the_newest_block_of_a_full_queue_is_seen() {
    for jerk in [0.0, 1e5] {
        let mut rig = Rig::new(Config::new(1_000.0, 1_000.0, jerk));
        let (mut x, mut n) = (100.0, 1);
        rig.line(at([x]), 200.0, n);
        while rig.free() > 1 {
            (x, n) = (x + 0.1, n + 1);
            rig.line(at([x]), 200.0, n);
        }
        rig.line(at([0.0]), 200.0, n + 1);
        assert_eq!(rig.free(), 0);
        rig.finish();
        let before = rig.emitted.iter().rfind(|emitted| emitted.line <= n).expect("segments");
        assert!(before.velocity < 20.0, "{} mm/s into the reversal", before.velocity);
        let fastest = rig.emitted.iter().map(|emitted| emitted.velocity).fold(0.0, f32::max);
        assert!(fastest > 199.0, "{fastest} mm/s");
    }
}

/// The steps of the dominant motor stay even over the ends of lines of 0.2 to 5 mm, in lockstep and out of it. Lines
/// end in 1/16 step: where ticks are longer, a step may be late by as much.
#[test]
fn steps_are_even_over_the_ends_of_lines() {
    let mut random = Random(11);
    for n in 0..160 {
        let (jerk, minor) = ([0.0, 1e5][n / 2 % 2], [0.0, 0.37][n % 2]);
        let (shortest, lines) = [(0.2, 400), (1.0, 80)][n / 4 % 2];
        let velocity = 6.0 + random.part() * 60.0;
        let mut rig = Rig::new(Config::new(500.0, 1_000.0, jerk));
        rig.pins.keep_edges = true;
        let mut x = 0.0;
        for n in 1..=lines {
            x += shortest * (1.0 + 4.0 * random.part());
            while rig.free() == 0 {
                rig.turn();
            }
            rig.line(at([x, x * minor]), velocity as f32, n);
        }
        rig.finish();
        let edges = &rig.pins.edges[0];
        let cruise = &edges[edges.len() / 4..edges.len() / 4 * 3];
        let gaps = cruise.windows(2).map(|w| w[1] - w[0]);
        let (least, most) = gaps.fold((u64::MAX, 0), |(l, m), gap| (l.min(gap), m.max(gap)));
        let uneven = (most - least) as f64 / least as f64;
        assert!(uneven < 0.08, "{uneven} at {velocity} mm/s, {minor}, {jerk}, {shortest} mm");
    }
}

/// A machine with fine steps: `num` times 80 in a mm.
fn fine(num: u32) -> Config {
    let mut config = Config::new(500.0, 1e6, 0.0);
    (config.ratio, config.junction) = ([StepRatio { num, den: 125 }; MOTORS], 1e6);
    config
}

/// Runs lines at a feed, without corners that limit it, and compares the velocity of each segment with the feed.
fn check_velocity(config: &Config, points: &[PerAxis<Length>], velocity: f32) {
    let mut rig = Rig::new(config.clone());
    for (n, to) in points.iter().enumerate() {
        while rig.free() == 0 {
            rig.turn();
        }
        rig.line(*to, velocity, n as u32 + 1);
    }
    rig.finish();
    let ratio = &config.ratio[0];
    let per_step = f64::from(ratio.den) / f64::from(ratio.num) * 1e-4;
    let count = rig.emitted.len();
    for e in &rig.emitted[count / 20..count - count / 20] {
        let steps = e.segment.increment.map(|i| (f64::from(i) / f64::from(STEP)).powi(2));
        let ticks = f64::from(e.segment.ticks);
        let way = ticks * steps.iter().sum::<f64>().sqrt();
        let ideal = ticks * f64::from(e.segment.period) / 16e6 * f64::from(velocity) / per_step;
        // Segments make up for time and for parts of steps.
        assert!((way - ideal).abs() < 1.0 + ideal * 0.02, "{way} of {ideal}: {e:?}, {ratio:?}");
    }
}

/// No segment is slower than the feed, even where two motors take turns as the dominant one, however fine the steps
/// are.
#[test]
fn a_steady_feed_is_steady_in_all_directions() {
    for num in [1, 4, 8, 16] {
        let config = fine(num);
        for (radius, turn, velocity) in
            [(18.0, 0.02, 32.0), (18.0, 0.1, 32.0), (3.0, 0.1, 30.0), (6.0, 0.05, 31.5)]
        {
            let points = circle(radius, turn, (4.0 * std::f64::consts::TAU / turn) as u32);
            check_velocity(&config, &points, velocity);
        }
        for axes in [2, 3] {
            let mut random = Random(num.into());
            let kind = Kind { axes, way: (0.3, 3.0), turn: 0.05 };
            check_velocity(&config, &path(&mut random, &kind, 1_000), 25.0);
        }
    }
}
