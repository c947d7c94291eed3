//! Motion on one side of a gap, evaluated from steps.

use kerf::boards::MOTORS;

use super::{SIGHT_S, Scale};
use crate::recorder::Step;

/// Number of steps that decide which motor leads.
const LEADERS: usize = 16;
/// Axes of a position.
const AXES: usize = 6;
/// The velocity nearest to the gap is averaged over this time, s.
const NEAR_S: f64 = 0.001;
/// The velocity before that, which it is compared with, is averaged over this time, s.
const FAR_S: f64 = 0.002;

/// One side of a gap.
pub struct Side {
    /// Velocity of the path, mm/s.
    pub velocity: f64,
    /// Time towards the gap after which the velocity would be zero at its present rate of change, s.
    pub rest: f64,
}

impl Side {
    /// Evaluates the steps on one side, the nearest first. `motor` is the motor that is known to lead; if it is
    /// `None`, the motor that steps most is taken. Returns `None` if there are too few steps.
    pub fn of<'a>(
        scale: &Scale,
        motor: Option<u8>,
        steps: impl Iterator<Item = &'a Step> + Clone,
    ) -> Option<Side> {
        let motor = motor.or_else(|| leader(steps.clone()))?;
        let edge = steps.clone().find(|s| s.motor == motor)?.cycle;
        let since = |step: &Step| step.cycle.abs_diff(edge) as f64 / scale.clock_hz;
        let own = steps.clone().filter(|s| s.motor == motor).map(since);
        let own: Vec<f64> = own.take_while(|t| *t <= 4.0 * SIGHT_S).collect();
        let near = own.iter().enumerate().position(|(n, t)| n >= 2 && *t >= NEAR_S)?;
        let near = near.min(own.len() - 1);
        let velocity = path(scale, steps.take_while(|s| since(s) < own[near])) / own[near];
        Some(Side { velocity, rest: rest(&own, near) })
    }
}

/// Computes [`Side::rest`] from the times of steps. The first `near` of them make the nearest velocity.
fn rest(times: &[f64], near: usize) -> f64 {
    let behind = |(n, t): (usize, &f64)| n >= near + 2 && *t >= times[near] + FAR_S;
    let far = times.iter().enumerate().position(behind).unwrap_or(times.len() - 1);
    if far < near + 2 {
        return f64::INFINITY;
    }
    let slow = near as f64 / times[near];
    let fast = (far - near) as f64 / (times[far] - times[near]);
    let change = (fast - slow) / (times[far] / 2.0);
    if change > 0.0 { slow / change } else { f64::INFINITY }
}

fn leader<'a>(steps: impl Iterator<Item = &'a Step>) -> Option<u8> {
    let mut count = [0; MOTORS];
    steps.take(LEADERS).for_each(|s| count[usize::from(s.motor)] += 1);
    let most = *count.iter().max()?;
    let motor = count.iter().position(|n| *n == most && most > 0)?;
    Some(motor as u8)
}

/// Returns the length of the path that these steps make, mm; degrees if only rotary axes move.
fn path<'a>(scale: &Scale, steps: impl Iterator<Item = &'a Step>) -> f64 {
    let (mut linear, mut rotary) = ([0.0; AXES], [0.0; AXES]);
    let mut mover: [Option<u8>; AXES] = [None; AXES];
    for step in steps {
        let travel = scale.motors[usize::from(step.motor)];
        // An axis with two motors counts once.
        if *mover[travel.axis].get_or_insert(step.motor) != step.motor {
            continue;
        }
        let sum = if travel.rotary { &mut rotary } else { &mut linear };
        sum[travel.axis] += if step.positive { travel.step } else { -travel.step };
    }
    let length = |way: [f64; AXES]| way.iter().map(|l| l * l).sum::<f64>().sqrt();
    if linear.iter().any(|l| *l != 0.0) { length(linear) } else { length(rotary) }
}
