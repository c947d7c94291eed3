//! Random jobs through planner, exec and step generator, on the host: every block ends on its step, within
//! the limits of every axis, and no later than need be.

#[allow(dead_code, reason = "each test uses a part")]
#[path = "support/jobs.rs"]
mod jobs;
#[path = "support/optimum.rs"]
mod optimum;
#[allow(dead_code, reason = "each test uses a part")]
#[path = "support/rig.rs"]
mod rig;

use jobs::{Planned, any_job, plan, run};
use kerf::motion::exec::SEGMENT_S;
use optimum::rest_to_rest;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const STRETCH: f64 = SEGMENT_S as f64;

/// Velocity, acceleration and jerk along the path stay within the block's limits.
///
/// What the length of stretches adds: acceleration 1 %, and what is gone to at once, a velocity less than
/// `J t^2` away, or a thousandth of the highest feed: the queue keeps no key for less, and potentials are
/// no finer.
fn check_limits(planned: &[Planned]) {
    let little = planned.iter().map(|p| p.cruise).fold(0.0, f64::max) * 1e-3;
    for (n, p) in planned.iter().enumerate() {
        let seconds = f64::from(p.stretch.seconds);
        assert!(p.after <= p.cruise * 1.0011, "{n}: {p:?}");
        let change = p.after - p.before;
        assert!(change.abs() <= p.accel * seconds * 1.01 + little, "{n}: {p:?}");
        let mean = f64::from(p.stretch.distance) / seconds;
        let high = p.before.max(p.after) + 0.5 * p.accel * seconds;
        assert!(mean <= high * 1.001 || p.stretch.distance < 1e-5, "{n}: {mean} mm/s in {p:?}");
    }
    for (n, pair) in planned.windows(2).enumerate() {
        let [a, b] = pair else { unreachable!() };
        check_continuity(n + 1, a, b);
    }
}

/// From one stretch to the next.
fn check_continuity(n: usize, a: &Planned, b: &Planned) {
    assert!(a.after == b.before || a.after < 1e-3, "{n}: {a:?} {b:?}");
    if a.jerk == 0.0 || a.jerk != b.jerk || a.accel != b.accel {
        return;
    }
    let of = |p: &Planned| (p.after - p.before) / f64::from(p.stretch.seconds);
    let seconds = f64::from(a.stretch.seconds + b.stretch.seconds);
    let change = (of(b) - of(a)).abs();
    let most = b.jerk * (0.5 * seconds + 3.0 * STRETCH) * 1.01;
    assert!(change <= most, "{n}: {change} of {most} mm/s^2 from {a:?} to {b:?}");
}

/// The time is no longer than with a stop at every corner.
fn check_time(planned: &[Planned]) {
    let total: f64 = planned.iter().map(|p| f64::from(p.stretch.seconds)).sum();
    let mut blocks: Vec<&Planned> = planned.iter().collect();
    blocks.dedup_by_key(|p| p.line);
    let stops: f64 = blocks.iter().map(|p| rest_to_rest(p.length, p.cruise, p.accel, p.jerk)).sum();
    let most = stops * 1.02 + 4.0 * STRETCH * blocks.len() as f64;
    assert!(
        total <= most,
        "{total} s; {stops} s if it stopped at each of {} corners",
        blocks.len()
    );
}

/// The same 10,000 jobs each time, unless `PROPTEST_RNG_SEED` names others.
fn config() -> ProptestConfig {
    let mut config = ProptestConfig::with_cases(10_000);
    if config.rng_seed == RngSeed::Random {
        config.rng_seed = RngSeed::Fixed(2560);
    }
    config
}

proptest! {
    #![proptest_config(config())]

    /// Each block, and the whole job.
    #[test]
    fn any_job_ends_on_its_steps(job in any_job()) {
        let rig = run(&job);
        prop_assert_eq!(rig.pins.position, rig.target());
    }

    #[test]
    fn any_job_keeps_its_limits(job in any_job()) {
        let planned = plan(&job);
        check_limits(&planned);
        check_time(&planned);
    }
}
