//! A positive float in two bytes, for limits kept in every block, and its logarithm.

use crate::hal::arithmetic::high_product;

/// Eight bits of exponent and eight of mantissa. Exact to 0.4 %, and rounded down, so that no limit is exceeded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Short(u16);

impl Short {
    /// Returns a number, rounded down; 0 for a negative one. Cost: 15.
    #[inline]
    pub fn new(x: f32) -> Self {
        let bits = x.to_bits();
        if bits >> 31 != 0 { Short(0) } else { Short((bits >> 15) as u16) }
    }

    /// Returns the least `Short` that is not below a number, which is not negative. Cost: 20.
    #[inline]
    pub fn above(x: f32) -> Self {
        Short(((x.to_bits() + 0x7FFF) >> 15) as u16)
    }

    /// Zero.
    pub const ZERO: Self = Short(0);

    /// The number as a float. Cost: 15.
    #[inline]
    pub fn get(self) -> f32 {
        f32::from_bits(u32::from(self.0) << 15)
    }

    /// The logarithm of the number, which is not 0. Cost: 20.
    #[inline(always)]
    pub fn log(self) -> Log {
        let (mantissa, power) = self.parts();
        Log::new(power.wrapping_sub(ONE), mantissa)
    }

    /// Makes a number from a mantissa without the leading 1, and an exponent.
    #[inline(always)]
    pub fn of_parts(mantissa: u8, power: u8) -> Self {
        Self(u16::from_le_bytes([mantissa, power]))
    }

    /// Returns an integer that sorts as the numbers do.
    #[inline(always)]
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Makes a number from [`Short::bits`].
    #[inline(always)]
    pub const fn of_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// The mantissa of the number without the leading 1, and its exponent.
    #[inline(always)]
    pub fn parts(self) -> (u8, u8) {
        let [mantissa, power] = self.0.to_le_bytes();
        (mantissa, power)
    }
}

/// The exponent of 1 in a [`Short`].
const ONE: u8 = 127;

/// A logarithm to base two, in 1/256: it turns products and powers into sums and multiples, at 5 cycles each. Exact
/// to 1.5 %.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Log(pub i16);

/// A factor of two, as a logarithm.
pub const OCTAVE: i16 = 256;

impl Log {
    /// Makes a logarithm from a power of two and a mantissa.
    #[inline(always)]
    fn new(power: u8, mantissa: u8) -> Self {
        Self(i16::from_le_bytes([mantissa.wrapping_add(bulge(mantissa)), power]))
    }

    /// The logarithm of a float above 0. Cost: 40.
    #[inline(never)]
    pub fn of_float(x: f32) -> Self {
        Short::new(x).log()
    }

    /// The logarithm of an integer, not 0. Cost: 45 to 85.
    #[inline(never)]
    pub fn of(n: u16) -> Self {
        // The bit that is set here ends the search for any number.
        let (mut n, mut power) = if n < 0x100 { (n << 8 | 1, 7u8) } else { (n, 15) };
        while n & 0x8000 == 0 {
            n <<= 1;
            power = power.wrapping_sub(1);
        }
        let [_, mantissa] = (n << 1).to_le_bytes();
        Self::new(power, mantissa)
    }

    /// The logarithm of a larger integer, not 0. Cost: 60 to 100.
    #[inline(never)]
    pub fn of_wide(n: u32) -> Self {
        let [_, _, low, high] = n.to_le_bytes();
        // At least nine bits are left.
        let (n, octaves) = if high != 0 {
            ((n >> 16) as u16, 16 * OCTAVE)
        } else if low != 0 {
            ((n >> 8) as u16, 8 * OCTAVE)
        } else {
            (n as u16, 0)
        };
        Self(Self::of(n).0 + octaves)
    }

    /// Returns the number whose logarithm this is. Cost: 20.
    #[inline(always)]
    pub fn power(self) -> Short {
        let [fraction, power] = self.0.to_le_bytes();
        let mantissa = fraction.wrapping_sub(bulge(fraction));
        Short::of_parts(mantissa, power.wrapping_add(ONE))
    }
}

/// Returns `log2(1 + m) - m`, which is nearly `1 + m - 2^m`. All in 1/256.
#[inline(always)]
fn bulge(m: u8) -> u8 {
    high_product(high_product(m, !m), 88)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_down_by_little() {
        for x in [0.0, 1e-6, 0.3, 1.0, 499.99, 500.0, 7.3e9, 2e20] {
            let short = Short::new(x).get();
            assert!(short <= x && short >= x * 0.996, "{x} became {short}");
        }
        assert_eq!(Short::new(-3.0).get(), 0.0);
        for x in [0.0, 1e-6, 0.3, 1.0, 499.99, 500.0, 7.3e9] {
            let (low, high) = (Short::new(x), Short::above(x));
            assert!(high.get() >= x && (low < high) == (low.get() < x), "{x}");
        }
    }

    #[test]
    fn logarithms_are_exact_to_two_percent() {
        for n in 1..=u16::MAX {
            let exact = f64::from(n).log2();
            let log = |log: Log| f64::from(log.0) / f64::from(OCTAVE);
            assert!((log(Log::of(n)) - exact).abs() < 0.02, "{n}");
            assert!((log(Log::of_wide(n.into())) - exact).abs() < 0.02, "{n}");
            let wide = u32::from(n) * 65_537;
            assert!((log(Log::of_wide(wide)) - f64::from(wide).log2()).abs() < 0.02, "{n}");
            let short = Short::new(n.into());
            assert!((log(short.log()) - exact).abs() < 0.02, "{n}");
            let back = short.log().power().get() / short.get();
            assert!((back - 1.0).abs() < 0.012, "{n} {back}");
        }
    }

    #[test]
    fn logarithms_reach_far() {
        for x in [1e-9f32, 3e-4, 1.0, 2.5e7, 1e20] {
            let log = f64::from(Short::new(x).log().0) / f64::from(OCTAVE);
            assert!((log - f64::from(x).log2()).abs() < 0.014, "{x}");
        }
    }
}
