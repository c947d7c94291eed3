//! Random jobs on the image: lines and arcs of all sizes with four axes, under random jerk limits and at random feeds;
//! jobs with two axes at high step rates, with holds and overrides at random times; and jobs with many lines shorter
//! than a step between fast ones. No job has a pause, and each ends on its exact steps.
//!
//! A share of the jobs runs. `KERF_SEED` and `KERF_CASES` choose others: `KERF_CASES=1000` runs a thousand. `KERF_TOLD=1000` reports up to a
//! thousand failures.

use std::fmt::Write;

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::job::{self, Options};
use proptest::prelude::*;
use proptest::strategy::ValueTree;

use crate::common::firmware;
use crate::common::share::share_of_seeds;
use crate::seeds;

/// Number of jobs, and of those in a share: half a minute on two cores, and a quarter of that.
const CASES: [u64; 2] = [50, 15];

/// Number of jobs with holds and overrides, and of those in a share.
const DISTURBED: [u64; 2] = [12, 4];

/// Number of jobs with lines shorter than a step, and of those in a share.
const BRIEF: [u64; 2] = [100, 30];

/// A move by offsets of X, Y, Z (mm) and A (degrees).
#[derive(Clone, Debug)]
enum Move {
    Line { way: [f64; 4], feed: f64 },
    Arc { radius: f64, from: f64, turn: f64, rise: f64, feed: f64 },
}

#[derive(Clone, Debug)]
struct Job {
    /// Jerk limit, millions of mm/min3; 1,000,000 means no limit.
    jerk: f64,
    /// Acceleration limit, mm/s2.
    accel: f64,
    /// Steps of X and Y in a mm.
    per_mm: f64,
    moves: Vec<Move>,
    /// Real-time characters, and when they are sent, ms after the first line.
    said: Vec<(u64, u8)>,
}

/// Numbers of which all decades are equally likely.
fn decades(from: f64, to: f64) -> impl Strategy<Value = f64> {
    (from.ln()..to.ln()).prop_map(f64::exp)
}

fn line() -> impl Strategy<Value = Move> {
    let axes = prop_oneof![
        3 => Just([1.0, 1.0, 0.0, 0.0]),
        1 => Just([1.0, 0.0, 0.0, 0.0]),
        1 => Just([1.0, 1.0, 0.3, 0.0]),
        1 => Just([1.0, 1.0, 0.3, 1.0]),
    ];
    let way = prop::array::uniform4(-1.0..1.0f64);
    (decades(0.05, 20.0), way, axes, decades(300.0, 12_000.0)).prop_map(|(mm, way, axes, feed)| {
        let way: [f64; 4] = std::array::from_fn(|axis| way[axis] * axes[axis]);
        let length = way[..3].iter().map(|w| w * w).sum::<f64>().sqrt().max(1e-3);
        Move::Line { way: way.map(|w| w * mm / length), feed }
    })
}

fn arc() -> impl Strategy<Value = Move> {
    let turn = prop_oneof![0.2..6.0f64, -6.0..-0.2f64];
    let rise = prop_oneof![3 => Just(0.0), 1 => -1.0..1.0f64];
    (decades(0.2, 30.0), 0.0..std::f64::consts::TAU, turn, rise, decades(300.0, 12_000.0)).prop_map(
        |(radius, from, turn, rise, feed)| {
            // Of large circles only parts, because whole ones would take most of the time.
            let turn = turn / (radius / 10.0).max(1.0);
            Move::Arc { radius, from, turn, rise, feed }
        },
    )
}

/// Single moves, and curves of many short moves.
fn any_job() -> impl Strategy<Value = Job> {
    let jerk = prop_oneof![Just(1e6), Just(500.0), Just(5_000.0), Just(50_000.0)];
    let mixed = prop::collection::vec(prop_oneof![2 => line(), 1 => arc()], 10..40);
    let curve = (decades(0.05, 1.0), -0.3..0.3f64, decades(600.0, 12_000.0), 50usize..250);
    let curve = curve.prop_map(|(mm, bend, feed, count)| {
        let way = |n: usize| {
            let (sin, cos) = (bend * n as f64).sin_cos();
            Move::Line { way: [mm * cos, mm * sin, 0.0, 0.0], feed }
        };
        (0..count).map(way).collect::<Vec<_>>()
    });
    (jerk, prop_oneof![2 => mixed, 1 => curve]).prop_map(|(jerk, moves)| Job {
        jerk,
        accel: 500.0,
        per_mm: 80.0,
        moves,
        said: Vec::new(),
    })
}

