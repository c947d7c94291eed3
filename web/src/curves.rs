//! Velocity, acceleration and jerk along the path, from samples of steps.
//!
//! A cubic is fitted to each coordinate over 30 ms before and behind a sample (least squares), so that the grid of the steps does not show; its
//! derivatives in the middle are projected on the direction of motion. At rest all three are 0. Owned by the page, once a job is done. Cost: 150 ns
//! a sample that moves. A job without samples has empty curves.

use kerf::boards::MOTORS;

use crate::samples::{Place, Samples};

/// Half of the time that a fit takes in, ms.
const HALF_MS: u32 = 30;
/// Samples on each side that a cubic needs at the least.
const LEAST: usize = 3;
/// Slower than this is no direction to project on, mm/s.
const STILL: f64 = 1e-3;

/// A value for each sample: mm/s, mm/s^2, mm/s^3.
#[derive(Default)]
pub struct Curves {
    /// Along the path.
    pub velocity: Vec<f32>,
    /// How that changes.
    pub acceleration: Vec<f32>,
    /// How that changes.
    pub jerk: Vec<f32>,
}

impl Curves {
    /// Those of samples; `scale` is the millimetres of a step of each motor, 0 for one that does not count.
    pub fn of(samples: &Samples, scale: [f64; MOTORS]) -> Self {
        let fit = Fit::new(samples.interval_ms());
        let places = samples.places();
        let mut curves = Self::default();
        for at in 0..places.len() {
            let [v, a, j] = fit.along(places, at, scale);
            curves.velocity.push(v as f32);
            curves.acceleration.push(a as f32);
            curves.jerk.push(j as f32);
        }
        curves
    }
}

/// Sums that the fit of a cubic over `-half..=half` needs, and the samples' distance in seconds.
struct Fit {
    half: usize,
    h: f64,
    s0: f64,
    s2: f64,
    s4: f64,
    s6: f64,
}

impl Fit {
    fn new(interval_ms: u32) -> Self {
        let half = ((HALF_MS / interval_ms) as usize).max(LEAST);
        let sum = |power: i32| {
            let terms = (1..=half).map(|i| (i as f64).powi(power));
            2.0 * terms.sum::<f64>()
        };
        let h = f64::from(interval_ms) / 1e3;
        Self { half, h, s0: 2.0 * half as f64 + 1.0, s2: sum(2), s4: sum(4), s6: sum(6) }
    }

    /// Velocity, acceleration and jerk along the path.
    fn along(&self, places: &[Place], at: usize, scale: [f64; MOTORS]) -> [f64; 3] {
        let (first, last) = (at.saturating_sub(self.half), (at + self.half).min(places.len() - 1));
        if places[first] == places[at] && places[last] == places[at] {
            return [0.0; 3];
        }
        let axes = [0, 1, 2, 3].map(|m| match scale[m] {
            0.0 => [0.0; 3],
            scale => self.derivatives(places, at, m).map(|d| d * scale),
        });
        let dot = |n: usize| axes.iter().map(|axis| axis[0] * axis[n]).sum::<f64>();
        let speed = dot(0).sqrt();
        if speed < STILL { [0.0; 3] } else { [speed, dot(1) / speed, dot(2) / speed] }
    }

    /// The three derivatives of a motor, in steps. Before the first sample and behind the last one the motor stands.
    fn derivatives(&self, places: &[Place], at: usize, motor: usize) -> [f64; 3] {
        let middle = i64::from(places[at][motor]);
        let value = |at: usize| (i64::from(places[at][motor]) - middle) as f64;
        let (mut odd, mut cubes, mut even, mut squares) = (0.0, 0.0, 0.0, 0.0);
        for i in 1..=self.half {
            let (before, behind) =
                (value(at.saturating_sub(i)), value((at + i).min(places.len() - 1)));
            let (x, sum, difference) = (i as f64, behind + before, behind - before);
            odd += x * difference;
            cubes += x * x * x * difference;
            even += sum;
            squares += x * x * sum;
        }
        let Self { h, s0, s2, s4, s6, .. } = self;
        let of_odd = s2 * s6 - s4 * s4;
        let velocity = (odd * s6 - cubes * s4) / of_odd / h;
        let jerk = 6.0 * (cubes * s2 - odd * s4) / of_odd / h.powi(3);
        let acceleration = 2.0 * (squares * s0 - even * s2) / (s0 * s4 - s2 * s2) / h.powi(2);
        [velocity, acceleration, jerk]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of a motion of the first two motors.
    fn samples(at: impl Fn(f64) -> [f64; 2]) -> Samples {
        let place = |ms: u32| {
            let [x, y] = at(f64::from(ms) / 1e3).map(|steps| steps.round() as i64);
            [x, y, 0, 0]
        };
        let mut samples = Samples::from(place(0));
        (1..1_000).for_each(|ms| samples.tick(place(ms)));
        samples
    }

    #[test]
    fn a_cubic_has_its_derivatives() {
        // 10 t + 20 t^2 + 40 t^3 mm on each of two axes, with 100,000 steps/mm.
        let steps = |t: f64| 1e5 * (10.0 * t + 20.0 * t * t + 40.0 * t.powi(3));
        let curves = Curves::of(&samples(|t| [steps(t), steps(t)]), [1e-5, 1e-5, 0.0, 0.0]);
        let n = 250;
        let (t, root) = (n as f64 * 0.002, 2f64.sqrt());
        let near = |a: f32, b: f64| (f64::from(a) / (b * root) - 1.0).abs() < 0.01;
        assert!(near(curves.velocity[n], 10.0 + 40.0 * t + 120.0 * t * t));
        assert!(near(curves.acceleration[n], 40.0 + 240.0 * t));
        assert!(near(curves.jerk[n], 240.0));
    }

    #[test]
    fn steps_do_not_show_at_a_steady_speed() {
        // 10 mm/s with 40 steps/mm: less than a step between two samples.
        let curves = Curves::of(&samples(|t| [400.0 * t, 0.0]), [0.025, 0.025, 0.0, 0.0]);
        let steady = &curves.velocity[50..450];
        assert!(steady.iter().all(|v| (v - 10.0).abs() < 0.25), "{steady:?}");
    }

    #[test]
    fn rest_is_nothing() {
        let curves = Curves::of(&samples(|_| [7.0, 8.0]), [1.0; MOTORS]);
        assert!(curves.velocity.iter().all(|v| *v == 0.0));
        assert!(Curves::of(&Samples::NONE, [1.0; MOTORS]).jerk.is_empty());
    }
}
