//! Random jobs through planner, exec and step generator, on the host: every block ends on its step, within
//! the limits of every axis, and no later than need be.

use proptest::prelude::*;

use crate::cases::cases;
use crate::jobs::{Planned, any_job, plan, run};
use crate::keeps::{STRETCH, check_limits};
use crate::optimum::rest_to_rest;

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

proptest! {
    #![proptest_config(cases(10_000))]

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
