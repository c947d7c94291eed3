//! Random jobs through planner, exec and step generator, on the host: every block ends on its step, within
//! the limits of every axis, and no later than need be.

use proptest::prelude::*;

use crate::cases::cases;
use crate::jobs::{Planned, Pressed, any_job, plan, plan_pressed, run};
use crate::keeps::{STRETCH, check_changes, check_corners, check_limits};
use crate::optimum::rest_to_rest;

/// Checks that the time is no longer than with a stop at every corner.
fn check_time(planned: &[Planned]) {
    let total: f64 = planned.iter().map(|p| f64::from(p.stretch.seconds)).sum();
    let mut blocks: Vec<&Planned> = planned.iter().collect();
    blocks.dedup_by_key(|p| p.line);
    let stops: f64 = blocks.iter().map(|p| rest_to_rest(p.length, p.cruise, p.accel, 0.0)).sum();
    let most = stops * 1.02 + 4.0 * STRETCH * blocks.len() as f64;
    assert!(
        total <= most,
        "{total} s; {stops} s if it stopped at each of {} corners",
        blocks.len()
    );
}

/// Runs of stretches, each with its shortage of CPU time. After the last run the first one comes again.
fn any_pressed() -> impl Strategy<Value = Vec<(usize, Pressed)>> {
    let pressed = any::<bool>().prop_map(|coarse| Pressed { coarse, sampled: 0 });
    let runs = prop::collection::vec((1..30usize, pressed), 1..8);
    // The last run has no shortage. Else velocities are kept, however low.
    (runs, 20..60usize).prop_map(|(mut runs, last)| {
        runs.push((last, Pressed::default()));
        runs
    })
}

fn pressed_at(runs: &[(usize, Pressed)], stretch: usize) -> Pressed {
    let all: usize = runs.iter().map(|(length, _)| length).sum();
    let mut left = stretch % all;
    for (length, pressed) in runs {
        if left < *length {
            return *pressed;
        }
        left -= length;
    }
    unreachable!()
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

    /// With any shortage of CPU time, velocity and acceleration keep to their limits.
    #[test]
    fn a_pressed_cpu_keeps_the_limits(job in any_job(), runs in any_pressed()) {
        let planned = plan_pressed(&job, |stretch| pressed_at(&runs, stretch));
        check_corners(&planned, 1e-3);
        check_changes(&planned, 1e-3, 1.0, true);
    }

    /// In samples, whatever their length, velocity and acceleration keep to their limits.
    #[test]
    fn samples_keep_the_limits(mut job in any_job(), sampled in 1u8..=2) {
        // Without an acceleration limit a millionth of a second changes velocities by much.
        job.config.accel.iter_mut().filter(|accel| **accel == 0.0).for_each(|accel| *accel = 500.0);
        let planned = plan_pressed(&job, |_| Pressed { coarse: false, sampled });
        check_limits(&planned);
        check_time(&planned);
    }
}
