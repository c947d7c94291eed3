//! The sampler: turns the motion along blocks into distances of the motors in samples of equal length.
//!
//! Owned by exec (level 2), which calls [`Sampler::begin`] for a block, and [`Sampler::add`] for each stretch of it that
//! the [`Governor`](super::governor::Governor) returns. A stretch is no longer than what is left of the sample, so a
//! sample may hold the ends of several blocks. When the sample is full, exec takes it ([`Sampler::take`]). Where no
//! block follows, the machine stands still for the remainder of the sample ([`Sampler::pad`]).
//!
//! The distance that a motor still has to go is its distance in the block times the share of the path that is left, in
//! integers. So it is exact at both ends of the block, and no rounding error adds up.
//!
//! Units: phase units, s. Cost on AVR: 150 cycles a stretch, and 120 for each motor that moves; 60 a motor for a block
//! that lies in one stretch.

use super::block::{Line, PARTS_LOG2};
use super::float::{below, least, some, whole};
use super::smooth::{CHANNELS, SAMPLE_S};
use crate::boards::MOTORS;
use crate::dda::STEP_LOG2;
use crate::hal::arithmetic::product;

/// A sample with less time left than this is full, s. It is less than a tick, and more than rounding errors.
const FULL_S: f32 = SAMPLE_S / 4096.0;

/// The share of the path that is left is counted in 2^-31. This is the exponent.
const SHARE_LOG2: u8 = 31;

/// The sample that is being filled, and the remainder of the block.
#[derive(Debug)]
pub struct Sampler {
    /// The time left in the sample, s.
    left: f32,
    /// The distances in the sample.
    distances: [i32; CHANNELS],
    /// The distance of each motor in the block, in 1/16 step or, if `whole`, in steps.
    way: [i16; MOTORS],
    whole: bool,
    /// The distance of each motor to the end of the block.
    rest: [i32; MOTORS],
    /// Parts of the share of the path that is left, for each mm.
    scale: f32,
}

impl Sampler {
    /// An empty sample, and no block.
    pub const fn new() -> Self {
        Self {
            left: SAMPLE_S,
            distances: [0; CHANNELS],
            way: [0; MOTORS],
            whole: false,
            rest: [0; MOTORS],
            scale: 0.0,
        }
    }

    /// The time left in the sample, s.
    #[inline(always)]
    pub fn left(&self) -> f32 {
        self.left
    }

    /// Whether the sample is full.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        below(self.left, FULL_S)
    }

    /// Whether a part of the sample is filled.
    pub fn has_begun(&self) -> bool {
        below(self.left, SAMPLE_S)
    }

    /// Begins a block.
    #[inline(never)]
    pub fn begin(&mut self, line: &Line) {
        self.way = line.way;
        self.whole = line.extent.has_whole_steps();
        let shift = if self.whole { STEP_LOG2 } else { STEP_LOG2 - PARTS_LOG2 };
        for (rest, way) in self.rest.iter_mut().zip(self.way) {
            *rest = i32::from(way) << shift;
        }
        self.scale = 0.0;
    }

    /// Adds a stretch of `seconds` after which `left` mm of the block are left; `before` were left before.
    #[inline(never)]
    pub fn add(&mut self, seconds: f32, before: f32, left: f32) {
        self.left -= seconds;
        if !some(self.scale) {
            self.scale = (1u32 << SHARE_LOG2) as f32 / before;
        }
        let share = whole(left * self.scale);
        let moved = self.rest.iter_mut().zip(self.way).zip(&mut self.distances);
        for ((rest, way), distance) in moved {
            if way != 0 {
                let now = part(way, share, self.whole);
                *distance += *rest - now;
                *rest = now;
            }
        }
    }

    /// Adds a stretch of `seconds` that ends the block.
    #[inline(never)]
    pub fn end(&mut self, seconds: f32) {
        self.left -= seconds;
        for (rest, to) in self.rest.iter_mut().zip(&mut self.distances) {
            *to += core::mem::take(rest);
        }
    }

    /// Fills the sample with a standstill.
    pub fn pad(&mut self) {
        self.left = 0.0;
    }

    /// Returns the distances in the sample, and begins the next one.
    #[inline(always)]
    pub fn take(&mut self) -> [i32; CHANNELS] {
        // A stretch that ended a block may have taken slightly longer than the sample.
        self.left = least(self.left + SAMPLE_S, SAMPLE_S);
        core::mem::replace(&mut self.distances, [0; CHANNELS])
    }

    /// Forgets the block and the sample: the machine stands still where it is.
    #[inline(never)]
    #[small]
    pub fn clear(&mut self) {
        self.left = SAMPLE_S;
        self.distances = [0; CHANNELS];
        self.rest = [0; MOTORS];
        self.way = [0; MOTORS];
    }
}

impl Default for Sampler {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns a `share`, in 2^-31, of a distance in 1/16 step or in whole steps, in phase units, rounded towards 0.
#[inline(always)]
fn part(way: i16, share: u32, whole: bool) -> i32 {
    let size = way.unsigned_abs();
    // The product, in 2^-15. Its lower half is less than a phase unit.
    let product = product(size, (share >> 16) as u16) + (product(size, share as u16) >> 16);
    let units = if whole { product } else { product >> PARTS_LOG2 } as i32;
    if way < 0 { -units } else { units }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::block::Extent;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn all_of_a_block_is_handed_out(
            way: i16, length in 0.01f32..2_000.0, steps: bool,
            cuts in prop::collection::vec(0f32..1.0, 0..20),
        ) {
            let way = way.max(-i16::MAX);
            let mut line = Line { extent: Extent::new(length, steps), ..Line::default() };
            line.way[0] = way;
            let mut sampler = Sampler::new();
            sampler.begin(&line);
            let (mut left, mut cuts, mut sum) = (length, cuts, 0i64);
            cuts.sort_by(f32::total_cmp);
            for cut in cuts {
                let next = length * (1.0 - cut);
                sampler.add(0.0, left, next);
                left = next;
                let distance = i64::from(sampler.take()[0]);
                prop_assert!(distance == 0 || (distance < 0) == (way < 0));
                sum += distance;
                let all = f64::from(way) * if steps { 32_768.0 } else { 2_048.0 };
                let exact = all * f64::from(cut);
                prop_assert!((sum as f64 - exact).abs() < 4.0 + all.abs() * 3e-7, "{sum} {exact}");
            }
            sampler.end(0.0);
            sum += i64::from(sampler.take()[0]);
            prop_assert_eq!(sum, i64::from(way) << if steps { 15 } else { 11 });
        }

        #[test]
        fn a_share_is_a_product(way in -i16::MAX..=i16::MAX, share in 0u32..=1 << 31) {
            let exact = f64::from(way) * f64::from(share) / 2f64.powi(31);
            prop_assert!((f64::from(part(way, share, true)) / 32_768.0 - exact).abs() < 1e-4);
            prop_assert!((f64::from(part(way, share, false)) / 2_048.0 - exact).abs() < 1e-3);
        }
    }
}