/// Arcs, lines, and curves of short lines, with X and Y at one feed.
fn fast_moves() -> impl Strategy<Value = Vec<Move>> {
    let feed = 0.0;
    let angle = || 0.0..std::f64::consts::TAU;
    let arc = (2.0..30.0f64, angle(), 1.0..5.5f64, any::<bool>()).prop_map(
        move |(radius, from, turn, left)| {
            let turn = if left { turn } else { -turn };
            vec![Move::Arc { radius, from, turn, rise: 0.0, feed }]
        },
    );
    let line = move |mm: f64, angle: f64| Move::Line {
        way: [mm * angle.cos(), mm * angle.sin(), 0.0, 0.0],
        feed,
    };
    let long = (1.0..40.0f64, angle()).prop_map(move |(mm, angle)| vec![line(mm, angle)]);
    let bends = prop::collection::vec(-0.1..0.15f64, 60);
    let mm = prop_oneof![Just(0.05), Just(0.1), Just(0.3)];
    let curve = (mm, angle(), bends).prop_map(move |(mm, mut angle, bends)| {
        let next = |bend| {
            angle += bend;
            line(mm, angle)
        };
        bends.into_iter().map(next).collect()
    });
    let parts = prop_oneof![4 => arc, 3 => long, 3 => curve];
    prop::collection::vec(parts, 10).prop_map(|parts| parts.concat())
}

/// Holds that are resumed, and feed overrides, for half a minute.
fn anything_said() -> impl Strategy<Value = Vec<(u64, u8)>> {
    let hold = (3..400u64, 5..300u64).prop_map(|(wait, hold)| vec![(wait, b'!'), (hold, b'~')]);
    let feeds = prop::sample::select(vec![0x90u8, 0x91, 0x91, 0x92, 0x92]);
    let feed = (3..400u64, feeds).prop_map(|(wait, byte)| vec![(wait, byte)]);
    prop::collection::vec(prop_oneof![1 => hold, 5 => feed], 150).prop_map(|said| {
        let mut at = 100;
        let when = |(wait, byte): (u64, u8)| {
            at += wait;
            (at, byte)
        };
        said.concat().into_iter().map(when).collect()
    })
}

/// Jobs with motors at 15,000 to 80,000 steps a second, or at the highest rate of two motors.
fn fast_job() -> impl Strategy<Value = Job> {
    let per_mm = prop::sample::select(vec![80.0, 160.0, 320.0, 640.0, 1280.0]);
    let rate = prop::sample::select(vec![15e3, 25e3, 35e3, 45e3, 60e3, 80e3f64]);
    let accel = prop::sample::select(vec![200.0, 500.0, 2_000.0f64]);
    // The jerk limit as a multiple of the acceleration; `None` for no limit.
    let jerk = prop::sample::select(vec![Some(5.0), Some(20.0), None]);
    (per_mm, rate, accel, jerk, fast_moves(), anything_said()).prop_map(
        |(per_mm, rate, accel, jerk, mut moves, said)| {
            let all = (rate / per_mm).min(400.0) * 60.0;
            moves.iter_mut().for_each(|step| match step {
                Move::Line { feed, .. } | Move::Arc { feed, .. } => *feed = all,
            });
            Job { jerk: jerk.map_or(1e6, |times| times * accel), accel, per_mm, moves, said }
        },
    )
}

/// Chains of lines, most of them shorter than a step, straight or in zigzag, between long lines. All are as fast as the
/// axes allow.
fn brief_moves() -> impl Strategy<Value = Vec<Move>> {
    let mm = prop::sample::select(vec![0.001, 0.002, 0.003, 0.005, 0.01, 0.02, 0.03f64]);
    let slope = prop::sample::select(vec![0.0, 0.05, 0.3, 1.0f64]);
    let chain = (mm, slope, 2..65usize, any::<bool>(), 1.0..30.0f64).prop_map(
        |(mm, slope, count, zigzag, long)| {
            let line = |x: f64, y: f64| Move::Line { way: [x, y, 0.0, 0.0], feed: 60e3 };
            let turn = |n: usize| if zigzag && n % 2 == 1 { -1.0 } else { 1.0 };
            let brief = (0..count).map(|n| line(mm, mm * slope * turn(n)));
            brief.chain([line(long, long * slope)]).collect()
        },
    );
    prop::collection::vec(chain, 6).prop_map(|chains: Vec<Vec<Move>>| chains.concat())
}

