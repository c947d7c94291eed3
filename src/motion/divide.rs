//! Division and square root of 32 bits into 16: a third of the cycles of the library's division, which
//! is by 32 bits, and of its float root. Their kernels are the chip's ([`arithmetic`]).
//!
//! Called by exec's preparation of segments and by the line builder, a few times each. No units.

use crate::hal::arithmetic;

/// `a / b`, rounded down, if that fits 16 bits: `a >> 16 < b`. Else something, without a panic.
/// Cost: 170, 100 if it fits eight bits; 200 and 120 if `b` has 16 bits.
#[inline]
pub fn quotient(a: u32, b: u16) -> u16 {
    quotient_remainder(a, b).0
}

/// `a / b` and `a % b`, as [`quotient`].
#[inline(never)]
pub fn quotient_remainder(a: u32, b: u16) -> (u16, u16) {
    arithmetic::divide(a, b)
}

/// The square root, rounded down. Cost: 320.
#[inline(never)]
pub fn root(x: u32) -> u16 {
    arithmetic::root(x)
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

    proptest! {
        #[test]
        fn is_division(b in 1u16.., a in 0u32..) {
            let a = a % (u32::from(b) << 16);
            let (q, r) = quotient_remainder(a, b);
            prop_assert_eq!(u32::from(q), a / u32::from(b));
            prop_assert_eq!(u32::from(r), a % u32::from(b));
        }
    }
}
