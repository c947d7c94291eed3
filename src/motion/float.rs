//! Comparisons of floats for dynamics. On AVR `f32::min` is a call that also handles NaN.

use kerf_macros::small;

use crate::hal::arithmetic::product;
pub use crate::hal::arithmetic::{ratio, whole};

/// The size of a number, without its sign. Cost: 1.
#[inline(always)]
pub fn size(x: f32) -> f32 {
    f32::from_bits(x.to_bits() & 0x7FFF_FFFF)
}

/// Whether `a` is less than `b`; neither is a NaN. Cost: 45, where a comparison of floats takes 90, or 180 where the
/// compiler handles NaN as well.
#[inline(never)]
pub fn less(a: f32, b: f32) -> bool {
    order(a) < order(b)
}

/// Returns an integer that sorts as the floats do: the bits of negative numbers are inverted.
#[inline(always)]
fn order(x: f32) -> i32 {
    let bits = x.to_bits() as i32;
    if bits < 0 { bits ^ 0x7FFF_FFFF } else { bits }
}

/// The lesser of two numbers. Cost: 55.
#[inline]
pub fn lesser(a: f32, b: f32) -> f32 {
    if less(a, b) { a } else { b }
}

/// The greater of two numbers. Cost: 55.
#[inline]
pub fn greater(a: f32, b: f32) -> f32 {
    if less(b, a) { a } else { b }
}

/// Whether `a` is less than `b`; at least one of them is not negative. The bits of such floats, as signed integers,
/// are in the order of the numbers. Cost: 15, where a comparison of floats takes 90.
#[inline(always)]
pub fn below(a: f32, b: f32) -> bool {
    (a.to_bits() as i32) < b.to_bits() as i32
}

/// Whether a number is not 0 (or -0, or below 1e-40). Cost: 5. From a test of all bits the compiler would make a
/// comparison of floats.
#[inline(always)]
pub fn some(a: f32) -> bool {
    (a.to_bits() >> 16) as u16 & 0x7FFF != 0
}

/// Returns the lesser of two numbers; at least one of them is not negative. Cost: 25.
#[inline(always)]
pub fn least(a: f32, b: f32) -> f32 {
    if below(a, b) { a } else { b }
}

/// Returns `x * 2^power` for a number that is not 0, where the result is neither tiny nor huge. Cost: 20.
#[inline(always)]
pub fn scaled(x: f32, power: i8) -> f32 {
    f32::from_bits(x.to_bits().wrapping_add_signed(i32::from(power) << 23))
}

/// Returns the product of two positive numbers, from the first 16 bits of each: up to 2^-14 too low. Neither number
/// is tiny or huge. Cost: 65, where a multiplication takes 115.
#[inline(never)]
pub fn brief_product(a: f32, b: f32) -> f32 {
    let (a, b) = (a.to_bits(), b.to_bits());
    let mantissa = |bits: u32| (bits >> 8) as u16 | 0x8000;
    let power = (((a >> 23) as u8).wrapping_add((b >> 23) as u8)).wrapping_sub(127);
    let product = product(mantissa(a), mantissa(b));
    let (product, power) =
        if product >> 31 == 0 { (product << 1, power) } else { (product, power.wrapping_add(1)) };
    f32::from_bits(u32::from(power) << 23 | (product >> 8) & 0x7F_FFFF)
}

/// Returns the logarithm of a positive number, or up to 0.09 [`OCTAVE`]s less. Where the margin is large, a comparison
/// of sums of logarithms takes 20 cycles, one of products of floats 400.
#[inline(always)]
pub fn log(x: f32) -> i32 {
    x.to_bits() as i32 - (127 << 23)
}

/// A factor of two, as a logarithm.
pub const OCTAVE: i32 = 1 << 23;

/// The cube root of a positive number that is neither tiny nor huge. Cost: 2,700.
#[inline(never)]
#[small]
pub fn cube_root(x: f32) -> f32 {
    // A third of the logarithm is exact to 4 %. Newton's steps then leave 0.1 % and 2e-6.
    let mut root = f32::from_bits(x.to_bits() / 3 + 0x2A51_4067);
    for _ in 0..2u8 {
        root = (root + root + x / (root * root)) * (1.0 / 3.0);
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cube_roots_are_exact_to_some_bits() {
        for n in -80..80i8 {
            let x = 1.37f32.powi(n.into());
            let exact = f64::from(x).cbrt();
            assert!((f64::from(cube_root(x)) / exact - 1.0).abs() < 4e-6, "{x}");
        }
    }

    #[test]
    fn less_is_less() {
        let numbers = [f32::MIN, -2.5, -1.0, -1e-30, -0.0, 0.0, 1e-30, 1.0, 2.5, f32::MAX];
        for a in numbers {
            for b in numbers.into_iter().filter(|b| *b != a) {
                assert_eq!(less(a, b), a < b, "{a} {b}");
            }
        }
    }

    #[test]
    fn below_is_less_unless_both_are_negative() {
        let numbers = [f32::MIN, -2.5, -1e-30, 0.0, 1e-30, 1.0, 2.5, f32::MAX];
        for a in numbers {
            for b in numbers.into_iter().filter(|b| a >= 0.0 || *b >= 0.0) {
                assert_eq!(below(a, b), a < b, "{a} {b}");
            }
        }
    }

    #[test]
    fn brief_products_are_products() {
        for n in 1..2_000u16 {
            let (a, b) = (f32::from(n) * 0.017_3, 1e9 / f32::from(n).powi(2));
            let (exact, brief) = (a * b, brief_product(a, b));
            assert!(brief <= exact && brief >= exact * (1.0 - 1.0 / 16_384.0), "{a} {b}");
        }
        assert_eq!(brief_product(0.5, 4.0), 2.0);
    }

    #[test]
    fn ratios_are_quotients() {
        let numbers = [0.0, -0.0, 1e-40, 1e-30, 0.7, 1.0, -3.0, 1e30, f32::INFINITY, f32::NAN];
        for a in numbers {
            for b in numbers {
                assert_eq!(ratio(a, b).to_bits(), (a / b).to_bits(), "{a} {b}");
            }
        }
    }

    #[test]
    fn whole_numbers_are_rounded_down_and_kept_in_range() {
        for (x, n) in [(0.0, 0), (0.99, 0), (1.0, 1), (32_000.7, 32_000), (1e9, 1_000_000_000)] {
            assert_eq!(whole(x), n, "{x}");
        }
        for x in [2_147_483_648.0, 1e20, -1.0, f32::INFINITY, f32::NAN] {
            assert_eq!(whole(x), 1 << 31, "{x}");
        }
    }
}
