//! Derivatives of a sampled distance. At every sample a cubic is fitted to a window around it, by least squares
//! (Savitzky and Golay). Noise of a step or two does not show; details shorter than half a window are rounded off.

/// Returns the first, second and third derivative at each sample. Outside the samples the distance is taken as
/// constant.
pub fn derivatives(way: &[f64], window_ms: u32, sample_s: f64) -> [Vec<f64>; 3] {
    let half = ((f64::from(window_ms) / 2000.0 / sample_s) as i32).max(2);
    let fit = Fit::new(half);
    let fitted = (0..way.len()).map(|at| fit.at(way, at));
    let mut derivatives: [Vec<f64>; 3] = Default::default();
    for [first, second, third] in fitted {
        derivatives[0].push(first / sample_s);
        derivatives[1].push(2.0 * second / sample_s.powi(2));
        derivatives[2].push(6.0 * third / sample_s.powi(3));
    }
    derivatives
}

/// The normal equations of a cubic over -half to half.
struct Fit {
    half: i32,
    /// Sums of the 0th, 2nd, 4th and 6th powers.
    sums: [f64; 4],
}

impl Fit {
    fn new(half: i32) -> Self {
        let sum = |power: i32| (-half..=half).map(|i| f64::from(i).powi(power)).sum();
        Fit { half, sums: [sum(0), sum(2), sum(4), sum(6)] }
    }

    /// Returns the coefficients of the first, second and third power around a sample.
    fn at(&self, way: &[f64], at: usize) -> [f64; 3] {
        let last = way.len() as i64 - 1;
        let (centre, mut moments) = (way[at], [0.0; 4]);
        for i in -self.half..=self.half {
            let index = (at as i64 + i64::from(i)).clamp(0, last);
            let (x, y) = (f64::from(i), way[index as usize] - centre);
            moments[0] += y;
            moments[1] += x * y;
            moments[2] += x * x * y;
            moments[3] += x * x * x * y;
        }
        let [s0, s2, s4, s6] = self.sums;
        let odd = s2 * s6 - s4 * s4;
        let even = s0 * s4 - s2 * s2;
        [
            (s6 * moments[1] - s4 * moments[3]) / odd,
            (s0 * moments[2] - s2 * moments[0]) / even,
            (s2 * moments[3] - s4 * moments[1]) / odd,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_met_exactly() {
        let way: Vec<f64> = (0..200).map(|n| f64::from(n) * 1e-3).map(cubic).collect();
        let [velocity, acceleration, jerk] = derivatives(&way, 40, 1e-3);
        for n in 30..170 {
            let t = n as f64 * 1e-3;
            assert!((velocity[n] - (3.0 + 4.0 * t - 15.0 * t * t)).abs() < 1e-6);
            assert!((acceleration[n] - (4.0 - 30.0 * t)).abs() < 1e-4);
            assert!((jerk[n] + 30.0).abs() < 1e-2, "{}", jerk[n]);
        }
    }

    fn cubic(t: f64) -> f64 {
        3.0 * t + 2.0 * t * t - 5.0 * t * t * t
    }

    #[test]
    fn rest_is_rest() {
        let [velocity, acceleration, jerk] = derivatives(&[7.0; 50], 20, 1e-3);
        assert!(velocity.iter().chain(&acceleration).chain(&jerk).all(|d| *d == 0.0));
    }
}
