//! How the means spread a jump of velocity, and how far they put the path off.
//!
//! The means delay the path by a random time X, so to say: a sum of two, each spread evenly over a mean. At a place that
//! is t before or after a corner with a jump of velocity d, the path is off by d phi(t), where phi(t) is the mean of
//! |X| - |t| where that is above 0. If the velocity falls by `a` to the corner and rises behind it, it is off by
//! a Phi(t) more, where Phi(t) is the integral of phi from t on.
//!
//! Both are even, and fall with the distance. So they are taken as a sum of [`LAYERS`] steps, and what is off is the sum
//! of the changes of direction within the reach of each step, times its height.

use crate::motion::smooth::{SAMPLE_S, Spans};

/// Steps of the kernel.
pub const LAYERS: usize = 6;

/// The most samples that the means cover.
const SAMPLES: usize = 80;

/// Distances in time are counted in parts of half a sample. The number of these parts, and how long one is, s.
const PARTS: usize = LAYERS;
const PART_S: f32 = 0.5 * SAMPLE_S / PARTS as f32;

/// A step: its height for a velocity, s, and for an acceleration, s^2, and how far it reaches, s.
#[derive(Clone, Copy)]
pub struct Layer {
    pub seconds: f32,
    pub velocity: f32,
    pub accel: f32,
}

/// Places at which the shape of the kernel is known.
const PLACES: usize = 9;

/// The steps, the lowest one last.
pub struct Kernel {
    pub layers: [Layer; LAYERS],
    /// How much of a change at a corner has come out at some times, and how fast it comes out then, 1/s.
    pub shape: [(f32, f32); PLACES],
    reach: f32,
}

impl Kernel {
    /// No means.
    pub const NONE: Self = Self {
        layers: [Layer { seconds: 0.0, velocity: 0.0, accel: 0.0 }; LAYERS],
        shape: [(0.0, 0.0); PLACES],
        reach: 0.0,
    };

    /// Returns the kernel of these means. Cost: 20,000, in integers.
    pub fn of(spans: Spans) -> Self {
        let (weights, count) = weights(spans);
        let (a, b) = spans.samples();
        let all = 1.0 / (f32::from(a) * f32::from(b));
        let reach = 0.5 * count as f32 * SAMPLE_S;
        let mut kernel = Self { reach, ..Self::NONE };
        let step = reach / LAYERS as f32;
        let mut last = values(&weights, count, 0);
        for (n, layer) in kernel.layers.iter_mut().enumerate() {
            let next = values(&weights, count, n + 1);
            let [velocity, accel] = [last.0 - next.0, last.1 - next.1].map(|of| of as f32 * all);
            *layer = Layer {
                seconds: (n as f32 + 0.5) * step,
                velocity: velocity * PART_S,
                accel: 0.5 * accel * (PART_S * PART_S),
            };
            last = next;
        }
        for (n, (passed, height)) in kernel.shape.iter_mut().enumerate() {
            let at = (2 * n + 1) * count / (2 * PLACES);
            let here = weights.get(at).copied().unwrap_or(0);
            let before: u32 = weights.iter().take(at).map(|weight| u32::from(*weight)).sum();
            *passed = (2 * before + u32::from(here)) as f32 * (0.5 * all);
            *height = f32::from(here) * all * (1.0 / SAMPLE_S);
        }
        kernel
    }

    /// How far the means reach to either side, s.
    pub fn reach(&self) -> f32 {
        self.reach
    }
}

/// Returns phi at the end of a step, in parts of half a sample, and twice Phi, in their squares, each times all weights.
/// Step 0 ends in the middle. Both fit: a distance is 480 parts at most, and all weights are 240.
fn values(weights: &[u16; SAMPLES], count: usize, step: usize) -> (u32, u32) {
    let (mut phi, mut sum) = (0, 0);
    for (n, weight) in weights.iter().enumerate().take(count) {
        // From the middle of all samples to that of this one, less the steps.
        let place = PARTS * (2 * n + 1);
        if let Some(far) = place.checked_sub(PARTS * count + count * step) {
            let (far, weight) = (far as u32, u32::from(*weight));
            phi += weight * far;
            sum += weight * far * far;
        }
    }
    (phi, sum)
}

/// Returns the parts of a distance that come out in each sample, and the number of samples.
fn weights(spans: Spans) -> ([u16; SAMPLES], usize) {
    let mut weights = [0; SAMPLES];
    let (a, b) = spans.samples();
    let count = usize::from(spans.lag()) + 1;
    for (n, weight) in weights.iter_mut().enumerate().take(count) {
        let ends = (n + 1).min(count - n) as u16;
        *weight = ends.min(a.into()).min(b.into());
    }
    (weights, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of what is above 0, by the definition.
    fn exact(spans: Spans, t: f64) -> (f64, f64) {
        let (a, b) = spans.samples();
        let middle = f64::from(spans.lag()) / 2.0;
        let (mut phi, mut sum) = (0.0, 0.0);
        for m in 0..a {
            for n in 0..b {
                let far = (f64::from(m + n) - middle) * f64::from(SAMPLE_S) - t;
                if far > 0.0 {
                    (phi, sum) = (phi + far, sum + 0.5 * far * far);
                }
            }
        }
        let all = f64::from(a) * f64::from(b);
        (phi / all, sum / all)
    }

    #[test]
    fn layers_are_the_steps_of_the_kernel() {
        for ms in [1, 8, 27, 30, 43, 60] {
            let spans = Spans::of(ms as f32 * 1e-3);
            let kernel = Kernel::of(spans);
            for (n, layer) in kernel.layers.iter().enumerate() {
                let at =
                    |n: usize| exact(spans, n as f64 * f64::from(kernel.reach) / LAYERS as f64);
                let ((v0, a0), (v1, a1)) = (at(n), at(n + 1));
                assert!((f64::from(layer.velocity) - (v0 - v1)).abs() < 1e-5, "{ms} {n}");
                assert!((f64::from(layer.accel) - (a0 - a1)).abs() < 1e-7, "{ms} {n}");
            }
            let passed = kernel.shape.map(|place| place.0);
            assert!(passed.is_sorted() && (passed[PLACES / 2] - 0.5).abs() < 0.13, "{passed:?}");
        }
    }
}
