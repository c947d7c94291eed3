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

    /// Returns the kernel of these means.
    pub fn of(spans: Spans) -> Self {
        let count = usize::from(spans.lag()) + 1;
        let half = 0.5 * count as f32;
        let mut kernel = Self { reach: half * SAMPLE_S, ..Self::NONE };
        let step = kernel.reach / LAYERS as f32;
        let mut last = values(spans, 0.0);
        for (n, layer) in kernel.layers.iter_mut().enumerate() {
            let next = values(spans, (n + 1) as f32 * step);
            *layer = Layer {
                seconds: (n as f32 + 0.5) * step,
                velocity: last.0 - next.0,
                accel: last.1 - next.1,
            };
            last = next;
        }
        let weights = weights(spans);
        for (n, (passed, height)) in kernel.shape.iter_mut().enumerate() {
            let at = (2 * n + 1) * count / (2 * PLACES);
            *passed = weights.iter().take(at).sum::<f32>() + 0.5 * weights.get(at).unwrap_or(&0.0);
            *height = weights.get(at).unwrap_or(&0.0) * (1.0 / SAMPLE_S);
        }
        kernel
    }

    /// How far the means reach to either side, s.
    pub fn reach(&self) -> f32 {
        self.reach
    }
}

/// Returns phi and Phi at `t`, s and s^2.
fn values(spans: Spans, t: f32) -> (f32, f32) {
    let middle = 0.5 * f32::from(spans.lag());
    let (mut phi, mut sum) = (0.0, 0.0);
    for (n, weight) in weights(spans).iter().enumerate() {
        let far = (n as f32 - middle) * SAMPLE_S - t;
        if far > 0.0 {
            phi += weight * far;
            sum += weight * (0.5 * far * far);
        }
    }
    (phi, sum)
}

/// Returns the share of a distance that comes out in each sample.
fn weights(spans: Spans) -> [f32; SAMPLES] {
    let mut weights = [0.0; SAMPLES];
    let (a, b) = spans.samples();
    let share = 1.0 / (f32::from(a) * f32::from(b));
    for m in 0..usize::from(a) {
        for n in 0..usize::from(b) {
            if let Some(weight) = weights.get_mut(m + n) {
                *weight += share;
            }
        }
    }
    weights
}
