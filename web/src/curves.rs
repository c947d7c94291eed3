//! Computes velocity, acceleration and jerk along the path from samples of steps.
//!
//! First the distance along the path is summed from sample to sample. Where steps are coarse, positions are averaged
//! first, over up to 8 ms before and after a sample, because a staircase is longer than its slope. Then a cubic is
//! fitted to the distance over 30 ms before and after a sample (least squares), so that single steps do not show. Its
//! derivatives in the middle are the curves. The page calls this when a job is done. Cost: 150 ns a sample. A job
//! without samples has empty curves.

use kerf::boards::MOTORS;

use crate::samples::{Place, Samples};

/// Half of the time that a fit covers, ms.
const HALF_MS: u32 = 30;
/// The least number of samples on each side of a cubic.
const LEAST: usize = 3;
/// Positions are averaged over one more sample on each side for each of these lengths (mm) that the coarsest step has,
/// up to [`MOST_AVERAGED`].
const COARSE: f64 = 0.006;
const MOST_AVERAGED: usize = 4;

/// One value for each sample: mm/s, mm/s^2, mm/s^3.
#[derive(Default)]
pub struct Curves {
    /// The velocity along the path.
    pub velocity: Vec<f32>,
    /// The acceleration along the path.
    pub acceleration: Vec<f32>,
    /// The jerk along the path.
    pub jerk: Vec<f32>,
}

impl Curves {
    /// Computes the curves of samples. `scale` is the length of a step of each motor, mm; 0 for a motor that does not
    /// count.
    pub fn of(samples: &Samples, scale: [f64; MOTORS]) -> Self {
        let fit = Fit::new(samples.interval_ms());
        let way = way(samples.places(), scale);
        let mut curves = Self::default();
        for at in 0..way.len() {
            let [v, a, j] = fit.derivatives(&way, at);
            curves.velocity.push(v as f32);
            curves.acceleration.push(a as f32);
            curves.jerk.push(j as f32);
        }
        curves
    }
}

/// Returns the distance along the path at each sample, mm.
fn way(places: &[Place], scale: [f64; MOTORS]) -> Vec<f64> {
    let coarsest = scale.iter().fold(0.0, |most: f64, mm| most.max(mm.abs()));
    let reach = ((coarsest / COARSE) as usize).min(MOST_AVERAGED);
    let last = places.len().saturating_sub(1);
    // The distance of a motor from the average around one sample to the average around the next.
    let went = |at: usize, m: usize| {
        let (new, old) = ((at + 1 + reach).min(last), at.saturating_sub(reach));
        let steps = i64::from(places[new][m]) - i64::from(places[old][m]);
        steps as f64 * scale[m] / (2 * reach + 1) as f64
    };
    let mut sum = 0.0;
    let steps = (0..last).map(|at| {
        sum += (0..MOTORS).map(|m| went(at, m).powi(2)).sum::<f64>().sqrt();
        sum
    });
    std::iter::once(0.0).chain(steps).take(places.len()).collect()
}

/// The sums for the fit of a cubic over `-half..=half`, and the time between samples, s.
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

    /// Returns the three derivatives. Before the first sample and after the last one the tool stands still.
    fn derivatives(&self, way: &[f64], at: usize) -> [f64; 3] {
        let last = way.len() - 1;
        if way[at.saturating_sub(self.half)] == way[(at + self.half).min(last)] {
            return [0.0; 3];
        }
        let value = |other: usize| way[other] - way[at];
        let (mut odd, mut cubes, mut even, mut squares) = (0.0, 0.0, 0.0, 0.0);
        for i in 1..=self.half {
            let (before, behind) = (value(at.saturating_sub(i)), value((at + i).min(last)));
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
    fn a_circle_at_a_steady_speed_has_no_acceleration_along_it() {
        // A radius of 5 mm at 20 mm/s, with fine steps and with coarse ones.
        for (steps, most) in [(1_280.0, 4.0), (40.0, 60.0)] {
            let circle = |t: f64| [(4.0 * t).cos() * 5.0 * steps, (4.0 * t).sin() * 5.0 * steps];
            let scale = 1.0 / steps;
            let curves = Curves::of(&samples(circle), [scale, scale, 0.0, 0.0]);
            assert!(curves.velocity[50..450].iter().all(|v| (v - 20.0).abs() < 0.6));
            assert!(curves.acceleration[50..450].iter().all(|a| a.abs() < most));
        }
    }

    #[test]
    fn a_corner_is_no_stop() {
        // Along X and then along Y, at 10 mm/s.
        let corner = |t: f64| [t.min(0.5) * 12_800.0, (t - 0.5).max(0.0) * 12_800.0];
        let scale = 1.0 / 1_280.0;
        let curves = Curves::of(&samples(corner), [scale, scale, 0.0, 0.0]);
        assert!(curves.velocity[50..450].iter().all(|v| (v - 10.0).abs() < 0.1));
    }

    #[test]
    fn rest_is_nothing() {
        let curves = Curves::of(&samples(|_| [7.0, 8.0]), [1.0; MOTORS]);
        assert!(curves.velocity.iter().all(|v| *v == 0.0));
        assert!(Curves::of(&Samples::NONE, [1.0; MOTORS]).jerk.is_empty());
    }
}
