//! Division of 32 by 16 bits into 16: a third of the cycles of the library's, which divides 32 by 32.
//!
//! Called by exec's preparation of segments and by the line builder, a few times each. No units.

/// `a / b`, rounded down, if that fits 16 bits: `a >> 16 < b`. Else something, without a panic.
/// Cost: 230.
#[inline(never)]
pub fn quotient(a: u32, b: u16) -> u16 {
    divide(a, b).0
}

/// `a / b` and `a % b`, as [`quotient`].
#[inline(never)]
pub fn quotient_remainder(a: u32, b: u16) -> (u16, u16) {
    divide(a, b)
}

/// Bit by bit: the compiler makes three times as much of it.
#[cfg(target_arch = "avr")]
#[inline(always)]
fn divide(a: u32, b: u16) -> (u16, u16) {
    let mut rest = (a >> 16) as u16;
    let mut low = a as u16;
    // SAFETY: arithmetic on its operands.
    unsafe {
        core::arch::asm!(
            "ldi  {n}, 16",
            "1:",
            "lsl  {low:l}",
            "rol  {low:h}",
            "rol  {rest:l}",
            "rol  {rest:h}",
            // With the bit that the shift lost the rest is above any divisor.
            "brcs 2f",
            "cp   {rest:l}, {b:l}",
            "cpc  {rest:h}, {b:h}",
            "brcs 3f",
            "2:",
            "sub  {rest:l}, {b:l}",
            "sbc  {rest:h}, {b:h}",
            "inc  {low:l}",
            "3:",
            "dec  {n}",
            "brne 1b",
            n = out(reg_upper) _,
            low = inout(reg_pair) low,
            rest = inout(reg_pair) rest,
            b = in(reg_pair) b,
            options(pure, nomem, nostack),
        );
    }
    (low, rest)
}

#[cfg(not(target_arch = "avr"))]
fn divide(a: u32, b: u16) -> (u16, u16) {
    let mut rest = (a >> 16) as u16;
    let mut low = a as u16;
    for _ in 0..16 {
        let carry = rest & 0x8000 != 0;
        rest = rest << 1 | low >> 15;
        low <<= 1;
        if carry || rest >= b {
            rest = rest.wrapping_sub(b);
            low |= 1;
        }
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
