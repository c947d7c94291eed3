//! Turns steps into positions of the axes that are a millisecond apart.
//!
//! A step is the moment at which the motor passes the middle between two positions. Between steps the motor is taken
//! to move evenly. When no step comes for [`STILL_S`] the motor stands still, except for the half steps at both ends
//! of the standstill.

use kerf::boards::MOTORS;

use crate::machine::Machine;
use crate::oracle::{AXES, MotorSetup, Setup, UNITS};

/// Time between two samples, s.
pub const SAMPLE_S: f64 = 0.001;
/// A motor that makes no step for so long stands still, s.
const STILL_S: f64 = 0.2;

/// The positions of all axes, mm or degrees.
pub type Position = [f64; AXES];

/// The steps of each motor: when, in s, and whether the direction pin is low.
pub type Steps = [Vec<(f64, bool)>; MOTORS];

/// The path of a motor as corners of a line: time and position.
type Corners = Vec<(f64, f64)>;

/// Returns the logged steps of a machine.
pub fn steps(machine: &Machine) -> Steps {
    let mut steps = Steps::default();
    for step in machine.recorder().log() {
        steps[usize::from(step.motor)].push((machine.seconds(step.cycle), step.positive));
    }
    steps
}

/// Returns the times of the first and of the last step of all motors, s.
pub fn span(steps: &Steps) -> Option<(f64, f64)> {
    let times = || steps.iter().flatten().map(|step| step.0);
    let ends = (times().reduce(f64::min), times().reduce(f64::max));
    ends.0.zip(ends.1)
}

/// Returns the positions of the axes from the first step to the last. An axis with several motors follows the first
/// of them. Two motors that drive X and Y together move both.
pub fn positions(steps: &Steps, setup: &Setup) -> Vec<Position> {
    let Some((first, last)) = span(steps) else { return Vec::new() };
    let count = ((last - first) / SAMPLE_S).ceil() as usize + 1;
    let mut positions = vec![Position::default(); count];
    for (steps, of) in steps.iter().zip(&setup.motors).rev() {
        let steps = steps.iter().map(|(time, low)| (time - first, *low != of.inverted));
        let corners = corners(steps, step_length(of));
        for (position, value) in positions.iter_mut().zip(sampled(&corners)) {
            if of.besides == 0 {
                position[of.axis] = value;
            } else {
                position[0] += value / 2.0;
                position[1] += of.besides as f64 * value / 2.0;
            }
        }
    }
    positions
}

/// Returns the millimetres or degrees in a step.
pub fn step_length(motor: &MotorSetup) -> f64 {
    const FAR: i64 = 1_000_000;
    match motor.steps(FAR * UNITS as i64) {
        0 => 0.0,
        steps => FAR as f64 / steps as f64,
    }
}

fn corners(steps: impl Iterator<Item = (f64, bool)>, length: f64) -> Corners {
    let mut corners = Corners::new();
    let (mut at, mut before) = (0.0, f64::NEG_INFINITY);
    let mut halting: Option<f64> = None;
    let mut steps = steps.peekable();
    while let Some((time, up)) = steps.next() {
        let step = if up { length } else { -length };
        let next = steps.peek().map_or(f64::INFINITY, |(next, _)| *next);
        if time - before > STILL_S {
            // The motor has stood still: its first half step takes as long as the next step, if there is time.
            let lead = (next - time).min(STILL_S).min(0.5 * (time - before));
            corners.extend(halting.map(|halt| (halt, at)));
            corners.push((time - lead, at));
        }
        corners.push((time, at + step / 2.0));
        at += step;
        let pace = if time - before > STILL_S { next - time } else { time - before };
        halting = Some(time + pace.min(STILL_S / 2.0));
        before = time;
    }
    corners.extend(halting.map(|halt| (halt, at)));
    corners
}

/// Returns the line's positions at all samples. The line is level before its first corner and behind its last.
fn sampled(corners: &[(f64, f64)]) -> impl Iterator<Item = f64> {
    let mut next = 0;
    (0..).map(move |n| {
        let time = f64::from(n) * SAMPLE_S;
        while corners.get(next).is_some_and(|corner| corner.0 <= time) {
            next += 1;
        }
        match (next.checked_sub(1).map(|before| corners[before]), corners.get(next)) {
            (Some((t0, p0)), Some((t1, p1))) => p0 + (p1 - p0) * (time - t0) / (t1 - t0),
            (Some((_, position)), None) => position,
            (None, _) => corners.first().map_or(0.0, |corner| corner.1),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_steps_are_an_even_way() {
        let steps = (0..1_000).map(|n| (0.01 + f64::from(n) * 0.002, true));
        let corners = corners(steps, 0.5);
        let samples: Vec<f64> = sampled(&corners).take(2_100).collect();
        for (n, position) in samples[..2_000].iter().enumerate().skip(20) {
            let want = (n as f64 * SAMPLE_S - 0.01) / 0.002 * 0.5 + 0.25;
            assert!((position - want).abs() < 1e-9, "{n}: {position} instead of {want}");
        }
        assert_eq!(samples[2_099], 500.0);
    }

    #[test]
    fn a_motor_stands_between_two_moves() {
        let steps = [(0.0, true), (0.01, true), (1.0, false), (1.01, false)];
        let corners = corners(steps.into_iter(), 1.0);
        let samples: Vec<f64> = sampled(&corners).take(1_100).collect();
        assert!(samples[30..980].iter().all(|p| *p == 2.0));
        assert_eq!(samples[1_099], 0.0);
    }
}
