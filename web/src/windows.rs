//! Velocity, acceleration and jerk of an axis, computed from its positions at equal intervals.
//!
//! Each value is a difference of positions that are a window of time apart, or two windows for velocity and jerk. So it
//! is a mean of the real quantity, and never larger than the largest real value. Nothing else is smoothed. Before the
//! first position and after the last one the axis stands still. Pure functions without state. Cost: ten operations a
//! value.
//!
//! The simulator includes this file too, so that its plot and the page show the same.

/// The times between positions that are compared.
#[derive(Clone, Copy, Debug)]
pub struct Windows {
    /// Samples in a window.
    reach: usize,
    seconds: f64,
}

impl Windows {
    /// Windows of about `seconds`, in whole samples, of which one comes every `sample_s`.
    pub fn new(sample_s: f64, seconds: f64) -> Self {
        let reach = ((seconds / sample_s).round() as usize).max(1);
        Self { reach, seconds: reach as f64 * sample_s }
    }

    /// Returns the length of a window, s. Velocity and jerk have windows of twice this length.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Returns the velocity around position `at`.
    pub fn velocity(&self, places: &[f64], at: usize) -> f64 {
        self.difference(places, at, 1) / (2.0 * self.seconds)
    }

    /// Returns the acceleration around position `at`.
    pub fn acceleration(&self, places: &[f64], at: usize) -> f64 {
        let [before, here, behind] = [
            place(places, at.saturating_sub(self.reach)),
            place(places, at),
            place(places, at + self.reach),
        ];
        (before - 2.0 * here + behind) / self.seconds.powi(2)
    }

    /// Returns the jerk around position `at`.
    pub fn jerk(&self, places: &[f64], at: usize) -> f64 {
        let third = self.difference(places, at, 3) - 3.0 * self.difference(places, at, 1);
        third / (2.0 * self.seconds).powi(3)
    }

    /// Returns how far the axis goes from so many windows before position `at` to as many behind it.
    fn difference(&self, places: &[f64], at: usize, windows: usize) -> f64 {
        let reach = windows * self.reach;
        place(places, at + reach) - place(places, at.saturating_sub(reach))
    }
}

/// Returns a position; behind the end the last one, and 0 if there are none.
fn place(places: &[f64], at: usize) -> f64 {
    places.get(at).or(places.last()).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_has_its_derivatives() {
        let place = |t: f64| 3.0 * t + 2.0 * t * t - 5.0 * t.powi(3);
        let places: Vec<f64> = (0..300).map(|n| place(f64::from(n) * 1e-3)).collect();
        let windows = Windows::new(1e-3, 0.010);
        for n in 30..270 {
            let t = n as f64 * 1e-3;
            // The mean of a square over a window is larger than the square in the middle.
            let velocity = 3.0 + 4.0 * t - 15.0 * t * t;
            assert!((windows.velocity(&places, n) - velocity).abs() < 1e-3);
            assert!((windows.acceleration(&places, n) - (4.0 - 30.0 * t)).abs() < 1e-6);
            assert!((windows.jerk(&places, n) + 30.0).abs() < 1e-4);
        }
    }

    #[test]
    fn an_axis_stands_still_around_its_positions() {
        let windows = Windows::new(0.002, 0.010);
        assert_eq!(windows.seconds(), 0.010);
        for places in [&[][..], &[7.0; 50]] {
            for at in [0, 3, 49, 90] {
                assert_eq!(windows.velocity(places, at), 0.0);
                assert_eq!(windows.acceleration(places, at), 0.0);
                assert_eq!(windows.jerk(places, at), 0.0);
            }
        }
    }

    #[test]
    fn a_window_is_at_least_a_sample() {
        assert_eq!(Windows::new(0.016, 0.010).seconds(), 0.016);
    }
}
