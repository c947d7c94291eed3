//! Division and square root of 32 bits into 16. They take a third of the cycles of the library's division, which is by
//! 32 bits, and of its float root. Each chip has its own kernels ([`arithmetic`]).
//!
//! Called a few times by the preparation of a segment, and by the line builder for a block. No units.

use crate::hal::arithmetic::{self, inverse_root, product};

/// Returns `a / b`, rounded down, if that fits 16 bits: `a >> 16 < b`. Otherwise returns any number, without a panic.
/// Cost: 170, 100 if it fits eight bits; 200 and 120 if `b` has 16 bits.
#[inline]
pub fn quotient(a: u32, b: u16) -> u16 {
    quotient_remainder(a, b).0
}

/// Returns `a / b` and `a % b`, on the conditions of [`quotient`].
#[inline(never)]
pub fn quotient_remainder(a: u32, b: u16) -> (u16, u16) {
    arithmetic::divide(a, b)
}

/// Returns the square root, rounded down. Cost: 320.
#[inline(never)]
pub fn root(x: u32) -> u16 {
    arithmetic::root(x)
}

/// The length of a vector, from its square.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    /// From 2^15 - 1 on: the length, or twice the length if `is_twice`.
    pub length: u16,
    /// Whether `length` is twice the length.
    pub is_twice: bool,
    /// 2^30 over the length.
    pub reciprocal: u16,
}

impl Size {
    /// Measures a vector whose largest component is at least 2^14, to 0.01 %. Cost: 190, where a root and a division
    /// take 490.
    #[inline(always)]
    pub fn of_square(square: u32) -> Self {
        // In 16 bits, because a shift of 32 bits takes a loop.
        let [_, next, ..] = square.to_le_bytes();
        let mut upper = (square >> 16) as u16;
        let is_twice = upper < 0x4000;
        if is_twice {
            upper = upper << 2 | u16::from(next >> 6);
        }
        // The greatest number has a root that is rounded up: its length would have 17 bits.
        let upper = upper.min(u16::MAX - 1);
        let root = inverse_root(upper);
        Self {
            length: (product(upper, root) >> 15) as u16,
            is_twice,
            reciprocal: if is_twice { root } else { root >> 1 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn roots_are_rounded_down() {
        for x in [0, 1, 2, 3, 4, 15, 16, 17, 65_535, 65_536, u32::MAX] {
            assert_eq!(u32::from(root(x)), x.isqrt());
        }
    }

    #[test]
    fn inverse_roots() {
        for x in 1 << 14..=u16::MAX {
            let exact = f64::from(1 << 23) / f64::from(x).sqrt();
            let off = f64::from(inverse_root(x)) / exact - 1.0;
            assert!(off.abs() < 6e-5, "{x}: {off}");
        }
    }

    /// All numbers of which a size is made.
    #[test]
    fn no_size_is_out_of_range() {
        for upper in 1u32 << 12..1 << 16 {
            for lower in [0, 0x3FFF, 0x4000, 0x7FFF, 0x8000, 0xBFFF, 0xC000, 0xFFFF] {
                let square = upper << 16 | lower;
                let size = Size::of_square(square);
                let length = f64::from(size.length) / if size.is_twice { 2.0 } else { 1.0 };
                let off = length / f64::from(square).sqrt() - 1.0;
                assert!(off.abs() < 1e-4, "{square:#x}: {size:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn sizes(square in 1u32 << 28..) {
            let exact = f64::from(square).sqrt();
            let size = Size::of_square(square);
            let length = f64::from(size.length) / if size.is_twice { 2.0 } else { 1.0 };
            prop_assert!((length / exact - 1.0).abs() < 1e-4, "{size:?}");
            prop_assert!((f64::from(size.reciprocal) * exact / f64::from(1 << 30) - 1.0).abs() < 1e-4, "{size:?}");
            prop_assert!(size.length >= (1 << 15) - 1);
        }

        #[test]
        fn is_division(b in 1u16.., a in 0u32..) {
            let a = a % (u32::from(b) << 16);
            let (q, r) = quotient_remainder(a, b);
            prop_assert_eq!(u32::from(q), a / u32::from(b));
            prop_assert_eq!(u32::from(r), a % u32::from(b));
        }
    }
}
