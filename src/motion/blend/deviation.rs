//! How far what comes out of the means is off the path.

use super::limits::{in_lengths, reach};
use super::{Blend, Entry, ONE};
use crate::math::sqrt;
use crate::motion::smooth::SAMPLE_S;
use crate::units::FIRST_ROTARY;

impl Blend {
    /// Returns a bound of [`Blend::off`]. A window as long as the means reach lies within two windows.
    pub(super) fn most_off(&self, entry: &Entry, velocity: f32, accel: f32) -> f32 {
        let layers = &self.limits.kernel.layers;
        let (by_velocity, by_accel) =
            layers.iter().fold((0.0, 0.0), |(v, a), layer| (v + layer.velocity, a + layer.accel));
        let square = entry.asked[0].square.max(entry.asked[1].square);
        let change = sqrt(square as f32) * (2.0 / ONE);
        change * (velocity * by_velocity + accel * by_accel) + chord(accel)
    }

    /// Returns how far the path is off at a corner that is passed at `velocity`, mm, if the machine brakes before it and
    /// speeds up behind it by `accel`.
    pub(super) fn off(&self, corner: usize, velocity: f32, accel: f32) -> f32 {
        let kernel = &self.limits.kernel;
        let mut sum = [0.0f32; FIRST_ROTARY];
        let (mut ahead, mut ahead_way) = (corner, self.entry(corner).length);
        let (mut back, mut back_way) = match corner {
            0 => (0, u32::MAX),
            _ => (corner, self.entry(corner - 1).length),
        };
        for layer in &kernel.layers {
            let far = in_lengths(reach(velocity, accel, layer.seconds));
            while ahead_way < far && ahead + 1 < self.len {
                ahead += 1;
                ahead_way = ahead_way.saturating_add(self.entry(ahead).length);
            }
            while back_way < far && back > 1 {
                back -= 1;
                back_way = back_way.saturating_add(self.entry(back - 1).length);
            }
            let from = self.unit_ahead_of(back).unwrap_or(self.entry(corner).unit);
            let to = self.entry(ahead).unit;
            let weight = velocity * layer.velocity + accel * layer.accel;
            for ((sum, from), to) in sum.iter_mut().zip(from).zip(to) {
                if from != to {
                    *sum += weight * f32::from(to.wrapping_sub(from));
                }
            }
        }
        let square = sum.iter().map(|part| part * part).sum::<f32>();
        sqrt(square) * (1.0 / ONE) + chord(accel)
    }
}

/// Returns how far the chord of a sample is off, mm.
fn chord(accel: f32) -> f32 {
    0.25 * SAMPLE_S * accel * SAMPLE_S
}
