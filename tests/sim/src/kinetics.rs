//! Velocity, acceleration and jerk of each axis, computed from steps, and how they compare with the limits.
//!
//! Positions come from [`track`]; [`Windows`] takes their differences. Each position is known to within a step, so
//! a difference of positions may be off by [`ACCELERATION_STEPS`] or [`JERK_STEPS`]. [`greatest`] subtracts these, so
//! that what it finds over a limit is real.

pub use crate::windows::Windows;

use crate::limits::AxisLimits;
use crate::oracle::{AXES, Setup};
use crate::track::{self, Position, SAMPLE_S};

/// The time between positions from which accelerations are computed, s. Velocity and jerk have twice as much.
pub const WINDOW_S: f64 = 0.010;
/// Steps by which the difference of an acceleration may be off.
const ACCELERATION_STEPS: f64 = 4.0;
/// Steps by which the difference of a jerk may be off.
const JERK_STEPS: f64 = 8.0;

/// The motion of an axis, a value each [`SAMPLE_S`]: mm or degrees, and s.
#[derive(Clone, Default, Debug)]
pub struct Curves {
    /// Velocity.
    pub velocity: Vec<f64>,
    /// Acceleration.
    pub acceleration: Vec<f64>,
    /// Jerk.
    pub jerk: Vec<f64>,
}

/// Returns the motion of an axis, from positions of all axes.
pub fn curves(positions: &[Position], axis: usize, windows: &Windows) -> Curves {
    let places: Vec<f64> = positions.iter().map(|position| position[axis]).collect();
    let all = 0..places.len();
    Curves {
        velocity: all.clone().map(|at| windows.velocity(&places, at)).collect(),
        acceleration: all.clone().map(|at| windows.acceleration(&places, at)).collect(),
        jerk: all.map(|at| windows.jerk(&places, at)).collect(),
    }
}

/// Whether an axis moves at all.
pub fn moves(positions: &[Position], axis: usize) -> bool {
    positions.iter().any(|position| position[axis] != positions[0][axis])
}

/// The greatest acceleration or jerk of all axes, over the limit of the axis.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub struct Greatest {
    /// Over the limit, less the error that steps can cause.
    pub over: f64,
    /// Over the limit, as measured.
    pub raw: f64,
    /// The axis.
    pub axis: usize,
    /// When, s from the first step.
    pub seconds: f64,
}

impl Greatest {
    /// The greatest of the values of an axis.
    fn of(values: &[f64], axis: usize, limit: f64, error: f64) -> Self {
        let largest = values.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let (at, value) = largest.map_or((0, 0.0), |(at, value)| (at, value.abs()));
        let over = (value - error).max(0.0) / limit;
        Greatest { over, raw: value / limit, axis, seconds: at as f64 * SAMPLE_S }
    }

    fn or(self, other: Self) -> Self {
        if other.over > self.over { other } else { self }
    }
}

/// Returns the greatest acceleration and the greatest jerk of all axes over their limits.
pub fn greatest(positions: &[Position], setup: &Setup, limits: &AxisLimits) -> [Greatest; 2] {
    let windows = Windows::new(SAMPLE_S, WINDOW_S);
    let (short, long) = (windows.seconds(), 2.0 * windows.seconds());
    let mut greatest = [Greatest::default(); 2];
    for axis in (0..AXES).filter(|axis| moves(positions, *axis)) {
        let step = step(setup, axis);
        let error = [ACCELERATION_STEPS * step / short.powi(2), JERK_STEPS * step / long.powi(3)];
        let Curves { acceleration, jerk, .. } = curves(positions, axis, &windows);
        let limits = [limits[axis].acceleration, limits[axis].jerk];
        for (n, values) in [acceleration, jerk].iter().enumerate() {
            greatest[n] = greatest[n].or(Greatest::of(values, axis, limits[n], error[n]));
        }
    }
    greatest
}

/// The length of a step of an axis; of the coarsest, if several motors drive the axis.
fn step(setup: &Setup, axis: usize) -> f64 {
    let drives = setup.motors.iter().filter(|motor| motor.drives(axis));
    drives.map(track::step_length).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::Limits;
    use crate::oracle::{AxisMode, Decimal, MotorSetup};

    /// One motor, with 100 steps/mm.
    fn setup() -> Setup {
        let motor = MotorSetup {
            axis: 0,
            besides: 0,
            step_angle: Decimal::parse("1.8").unwrap(),
            travel: Decimal::parse("16").unwrap(),
            microsteps: 8,
            inverted: false,
            active_low: false,
        };
        Setup { motors: vec![motor], modes: [AxisMode::Standard; AXES] }
    }

    #[test]
    fn a_jump_of_velocity_is_seen() {
        // From 0 to 10 mm/s at once: 1,000 mm/s2 over 10 ms, less 4 steps of 0.01 mm in (10 ms)^2.
        let places = (0..400).map(|n| (f64::from(n) - 200.0).max(0.0) * 0.01);
        let positions: Vec<Position> = places.map(|x| [x, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
        let mut limits = [Limits::NONE; AXES];
        limits[0].acceleration = 500.0;
        let [acceleration, jerk] = greatest(&positions, &setup(), &limits);
        assert!((acceleration.raw - 2.0).abs() < 1e-9, "{acceleration:?}");
        assert!((acceleration.over - 1.2).abs() < 1e-9, "{acceleration:?}");
        assert!((acceleration.seconds - 0.2).abs() < 1e-9);
        assert_eq!(jerk.over, 0.0);
    }

    #[test]
    fn even_steps_are_no_acceleration() {
        let steps = (0..1_000).map(|n| (f64::from(n) * 0.0031, true)).collect();
        let positions = track::positions(&[steps, vec![], vec![], vec![]], &setup());
        let mut limits = [Limits::NONE; AXES];
        (limits[0].acceleration, limits[0].jerk) = (1.0, 1.0);
        assert!(greatest(&positions, &setup(), &limits).iter().all(|of| of.over == 0.0));
    }
}
