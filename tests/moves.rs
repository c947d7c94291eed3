//! Single moves on the host: their time compared with the optimum, their rate, and blocks that take time without
//! steps.

use kerf::motion::block::{Block, QueuedAction};
use kerf::motion::factors::Factors;
use kerf::motion::smooth::SAMPLE_S;

use crate::jobs::{Job, Move, plan};
use crate::optimum::rest_to_rest;
use crate::rig::{self, Config, Rig, at};

/// Most time that the length of stretches costs a move, s: three and a half stretches.
const COST: f64 = 3.5 * kerf::motion::exec::SEGMENT_S as f64;

/// Returns the time of a single move without means, and the shortest time within its limits, s.
fn lone(mm: f64, velocity: f32, accel: f32, jerk: f32) -> (f64, f64) {
    let config = Config::new(velocity, accel, jerk);
    let way = [(mm * 1e4) as i32, 0, 0, 0];
    let moves = vec![Move { way, velocity, stop: false, turns: 0 }];
    let planned = plan(&Job { config, moves });
    let seconds = planned.iter().map(|p| f64::from(p.stretch.seconds)).sum();
    let p = planned[0];
    (seconds, rest_to_rest(p.length, p.cruise, p.accel, 0.0))
}

const LENGTHS: [f64; 11] = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 200.0, 300.0];

/// With means a move takes longer than its trapezoid, by what the means cover (14 samples at most) and by what the length
/// of samples costs.
#[test]
fn moves_with_means_take_little_longer_than_the_optimum() {
    let limits = [(0.0, 1e5), (0.0, 1e6), (500.0, 2e4), (500.0, 1e5), (3000.0, 1e6)];
    for mm in LENGTHS {
        for (accel, jerk) in limits {
            for velocity in [30.0, 200.0] {
                let mut rig = Rig::new(Config::new(velocity, accel, jerk));
                rig.line(at([mm]), velocity, 1);
                rig.finish();
                assert_eq!(rig.pins.position, rig.target());
                let seconds = rig.seconds();
                let (_, trapezoid) = lone(mm, velocity, accel, jerk);
                let spans = SAMPLE_S as f64 * 14.0;
                let what = format!("{mm} mm at {velocity} mm/s, {accel} mm/s^2, {jerk} mm/s^3");
                assert!(seconds <= trapezoid + spans + 0.006, "{what}: {seconds} s, {trapezoid}");
                assert!(seconds >= trapezoid * 0.99 - 0.005, "{what}: {seconds} s, {trapezoid}");
            }
        }
    }
}

#[test]
fn a_high_jerk_is_the_exact_trapezoid() {
    for mm in LENGTHS {
        for accel in [50.0, 500.0, 5000.0] {
            for velocity in [5.0, 30.0, 200.0] {
                let (sharp, best) = lone(mm, velocity, accel, 0.0);
                let (high, _) = lone(mm, velocity, accel, 1e9);
                let what = format!("{mm} mm at {velocity} mm/s, {accel} mm/s^2");
                assert_eq!(sharp, high, "{what}");
                // A peak within a stretch is cut off.
                assert!(
                    (sharp - best).abs() <= best * 5e-4 + 0.25 * COST,
                    "{what}: {sharp}, not {best}"
                );
            }
        }
    }
}

/// Returns the steps per second of motor X between a quarter and three quarters of its steps, and the number of steps
/// in between.
fn rate(rig: &Rig) -> (f64, f64) {
    let edges = &rig.pins.edges[0];
    let middle = &edges[edges.len() / 4..edges.len() * 3 / 4];
    let cycles = (middle[middle.len() - 1] - middle[0]) as f64;
    let steps = (middle.len() - 1) as f64;
    (steps * 16e6 / cycles, steps)
}

#[test]
fn cruises_at_the_commanded_rate() {
    for jerk in [0.0, 1e6] {
        for velocity in [0.1f32, 1.0, 37.0, 99.9, 250.0] {
            let mut rig = Rig::new(Config::new(300.0, 5000.0, jerk));
            rig.pins.keep_edges = true;
            let mm = f64::from(velocity) * 1.2 + 1.0;
            rig.line(at([mm, mm / 3.0, 0.0, 0.0]), velocity, 1);
            rig.finish();
            assert_eq!(rig.pins.position, rig.target());
            // X has its share of the path's velocity.
            let wanted = f64::from(velocity) * 80.0 / (1.0f64 + 1.0 / 9.0).sqrt();
            let (got, steps) = rate(&rig);
            // Stretches end on whole ticks, so a step may come a quarter of an interval early or late.
            let most = 1e-3 + 0.25 / steps;
            assert!((got / wanted - 1.0).abs() < most, "{got} steps/s, not {wanted}");
        }
    }
}

