//! Override factors, and the limit to which each line may be sped up.
//!
//! The corners of blocks, and the potentials that these need (`speed_constraints`), are planned for twice the feed. A
//! byte of each line says how much faster than programmed it may be run ([`Reserve`]). So a factor can change at any
//! time, also for queued lines; only the keys of the speed constraints depend on it (`replan`).
//!
//! Cost on AVR: 40 cycles for a velocity at 100 %, else 250.

use core::num::NonZero;

use super::divide::quotient;
use super::float::{least, scaled};

/// The factors of feeds and of traverses. Both are above 0; that of feeds is at most 2, that of traverses at most 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factors {
    /// The factor of lines with a feed.
    pub feed: f32,
    /// The factor of traverses.
    pub traverse: f32,
}

impl Factors {
    /// The factors of 1: everything as programmed.
    pub const ONE: Self = Self { feed: 1.0, traverse: 1.0 };

    /// Returns the lesser of each factor.
    #[inline(always)]
    pub fn least(&self, other: &Self) -> Self {
        let feed = least(self.feed, other.feed);
        Self { feed, traverse: least(self.traverse, other.traverse) }
    }

    /// Whether both factors are equal, bit for bit.
    #[inline(always)]
    pub fn same(&self, other: &Self) -> bool {
        let bits = |factors: &Self| (factors.feed.to_bits(), factors.traverse.to_bits());
        bits(self) == bits(other)
    }
}

/// How much faster than its cruise velocity a line may be run, in 1/128 of it; or that the line is a traverse.
/// Never stored as 0, which tells other blocks from lines (`block`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reserve(NonZero<u8>);

/// Twice as fast, in a [`Reserve`].
const TWICE: u8 = 128;

impl Reserve {
    /// A traverse, which nothing speeds up.
    pub const TRAVERSE: Self = Self(NonZero::<u8>::MAX);

    /// A line that may not be run faster than its cruise velocity.
    pub const NONE: Self = Self(NonZero::<u8>::MIN);

    /// Returns the reserve of a line at `cruise` that may be run at `top`, which is no less than `cruise` and at most
    /// twice as much. Cost: 30; 300 between the two.
    #[inline(always)]
    pub fn new(cruise: f32, top: f32) -> Self {
        if top.to_bits() == cruise.to_bits() {
            Self::NONE
        } else if top.to_bits() >= scaled(cruise, 1).to_bits() {
            Self::parts(TWICE)
        } else {
            Self::between(cruise, top)
        }
    }

    /// Computes the reserve in integers, from the first 16 bits: those of `cruise` rounded up, those of `top` down.
    #[inline(never)]
    fn between(cruise: f32, top: f32) -> Self {
        let (low, high) = (cruise.to_bits(), top.to_bits());
        let mantissa = |bits: u32| (bits >> 8) as u16 | 0x8000;
        let mut more = mantissa(high).wrapping_sub(mantissa(low));
        if (low ^ high) >> 23 != 0 {
            // `top` has a higher exponent, but is less than twice `cruise`.
            more = more.wrapping_add(mantissa(high));
        }
        let more = u32::from(more.saturating_sub(1)) * u32::from(TWICE);
        Self::parts(quotient(more, mantissa(low).saturating_add(1)) as u8)
    }

    /// Returns the reserve of a line that may be run `parts` 1/128 faster than its cruise velocity.
    #[inline(always)]
    fn parts(parts: u8) -> Self {
        Self::NONE.0.checked_add(parts).map_or(Self::NONE, Self)
    }

    /// Returns the velocity at which a line at `cruise` is to be run.
    #[inline(always)]
    pub fn velocity(self, cruise: f32, factors: &Factors) -> f32 {
        let factor = if self == Self::TRAVERSE { factors.traverse } else { factors.feed };
        self.velocity_by(cruise, factor)
    }

    /// Returns the velocity at which a line at `cruise` is to be run with this factor.
    #[inline(always)]
    pub fn velocity_by(self, cruise: f32, factor: f32) -> f32 {
        if factor.to_bits() == 1.0f32.to_bits() {
            return cruise;
        }
        times(cruise, factor, self.0.get() - 1)
    }
}

impl Default for Reserve {
    fn default() -> Self {
        Self::NONE
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
            cruise in 1e-5f32..1e5, more in 1.0f32..2.0, feed in 0.05f32..=2.0,
        ) {
            let top = cruise * more;
            let got = Reserve::new(cruise, top).velocity(cruise, &Factors { feed, ..Factors::ONE });
            let best = top.min(cruise * feed);
            prop_assert!(got <= best * 1.000_001 && got > best * 0.992, "{got} of {best}");
        }
    }

    #[test]
    fn traverses_have_their_own_factor() {
        let factors = Factors { feed: 2.0, traverse: 0.25 };
        assert_eq!(Reserve::TRAVERSE.velocity(8.0, &factors), 2.0);
        let twice = Reserve::new(8.0, 16.0);
        assert_eq!(twice.velocity(8.0, &factors), 16.0);
        assert_eq!(twice.velocity(8.0, &Factors::ONE), 8.0);
    }
}
