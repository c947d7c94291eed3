#[allow(dead_code)]
#[path = "support/jobs.rs"]
mod jobs;
#[allow(dead_code)]
#[path = "support/rig.rs"]
mod rig;
use jobs::{Job, Move, plan};
use rig::Config;
#[test]
fn scratch() {
    let config = Config::new(64.85072, 0.0, 443506.38);
    let moves = (0..200)
        .map(|n| {
            let a = 2.5 - 0.0389 * n as f64 * -1.0;
            Move {
                way: [(a.cos() * 1315.0) as i32, (a.sin() * 1315.0) as i32, 0, 0],
                velocity: 74.88613,
                stop: false,
                turns: 1,
            }
        })
        .collect();
    plan(&Job { config, moves });
}