/// What is left of a long line has 24 bits, of which a slow stretch is a few. The feed is exact all the same.
#[test]
fn long_slow_lines_keep_their_feed() {
    for jerk in [0.0, 1e6] {
        for (mm, velocity) in [
            (400.0, 0.13f32),
            (400.0, 0.61),
            (400.0, 0.021),
            (400.0, 0.05),
            (400.0, 2.03),
            (120.0, 0.012),
            // A stretch is less than the last bit.
            (400.0, 0.0063),
            (400.0, 0.00125),
        ] {
            let mut rig = Rig::new(Config::new(300.0, 5_000.0, jerk));
            rig.pins.keep_edges = true;
            rig.line(at([mm]), velocity, 1);
            while rig.pins.edges[0].len() < 24 {
                rig.turn();
            }
            let (got, wanted) = (rate(&rig).0, f64::from(velocity) * 80.0);
            assert!((got / wanted - 1.0).abs() < 1e-3, "{got} steps/s, not {wanted}: {mm} mm");
        }
    }
}

#[test]
fn one_step_in_ten_seconds_takes_ten_seconds() {
    let mut rig = Rig::new(Config::new(100.0, 500.0, 1e5));
    rig.pins.keep_edges = true;
    rig.line(at([0.05]), 0.00125, 1);
    rig.finish();
    let edges = &rig.pins.edges[0];
    assert_eq!(edges.len(), 4);
    for gap in edges.windows(2) {
        let seconds = (gap[1] - gap[0]) as f64 / 16e6;
        assert!((seconds - 10.0).abs() < 0.02, "{seconds} s");
    }
}

#[test]
fn blocks_without_a_step_keep_their_time() {
    for jerk in [0.0, 1e6] {
        let mut rig = Rig::new(Config::new(100.0, 500.0, jerk));
        for n in 1..=800 {
            while rig.free() == 0 {
                rig.turn();
            }
            rig.line(at([f64::from(n) * 0.001]), 0.2, n as u32);
        }
        rig.finish();
        assert_eq!(rig.pins.position[0], 64);
        let seconds = rig.seconds();
        assert!((seconds - 4.0).abs() < 0.05, "0.8 mm at 0.2 mm/s took {seconds} s");
    }
}

#[test]
fn a_dwell_lasts_as_long_as_asked() {
    let mut rig = Rig::new(Config::new(100.0, 500.0, 1e5));
    rig.push(Block::action(QueuedAction::Dwell(1235), 0));
    rig.finish();
    let ms = rig.seconds() * 1e3;
    assert!((ms - 1235.0).abs() < 1.5, "{ms} ms");
}

/// A dwell between moves: the moves come to rest, and neither takes time from the dwell or gives it time.
#[test]
fn moves_stop_for_a_dwell() {
    let time = |dwell: bool| {
        let mut rig = Rig::new(Config::new(100.0, 500.0, 1e5));
        rig.line(at([10.0]), 50.0, 1);
        if dwell {
            rig.push(Block::action(QueuedAction::Dwell(500), 0));
        } else {
            rig.stop();
        }
        rig.line(at([20.0]), 50.0, 2);
        rig.finish();
        assert_eq!(rig.pins.position, rig.target());
        rig.seconds()
    };
    let more = time(true) - time(false);
    // The dwell begins when the means are empty.
    assert!((-0.003..0.03).contains(&(more - 0.5)), "{more} s");
}

/// Motors are where the governor is, at all times. A stretch carries less than a step over to the next one.
#[test]
fn segments_follow_the_plan() {
    for (jerk, velocity) in [(0.0, 1.0f32), (0.0, 60.0), (1e5, 1.0), (1e5, 60.0), (1e6, 200.0)] {
        let mut rig = Rig::new(Config::new(200.0, 1000.0, jerk));
        for n in 1..=20 {
            let x = f64::from(n) * 1.7;
            rig.line(at([x, 0.3 * x, 0.0, 0.1 * x]), velocity, n as u32);
        }
        rig.keep = true;
        rig.finish();
        assert_eq!(rig.pins.position, rig.target());
        let most = rig.emitted.iter().map(|e| e.ahead.abs()).fold(0.0, f64::max);
        assert!(most < 1.5, "{most} steps off at {velocity} mm/s");
    }
}

