//! A positive float in two bytes, for limits kept in every block.

/// Eight bits of exponent and eight of mantissa: 0.4 % exact, rounded down, so that a limit stays one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Short(u16);

impl Short {
    /// The number, rounded down. 0 for a negative one. Cost: 15.
    #[inline]
    pub fn new(x: f32) -> Self {
        let bits = x.to_bits();
        if bits >> 31 != 0 { Short(0) } else { Short((bits >> 15) as u16) }
    }

    /// The least that is no less than a number that is not negative. Cost: 20.
    #[inline]
    pub fn above(x: f32) -> Self {
        Short(((x.to_bits() + 0x7FFF) >> 15) as u16)
    }

    /// Zero.
    pub const ZERO: Self = Short(0);

    /// Exponent and bits: `bits * 2^(exponent - 15)`. Cost: 10.
    #[inline]
    pub fn parts(self) -> (i16, u16) {
        ((self.0 >> 8) as i16 - 127, 0x8000 | (self.0 & 0xFF) << 7)
    }

    /// As a float again. Cost: 15.
    #[inline]
    pub fn get(self) -> f32 {
        f32::from_bits(u32::from(self.0) << 15)
    }
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
}
