//! What `avr/arithmetic.rs` does, as the language does it.

use avr_embassy::ring::Index;

/// `a / b` and `a % b` if the quotient fits 16 bits: `a >> 16 < b`. Else what the chip makes of it.
pub fn divide(a: u32, b: u16) -> (u16, u16) {
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

/// `a / b` if the quotient fits 32 bits: `a >> 32 < b`. Else what the chip makes of it.
pub fn wide_quotient(a: u64, b: u32) -> u32 {
    let mut rest = (a >> 32) as u32;
    let mut low = a as u32;
    for _ in 0..32 {
        let carry = rest >> 31 != 0;
        rest = rest << 1 | low >> 31;
        low <<= 1;
        if carry || rest >= b {
            rest = rest.wrapping_sub(b);
            low |= 1;
        }
    }
    low
}

/// `a * b`.
pub fn product(a: u16, b: u16) -> u32 {
    u32::from(a) * u32::from(b)
}

/// `a * b`, modulo 2^32.
pub fn times(a: u32, b: u8) -> u32 {
    a.wrapping_mul(b.into())
}

/// `a * b / 256`, rounded down.
pub fn high_product(a: u8, b: u8) -> u8 {
    ((u16::from(a) * u16::from(b)) >> 8) as u8
}

/// The square root, rounded down.
pub fn root(x: u32) -> u16 {
    x.isqrt() as u16
}

/// How many pairs of a mark and a value come before the first whose mark has its highest bit set, or whose value is below `least`; all of
/// them, at most [`Index::MAX`], if there is none.
pub fn passed_over(marks: &[Index], values: &[u16], least: u16) -> Index {
    let passes = |(mark, value): &(&Index, &u16)| **mark <= Index::MAX >> 1 && **value >= least;
    marks.iter().zip(values).take(Index::MAX.into()).take_while(passes).count() as Index
}

/// `a / b`. Out of line, because the compiler makes a division where it may be needed, and not only where it is.
#[inline(never)]
pub fn ratio(a: f32, b: f32) -> f32 {
    a / b
}

/// A number rounded down; one of 2^31 or more, or below 0, or a NaN, is 2^31.
pub fn whole(x: f32) -> u32 {
    // As the chip does: -0 is below 0.
    if x.to_bits() < 2_147_483_648.0f32.to_bits() { x as u32 } else { 1 << 31 }
}
