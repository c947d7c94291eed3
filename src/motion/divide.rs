//! Division of 32 by 16 bits into 16: half the cycles of the library's, which divides 32 by 32.
//!
//! Called by exec's preparation of segments, a few times each. No units.

/// `a / b`, rounded down, if that fits 16 bits: `a >> 16 < b`. Else something, without a panic.
/// Cost: 260.
#[inline(never)]
pub fn quotient(a: u32, b: u16) -> u16 {
    quotient_remainder(a, b).0
}

/// `a / b` and `a % b`, as [`quotient`].
#[inline(never)]
pub fn quotient_remainder(a: u32, b: u16) -> (u16, u16) {
    let mut rest = (a >> 16) as u16;
    let mut low = a as u16;
    let mut bit = 16u8;
    while bit != 0 {
        let carry = rest & 0x8000 != 0;
        rest = rest << 1 | low >> 15;
        low <<= 1;
        // With the bit that the shift lost the rest is above any `b`.
        if carry || rest >= b {
            rest = rest.wrapping_sub(b);
            low |= 1;
        }
        bit -= 1;
    }
    (low, rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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
