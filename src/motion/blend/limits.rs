//! What limits all corners, and the measures of paths.

use super::kernel::Kernel;
use super::{ONE, PER_MM, SHARE, WEIGHT};
use crate::hal::arithmetic::product;
use crate::math::sqrt;
use crate::units::PerAxis;

/// What limits all corners.
pub(super) struct Limits {
    pub(super) kernel: Kernel,
    /// The reach of the kernel times a velocity, and half its square times an acceleration, make a length.
    pub(super) spans: [f32; 2],
    /// How long windows are, s: as each mean.
    pub(super) windows: [f32; 2],
    /// P, mm.
    pub(super) deviation: f32,
    /// The least acceleration limit of an axis, mm/s^2.
    pub(super) accel: f32,
    /// That over the acceleration limit of each axis, in 2^-8.
    pub(super) weights: PerAxis<u16>,
    /// The acceleration limit of each axis, mm/s^2.
    pub(super) accels: PerAxis<f32>,
}

impl Limits {
    /// Returns the change between two directions of the axis that is limited most, weighted, in 2^-22.
    pub(super) fn change(&self, from: &PerAxis<i16>, to: &PerAxis<i16>) -> u32 {
        let mut most = 0;
        for ((from, to), weight) in from.iter().zip(to).zip(&self.weights) {
            most = most.max(product(to.abs_diff(*from), *weight));
        }
        most
    }

    /// Returns the highest velocity at corners that change by `change` within `seconds`.
    pub(super) fn velocity(&self, change: u32, seconds: f32) -> f32 {
        if change == 0 {
            return f32::MAX;
        }
        (SHARE * WEIGHT * ONE) * seconds * self.accel / change as f32
    }

    /// Returns the least acceleration limit of the axes that move in one of these directions.
    pub(super) fn slowest(&self, from: &PerAxis<i16>, to: &PerAxis<i16>) -> f32 {
        let mut slowest = f32::MAX;
        for ((from, to), accel) in from.iter().zip(to).zip(&self.accels) {
            if (*from != 0 || *to != 0) && *accel > 0.0 {
                slowest = slowest.min(*accel);
            }
        }
        slowest
    }
}

/// Returns the share of a change of velocity that a change of direction takes at a velocity of 1 mm/s.
pub(super) fn taken(square: u32, change: f32) -> f32 {
    sqrt(square as f32) / (ONE * change)
}

/// Returns a length in 0.1 um.
pub(super) fn in_lengths(mm: f32) -> u32 {
    (mm * PER_MM) as u32
}

/// Returns the longest path that may be covered within `seconds` between two places that are passed at `velocity`, mm.
pub(super) fn reach(velocity: f32, accel: f32, seconds: f32) -> f32 {
    (velocity + 0.25 * accel * seconds) * seconds
}

/// Returns the longest path that may be covered within `seconds` before a place that is passed at `velocity`, mm.
pub(super) fn zone(velocity: f32, accel: f32, seconds: f32) -> f32 {
    (velocity + 0.5 * accel * seconds) * seconds
}
