//! Single moves on the host: their time against the optimum, their rate, and what takes time without steps.

#[path = "support/jobs.rs"]
mod jobs;
#[path = "support/optimum.rs"]
mod optimum;
#[path = "support/rig.rs"]
mod rig;

use jobs::{Job, Move, plan};
use kerf::motion::block::{Block, Body};
use optimum::rest_to_rest;
use rig::{Config, Rig, at};

/// Time of a move by itself against the optimum with its limits.
fn lone(mm: f64, velocity: f32, accel: f32, jerk: f32) -> f64 {
    let config = Config::new(velocity, accel, jerk);
    let way = [(mm * 1e4) as i32, 0, 0, 0];
    let moves = vec![Move { way, velocity, stop: false, turns: 0 }];
    let planned = plan(&Job { config, moves });
    let seconds: f64 = planned.iter().map(|p| f64::from(p.stretch.seconds)).sum();
    let p = planned[0];
    let best = rest_to_rest(p.length, p.cruise, p.accel, p.jerk);
    eprintln!(
        "{mm} mm {velocity} mm/s {accel} {jerk}: {seconds:.5} s of {best:.5} {:.4} {:.2}",
        seconds / best,
        (seconds - best) / 0.002
    );
    seconds / best
}

#[test]
fn explore() {
    for mm in [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0] {
        for (accel, jerk) in [
            (0.0, 1e4),
            (0.0, 1e5),
            (0.0, 1e6),
            (500.0, 1e4),
            (500.0, 1e5),
            (3000.0, 1e6),
            (500.0, 0.0),
        ] {
            for velocity in [30.0, 200.0] {
                lone(mm, velocity, accel, jerk);
            }
        }
    }
}
