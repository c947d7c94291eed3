//! The functions of `avr/arithmetic.rs` in plain Rust.

/// Returns `a / b` and `a % b` if the quotient fits 16 bits: `a >> 16 < b`. Otherwise the same result as on the chip.
pub fn divide(a: u32, b: u16) -> (u16, u16) {
    if a >> 16 < u32::from(b) {
        return ((a / u32::from(b)) as u16, (a % u32::from(b)) as u16);
    }
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

/// Returns `a / b` if the quotient fits 32 bits: `a >> 32 < b`. Otherwise the same result as on the chip.
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

/// Returns 2^23 over the square root of a number from 2^14 on, 0.006 % exact. For a smaller number the result is
/// arbitrary.
pub fn inverse_root(x: u16) -> u16 {
    // First approximation, from the upper byte, by a polynomial of the second degree: 2.9 % exact.
    let [_, upper] = x.to_le_bytes();
    let slope = 286u16.wrapping_sub(high_product(upper, 204).into()) as u8;
    let first = 338u16
        .wrapping_sub(high_product(upper, slope).into())
        .wrapping_sub(high_product(upper, 126).into()) as u8;
    // How far the square of that, times the number, is from 1: in units of 2^-16, then in units of 2^-11.
    let square = u16::from(first) * u16::from(first);
    let error = ((product(x, square) << 2 >> 16) as i16).wrapping_neg();
    let rough = (error >> 5) as i8;
    // 1 / sqrt(1 - e) = 1 + e / 2 + e^2 (3 + 5/2 e) / 8: all terms except the first, in units of 2^-16.
    let squared = (i16::from(rough) * i16::from(rough)) as u16 >> 6;
    let third = 97i8.wrapping_add(rough >> 5) as u8;
    let more = (error >> 1) + i16::from(high_product(squared as u8, third)) + 1;
    let [low, high] = more.to_le_bytes();
    let part = i16::from(high as i8) * i16::from(first) + i16::from(high_product(low, first));
    (u16::from(first) << 8).wrapping_add_signed(part)
}

/// Returns `a / b`. Not inlined, because the compiler would otherwise compute the division even on paths that do not
/// need it.
#[inline(never)]
pub fn ratio(a: f32, b: f32) -> f32 {
    a / b
}

/// Returns a number rounded down. For 2^31 or more, for a number below 0 and for a NaN the result is 2^31.
pub fn whole(x: f32) -> u32 {
    // As on the chip, -0 counts as below 0.
    if x.to_bits() < 2_147_483_648.0f32.to_bits() { x as u32 } else { 1 << 31 }
}
