//! A positive float in three bytes, for what a block must know better than a limit.

/// An `f32` without the last eight bits of its mantissa: 0.003 % exact, rounded down, so that a limit stays one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Medium([u8; 3]);

impl Medium {
    /// The number, rounded down; not a negative one. Cost: 5.
    #[inline(always)]
    pub fn new(x: f32) -> Self {
        let [_, a, b, c] = x.to_bits().to_le_bytes();
        Self([a, b, c])
    }

    /// As a float again. Cost: 5.
    #[inline(always)]
    pub fn get(self) -> f32 {
        let [a, b, c] = self.0;
        f32::from_bits(u32::from_le_bytes([0, a, b, c]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_down_by_very_little() {
        for x in [0.0, 1e-6, 0.3, 1.0, 16.666_666, 499.99, 500.0, 7.3e9, 2e20] {
            let medium = Medium::new(x).get();
            assert!(medium <= x && medium >= x * (1.0 - 3.1e-5), "{x} became {medium}");
            assert_eq!(Medium::new(medium).get(), medium);
        }
    }
}
