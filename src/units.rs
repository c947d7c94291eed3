//! The units that modules exchange: exact lengths. No floats here.

use kerf_macros::small;

/// A position or distance in units of 0.1 um for a linear axis, 0.0001 degree for a rotary one.
///
/// The range is +-214 m, or +-214,000 degrees. 0.0001 mm is exactly one unit. An inch is exactly 254,000 units, so five
/// decimals of an inch stay distinct.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default)]
pub struct Length(pub i32);

impl Length {
    /// Zero.
    pub const ZERO: Length = Length(0);
    /// Units in a millimetre or a degree.
    pub const PER_MM: i32 = 10_000;
    /// The number of decimals of a millimetre that a length has.
    pub const DECIMALS: u8 = 4;
    /// Units in an inch.
    pub const PER_INCH: i32 = 254_000;

    /// Returns the length in millimetres, rounded to a float. For dynamics only, never for positions.
    pub fn to_mm(self) -> f32 {
        self.0 as f32 * 1e-4
    }

    /// Returns the sum, or `None` beyond the range. Not inlined: hot code adds the integers instead.
    #[inline(never)]
    #[small]
    pub fn checked_add(self, other: Length) -> Option<Length> {
        self.0.checked_add(other.0).map(Length)
    }

    /// Returns the difference, or `None` beyond the range.
    #[inline(never)]
    #[small]
    pub fn checked_sub(self, other: Length) -> Option<Length> {
        self.0.checked_sub(other.0).map(Length)
    }

    /// Returns the sum, or the end of the range.
    #[inline(never)]
    #[small]
    pub fn saturating_add(self, other: Length) -> Length {
        Length(self.0.saturating_add(other.0))
    }

    /// Returns the difference, or the end of the range.
    #[inline(never)]
    #[small]
    pub fn saturating_sub(self, other: Length) -> Length {
        Length(self.0.saturating_sub(other.0))
    }
}

/// The number of axes. Their order is X Y Z A B C everywhere.
pub const AXES: usize = 6;
/// The letters of the axes, lower case.
pub const AXIS_LETTERS: [u8; AXES] = *b"xyzabc";
/// The first rotary axis, A.
pub const FIRST_ROTARY: usize = 3;
/// A value for each axis.
pub type PerAxis<T> = [T; AXES];
