//! Overrides as motion sees them: by what velocities are multiplied, and how far a line may be sped up.
//!
//! Blocks are planned for twice their feed: corners, and what potentials need (`horizon`). How much faster
//! than asked a line may be run, [`Reserve`], fits in the byte of its length that says nothing of use. So a
//! factor can change at any time, for what is queued too; only the keys of the horizon depend on it
//! (`replan`).
//!
//! Cost on AVR: 40 cycles for a velocity at 100 %, else 250.

use super::float::{least, scaled};

/// What feeds and traverses are multiplied by, both above 0, feeds at most 2, traverses 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factors {
    /// Of lines with a feed.
    pub feed: f32,
    /// Of the others.
    pub traverse: f32,
}

impl Factors {
    /// As programmed.
    pub const ONE: Self = Self { feed: 1.0, traverse: 1.0 };

    /// The lesser of each.
    #[inline(always)]
    pub fn least(&self, other: &Self) -> Self {
        let feed = least(self.feed, other.feed);
        Self { feed, traverse: least(self.traverse, other.traverse) }
    }

    /// Whether they are the same, bit for bit.
    #[inline(always)]
    pub fn same(&self, other: &Self) -> bool {
        let bits = |factors: &Self| (factors.feed.to_bits(), factors.traverse.to_bits());
        bits(self) == bits(other)
    }
}

/// How many times its cruise velocity a line may be run at, less one, in 1/128; or that it is a traverse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reserve(u8);

/// In a [`Reserve`]: twice as fast.
const TWICE: u8 = 128;

impl Reserve {
    /// A traverse, which nothing speeds up.
    pub const TRAVERSE: Self = Self(u8::MAX);

    /// Of a line at `cruise` that may be run at `top`, no less than that and at most twice as much.
    /// Cost: 30; 1,000 between the two.
    #[inline(always)]
    pub fn new(cruise: f32, top: f32) -> Self {
        if top.to_bits() == cruise.to_bits() {
            Self(0)
        } else if top.to_bits() >= scaled(cruise, 1).to_bits() {
            Self(TWICE)
        } else {
            Self::between(cruise, top)
        }
    }

    #[inline(never)]
    fn between(cruise: f32, top: f32) -> Self {
        Self(((top - cruise) * f32::from(TWICE) / cruise) as u8)
    }
}

/// The length of a line, mm, and its [`Reserve`] in the last byte of the mantissa: 0.002 % exact.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extent(u32);

impl Extent {
    /// Both.
    pub fn new(length: f32, reserve: Reserve) -> Self {
        Self(length.to_bits() & !0xFF | u32::from(reserve.0))
    }

    /// The length, mm.
    #[inline(always)]
    pub fn length(self) -> f32 {
        f32::from_bits(self.0 & !0xFF)
    }

    /// What a line at `cruise` is to be run at.
    #[inline(always)]
    pub fn velocity(self, cruise: f32, factors: &Factors) -> f32 {
        let reserve = self.0 as u8;
        let traverse = reserve == Reserve::TRAVERSE.0;
        let factor = if traverse { factors.traverse } else { factors.feed };
        if factor.to_bits() == 1.0f32.to_bits() {
            return cruise;
        }
        times(cruise, factor, reserve)
    }
}

#[inline(never)]
fn times(cruise: f32, factor: f32, reserve: u8) -> f32 {
    if factor.to_bits() < 1.0f32.to_bits() {
        return cruise * factor;
    }
    let most = 1.0 + f32::from(reserve.min(TWICE)) * (1.0 / f32::from(TWICE));
    cruise * least(factor, most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_factor_exceeds_the_top(
            cruise in 1e-5f32..1e5, more in 1.0f32..2.0, length in 1e-4f32..1e4, feed in 0.05f32..=2.0,
        ) {
            let top = cruise * more;
            let extent = Extent::new(length, Reserve::new(cruise, top));
            prop_assert!((extent.length() / length - 1.0).abs() < 2e-5 + 1e-5);
            let got = extent.velocity(cruise, &Factors { feed, ..Factors::ONE });
            let best = top.min(cruise * feed);
            prop_assert!(got <= best * 1.000_001 && got > best * 0.992, "{got} of {best}");
        }
    }

    #[test]
    fn traverses_have_their_own_factor() {
        let extent = Extent::new(7.0, Reserve::TRAVERSE);
        let factors = Factors { feed: 2.0, traverse: 0.25 };
        assert_eq!(extent.velocity(8.0, &factors), 2.0);
        let extent = Extent::new(7.0, Reserve::new(8.0, 16.0));
        assert_eq!((extent.velocity(8.0, &factors), extent.length()), (16.0, 7.0));
        assert_eq!(extent.velocity(8.0, &Factors::ONE), 8.0);
    }
}