/// Errors do not accumulate: rates from a step in a second to the highest, for a million segments.
#[test]
fn a_million_segments_end_on_the_step() {
    let mut rig = Rig::new(Config::new(400.0, 8000.0, 2e6));
    rig.keep = false;
    let mut seed = 1u32;
    let mut random = |most: f32| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as f32 / 16_777_216.0 * most
    };
    let mut number = 0;
    while rig.segments < 1_000_000 {
        number += 1;
        while rig.free() == 0 {
            rig.turn();
        }
        // The places stay around the middle, or the path would drift away.
        let size = [0.03, 0.3, 3.0, 30.0][random(4.0) as usize];
        let to = [0, 1, 2, 3].map(|m| {
            let way = f64::from(random(size) - 0.5 * size);
            f64::from(rig.position[m].0) * 1e-4 * 0.999 + way
        });
        let velocity = if random(10.0) < 1.0 { size * 3.0 } else { 20.0 + random(300.0) };
        rig.line(at(to), velocity, number);
        if number % 1000 == 0 {
            rig.finish();
            assert_eq!(rig.pins.position, rig.target(), "after {} segments", rig.segments);
        }
    }
    rig.finish();
    assert_eq!(rig.pins.position, rig.target());
}

/// An acceleration that no ramp can reach under the jerk limit, by a factor of a thousand, does not make the planning
/// ahead less exact.
#[test]
fn short_lines_keep_their_feed_under_a_low_jerk_and_a_high_acceleration() {
    for (accel, jerk) in [(20_000.0, 20.0), (1e6, 1.0), (1e6, 1_000.0)] {
        let mut config = Config::new(500.0, accel, jerk);
        config.deviation = 0.5;
        let mut rig = Rig::new(config);
        for n in 1..=40u32 {
            let (x, velocity) = match n {
                1..4 => (20.0 * f64::from(n), 500.0),
                4..38 => (60.0 + 0.05 * f64::from(n), 5.0),
                _ => (20.0 * f64::from(n - 34), 500.0),
            };
            rig.line(at([x]), velocity, n);
        }
        rig.finish();
        // The velocity is later than the line, by the means.
        let short = rig.emitted.iter().filter(|e| (14..38).contains(&e.line));
        let fastest = short.map(|e| e.velocity).fold(0.0, f32::max);
        assert!(fastest > 1.0 && fastest < 5.1, "{fastest} mm/s, {accel} mm/s2, {jerk} mm/s3");
    }
}

/// Long fast lines have brake potentials that are too coarse for slow lines behind them. The potentials of the slow
/// lines are counted anew, so the slow lines keep their feed.
#[test]
fn slow_lines_behind_fast_ones_keep_their_feed() {
    for jerk in [0.0, 50_000.0] {
        let mut config = Config::new(500.0, 500.0, jerk);
        config.deviation = 0.5;
        let mut rig = Rig::new(config);
        let (mut x, mut number, mut slow) = (0.0, 0, Vec::new());
        let mut line = |rig: &mut Rig, way: f64, velocity: f32| {
            while rig.free() == 0 {
                rig.turn();
            }
            (x, number) = (x + way, number + 1);
            rig.line(at([x]), velocity, number);
            number
        };
        // In the second round some lines of the first are still in the queue, so that potentials go on.
        for _ in 0..2 {
            for _ in 0..20 {
                line(&mut rig, 20.0, 400.0);
            }
            slow.push(line(&mut rig, 0.1, 1.0));
            for _ in 0..19 {
                line(&mut rig, 0.1, 1.0);
            }
            rig.want(Factors { feed: 0.999, ..Factors::ONE });
            rig.replan();
        }
        rig.finish();
        for first in slow {
            let of = |e: &&rig::Emitted| (first + 1..first + 19).contains(&e.line);
            let velocities = rig.emitted.iter().filter(of).map(|e| e.velocity);
            for velocity in velocities {
                assert!(
                    (velocity - 0.999).abs() < 0.01,
                    "{velocity} of 1 mm/s in the lines behind {first}"
                );
            }
        }
    }
}
