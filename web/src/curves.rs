//! Velocity, acceleration and jerk of an axis, and the speed along the path, computed from samples of steps.
//!
//! They are differences of positions about [`WINDOW_S`] apart ([`Windows`]), and not smoothed otherwise. The page asks
//! for them when a job is done. Cost: 30 ns a sample and curve. A job without samples has empty curves.

use kerf::boards::MOTORS;

use crate::samples::Samples;
use crate::windows::Windows;

/// The time between positions from which accelerations are computed, s. Velocity and jerk have twice as much.
pub const WINDOW_S: f64 = 0.010;

/// Returns the windows of samples.
pub fn windows(samples: &Samples) -> Windows {
    Windows::new(f64::from(samples.interval_ms()) / 1e3, WINDOW_S)
}

/// Which derivative a curve shows.
#[derive(Clone, Copy, Debug)]
pub enum Quantity {
    /// mm/s.
    Velocity,
    /// mm/s^2.
    Acceleration,
    /// mm/s^3.
    Jerk,
}

/// Returns a curve of a motor whose steps have a length of `mm`, a value for each sample.
pub fn curve(samples: &Samples, quantity: Quantity, motor: usize, mm: f64) -> Vec<f32> {
    let windows = windows(samples);
    let places: Vec<f64> = samples.places(motor).map(|steps| steps * mm).collect();
    let value = |at: usize| match quantity {
        Quantity::Velocity => windows.velocity(&places, at),
        Quantity::Acceleration => windows.acceleration(&places, at),
        Quantity::Jerk => windows.jerk(&places, at),
    };
    (0..places.len()).map(|at| value(at) as f32).collect()
}

/// Returns the speed along the path. `scale` is the length of a step of each motor, mm; 0 for a motor that does not
/// count.
pub fn speed(samples: &Samples, scale: [f64; MOTORS]) -> Vec<f32> {
    let mut squares = vec![0.0; samples.len()];
    for (motor, mm) in scale.into_iter().enumerate().filter(|(_, mm)| *mm != 0.0) {
        let velocities = curve(samples, Quantity::Velocity, motor, mm);
        squares.iter_mut().zip(velocities).for_each(|(sum, v)| *sum += v * v);
    }
    squares.into_iter().map(f32::sqrt).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of a motion of the first two motors, whose steps come when they are half done.
    fn samples(at: impl Fn(f64) -> [f64; 2]) -> Samples {
        const FINE: u32 = 100;
        let mut samples = Samples::from([0; MOTORS]);
        let mut steps = at(0.0).map(|place| place.round() as i64);
        for tick in 1..1_000 * FINE {
            let ms = f64::from(tick) / f64::from(FINE);
            for (motor, place) in at(ms / 1e3).into_iter().enumerate() {
                let new = place.round() as i64;
                if new != std::mem::replace(&mut steps[motor], new) {
                    samples.step(motor, new, ms);
                }
            }
            if tick.is_multiple_of(FINE) {
                samples.tick();
            }
        }
        samples
    }

    #[test]
    fn a_cubic_has_its_derivatives() {
        // 10 t + 20 t^2 + 40 t^3 mm, with 1,280 steps/mm.
        let steps = |t: f64| 1_280.0 * (10.0 * t + 20.0 * t * t + 40.0 * t.powi(3));
        let samples = samples(|t| [steps(t), 0.0]);
        let curve = |quantity| curve(&samples, quantity, 0, 1.0 / 1_280.0);
        let n = 250;
        let t = n as f64 * 0.002;
        let off = |quantity, b: f64| (f64::from(curve(quantity)[n]) / b - 1.0).abs();
        assert!(off(Quantity::Velocity, 10.0 + 40.0 * t + 120.0 * t * t) < 0.01);
        assert!(off(Quantity::Acceleration, 40.0 + 240.0 * t) < 0.1);
        let jerk = &curve(Quantity::Jerk)[50..450];
        let mean = jerk.iter().sum::<f32>() / 400.0;
        assert!((mean / 240.0 - 1.0).abs() < 0.1, "{mean}");
    }

    #[test]
    fn steps_do_not_show_at_a_steady_speed() {
        // 10 mm/s with 40 steps/mm: less than a step between two samples.
        let samples = samples(|t| [400.0 * t, 0.0]);
        let speed = speed(&samples, [0.025, 0.025, 0.0, 0.0]);
        assert!(speed[50..450].iter().all(|v| (v - 10.0).abs() < 0.1), "{speed:?}");
        let acceleration = curve(&samples, Quantity::Acceleration, 0, 0.025);
        assert!(acceleration[50..450].iter().all(|a| a.abs() < 12.0), "{acceleration:?}");
    }

    #[test]
    fn a_corner_is_seen_by_its_axes() {
        // Along X and then along Y, at 10 mm/s: X stops at once, which is 1,000 mm/s^2 over 10 ms.
        let corner = |t: f64| [t.min(0.5) * 12_800.0, (t - 0.5).max(0.0) * 12_800.0];
        let scale = 1.0 / 1_280.0;
        let samples = samples(corner);
        for (motor, sign) in [(0, -1.0), (1, 1.0)] {
            let curve = curve(&samples, Quantity::Acceleration, motor, scale);
            let most = curve[50..450].iter().map(|a| sign * a).fold(0.0, f32::max);
            assert!((most / 1_000.0 - 1.0).abs() < 0.05, "{most}");
        }
    }

    #[test]
    fn rest_is_nothing() {
        let samples = samples(|_| [7.0, 8.0]);
        assert!(speed(&samples, [1.0; MOTORS]).iter().all(|v| *v == 0.0));
        assert!(curve(&Samples::NONE, Quantity::Jerk, 9, 1.0).is_empty());
    }
}
