//! How the means spread a jump of velocity, and how far they put the path off.
//!
//! The means delay the path by a random time X, so to say: a sum of two, each spread evenly over a mean. At a place that
//! is t before or after a corner with a jump of velocity d, the path is off by d phi(t), where phi(t) is the mean of
//! |X| - |t| where that is above 0. If the velocity falls by `a` to the corner and rises behind it, it is off by
//! a Phi(t) more, where Phi(t) is the integral of phi from t on.
//!
//! A filter against ringing is part of the kernel. Where it is not the same from either end, what it does is taken as that of
//! the mean of both: it puts the path off by a little less.
//!
//! Both are even, and fall with the distance. So they are taken as a sum of [`LAYERS`] steps, and what is off is the sum
//! of the changes of direction within the reach of each step, times its height.

use crate::motion::shaper::{WEIGHTS, Weights};
use crate::motion::smooth::{CORNER, JERK_MOST, SAMPLE_S, Spans};

/// Steps of the kernel.
pub const LAYERS: usize = 6;

/// The most samples that the means and the filter cover.
const SAMPLES: usize = (CORNER + JERK_MOST) as usize + WEIGHTS;

/// The sum of the weights of the filter, as a power of two.
const FILTER_LOG2: u8 = 10;

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
        let all = 1.0 / weights.iter().sum::<u32>() as f32;
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
            let before: u32 = weights.iter().take(at).sum();
            *passed = (2 * before + here) as f32 * (0.5 * all);
            *height = here as f32 * all * (1.0 / SAMPLE_S);
        }
        kernel
    }

    /// How far the means reach to either side, s.
    pub fn reach(&self) -> f32 {
        self.reach
    }
}

/// Returns phi at the end of a step, in parts of half a sample, and twice Phi, in their squares, each times all weights.
/// Step 0 ends in the middle. Both fit: a distance is 700 parts at most, and all weights are 2^18.
fn values(weights: &[u32; SAMPLES], count: usize, step: usize) -> (u64, u64) {
    let (mut phi, mut sum) = (0, 0);
    for (n, weight) in weights.iter().enumerate().take(count) {
        // From the middle of all samples to that of this one, less the steps.
        let place = PARTS * (2 * n + 1);
        if let Some(far) = place.checked_sub(PARTS * count + count * step) {
            let far = far as u32;
            phi += u64::from(weight * far);
            sum += u64::from(weight * far) * u64::from(far);
        }
    }
    (phi, sum)
}

/// Returns the parts of a distance that come out in each sample, the same from either end, and the number of samples.
fn weights(spans: Spans) -> ([u32; SAMPLES], usize) {
    let mut weights = [0; SAMPLES];
    let (a, b) = spans.samples();
    let means = usize::from(spans.lag()) + 1;
    for (n, weight) in weights.iter_mut().enumerate().take(means) {
        let ends = (n + 1).min(means - n) as u32;
        *weight = ends.min(a.into()).min(b.into());
    }
    let filter = spans.resonances().map_or(Weights::NONE, Weights::of);
    if filter.parts().is_empty() { (weights, means) } else { filtered(&weights, means, &filter) }
}

/// Returns what a filter makes of weights, and their number.
#[inline(never)]
fn filtered(weights: &[u32; SAMPLES], means: usize, filter: &Weights) -> ([u32; SAMPLES], usize) {
    let parts = filter.parts();
    let mut all = [0; SAMPLES];
    for (n, weight) in weights.iter().enumerate().take(means) {
        let both = parts.iter().zip(parts.iter().rev());
        for (out, (one, other)) in all.iter_mut().skip(n).zip(both) {
            *out += weight * ((u32::from(*one) + u32::from(*other)) >> (16 - FILTER_LOG2));
        }
    }
    (all, means + parts.len() - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::shape::{Resonances, SHAPED};

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

    /// A filter that is the same from either end: the kernel is that of the means, moved to each of its weights.
    #[test]
    fn a_filter_spreads_the_kernel() {
        let mut resonances = Resonances { hertz: [310, 0, 0], ..Resonances::NONE };
        for kind in [0, 1] {
            (resonances.kind, resonances.damping) = (kind, 0);
            let means = Spans::of(0.03);
            let (kernel, filter) =
                (Kernel::of(means.and_shaper([resonances; SHAPED])), Weights::of(&resonances));
            let middle = f64::from(filter.lag()) / 2.0;
            let phi = |t: f64| -> f64 {
                let parts = filter.parts().iter().enumerate();
                let one = |(n, part): (usize, &u16)| {
                    let t = t - (n as f64 - middle) * f64::from(SAMPLE_S);
                    f64::from(*part) / 32_768.0 * exact(means, t).0
                };
                parts.map(one).sum()
            };
            let step = f64::from(kernel.reach) / LAYERS as f64;
            for (n, layer) in kernel.layers.iter().enumerate() {
                let due = phi(n as f64 * step) - phi((n + 1) as f64 * step);
                let is = f64::from(layer.velocity);
                assert!((is - due).abs() < 3e-5 + 0.01 * due, "{kind} {n}: {is} {due}");
            }
        }
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