/// Jobs on machines of all resolutions and accelerations.
fn brief_job() -> impl Strategy<Value = Job> {
    let per_mm = prop::sample::select(vec![80.0, 125.0, 160.0, 320.0, 640.0, 1280.0]);
    let accel = prop::sample::select(vec![500.0, 2_000.0f64]);
    let jerk = prop::sample::select(vec![Some(30.0), Some(200.0), None]);
    (per_mm, accel, jerk, brief_moves()).prop_map(|(per_mm, accel, jerk, moves)| {
        // From 1,000,000 on there is no jerk limit.
        let jerk = jerk.map_or(1e6, |times| (times * accel).min(1e6));
        Job { jerk, accel, per_mm, moves, said: Vec::new() }
    })
}

impl Job {
    fn settings(&self) -> Vec<String> {
        let Job { jerk, accel, per_mm, .. } = self;
        let axis = |axis| format!("{{{axis}:{{vm:30000,fr:30000,jm:{jerk},ac:{accel},jd:0.01}}}}");
        let turn = 1_600.0 / per_mm;
        let motors = ["1", "2"].map(|motor| format!("{{{motor}:{{tr:{turn}}}}}"));
        let more = ["{3:{tr:4}}", "{4:{ma:3,tr:20}}", "{a:{am:1}}", "{ja:1800000}", "{sv:0,qv:0}"];
        let all = motors.into_iter().chain(more.map(String::from));
        all.chain(["x", "y", "z", "a"].map(axis)).collect()
    }

    fn text(&self) -> String {
        let mut text = String::from("G17 G64 G90\n");
        let mut at = [0.0f64; 4];
        for step in &self.moves {
            let (code, feed, centre) = match step {
                Move::Line { way, feed } => {
                    at.iter_mut().zip(way).for_each(|(at, way)| *at += way);
                    ("G1", feed, None)
                }
                Move::Arc { radius, from, turn, rise, feed } => {
                    let (i, j) = (-radius * from.cos(), -radius * from.sin());
                    let to = from + turn;
                    at[0] += i + radius * to.cos();
                    at[1] += j + radius * to.sin();
                    at[2] += rise;
                    (if *turn > 0.0 { "G3" } else { "G2" }, feed, Some((i, j)))
                }
            };
            let [x, y, z, a] = at;
            let _ = write!(text, "{code} X{x:.4} Y{y:.4} Z{z:.4}");
            let _ = match centre {
                Some((i, j)) => writeln!(text, " I{i:.4} J{j:.4} F{feed:.0}"),
                None => writeln!(text, " A{a:.4} F{feed:.0}"),
            };
        }
        text
    }
}

/// Runs the jobs of a share of so many seeds.
fn play_share<S: Strategy<Value = Job>>([all, least]: [u64; 2], any: impl Fn() -> S + Sync) {
    seeds::try_each(share_of_seeds(all, least), |seed| play(seed, any()));
}

/// Runs the job of a seed.
fn play(seed: u64, any: impl Strategy<Value = Job>) -> Result<(), String> {
    let (tree, _) = seeds::case(seed, &any);
    let job = tree.current();
    let interjections = job.said.clone();
    let options = Options { settings: job.settings(), interjections, ..Options::default() };
    let mut machine = firmware(&MEGA2560_GRBL);
    let lines = job::lines_of(&job.text());
    let report = job::run(&mut machine, &lines, &options, |_| {}).map_err(|why| why.to_string());
    let problems = match report {
        Ok(report) if report.ok => return Ok(()),
        Ok(report) => report.problems.join("; "),
        Err(why) => why,
    };
    let Job { jerk, accel, per_mm, .. } = job;
    let lines = lines.len();
    Err(format!("jerk {jerk}, {accel} mm/s2, {per_mm} steps/mm, {lines} lines: {problems}"))
}

#[test]
fn random_jobs_have_no_pause_and_end_exactly() {
    play_share(CASES, any_job);
}

#[test]
fn holds_and_overrides_at_high_step_rates_make_no_pause() {
    play_share(DISTURBED, fast_job);
}

#[test]
fn lines_shorter_than_a_step_make_no_pause() {
    play_share(BRIEF, brief_job);
}
