//! Exact decimals, and their conversions.
//!
//! A number is kept as written, in three parts that need no wide arithmetic: the whole part, four decimals (the
//! resolution of [`Length`]), and four more decimals for rounding and for the residue of incremental moves. Decimals
//! beyond the eighth are ignored: in inches that is 0.25 nm.

use crate::status::Status;
use crate::units::Length;

/// A decimal number, exact to eight decimals. Zero is never negative.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Decimal {
    /// The digits left of the point.
    pub whole: u32,
    /// The first four decimals, 0 to 9999.
    pub frac: u16,
    /// The next four decimals, 0 to 9999.
    pub tail: u16,
    /// Whether the number is less than zero.
    pub negative: bool,
}

/// A length and the remainder of its rounding: `units` + `rest` / 10,000 units.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Exact {
    /// The length, rounded to the nearest unit, halves away from zero.
    pub units: Length,
    /// The remainder, -5000 to 5000 ten-thousandths of a unit.
    pub rest: i16,
}

/// Ten-thousandths in a unit: the scale of [`Exact::rest`].
const REST: i16 = 10_000;

impl Exact {
    /// Adds `carried` to the remainder, as an incremental move does with the residue of the previous move. Both are at
    /// most half a unit, so their sum carries one unit at most. `None` beyond the range.
    pub fn carry(self, carried: i16) -> Option<Exact> {
        let rest = self.rest + carried;
        let (step, rest) = match rest {
            5_000.. => (1, rest - REST),
            ..=-5_000 => (-1, rest + REST),
            _ => (0, rest),
        };
        Some(Exact { units: self.units.checked_add(Length(step))?, rest })
    }
}

impl Decimal {
    /// Converts the number as millimetres or degrees.
    #[inline(always)]
    pub fn mm(&self) -> Result<Exact, Status> {
        // Most lengths are below 65 m and have at most four decimals. They need no rounding, and a product of 16 by 16
        // bits.
        match u16::try_from(self.whole) {
            Ok(whole) if self.tail == 0 => {
                let units = u32::from(whole) * Length::PER_MM as u32 + u32::from(self.frac);
                let units = if self.negative { -(units as i32) } else { units as i32 };
                Ok(Exact { units: Length(units), rest: 0 })
            }
            _ => self.long_mm(),
        }
    }

    #[inline(never)]
    fn long_mm(&self) -> Result<Exact, Status> {
        if self.whole > (i32::MAX / Length::PER_MM) as u32 {
            return Err(Status::OutOfRange);
        }
        self.exact(self.whole * Length::PER_MM as u32 + u32::from(self.frac), self.tail)
    }

    /// Converts the number as inches, exact to seven decimals.
    ///
    /// An inch is 254,000 units. The three parts are converted one by one: one ten-thousandth is 25.4 units, the
    /// seventh decimal counts 0.0254 units. Cost on AVR: 400 cycles; with more than four decimals two 32-bit divisions
    /// more, 1,200.
    #[inline(never)]
    pub fn inch(&self) -> Result<Exact, Status> {
        if self.whole > (i32::MAX / Length::PER_INCH) as u32 {
            return Err(Status::OutOfRange);
        }
        // The 0.4 of 25.4 units for each ten-thousandth. The product fits 16 bits.
        let tenths = self.frac * 4;
        let (parts, left) = (tenths / 10, tenths % 10);
        let units = self.whole * Length::PER_INCH as u32 + u32::from(self.frac) * 25;
        let (mut units, mut rest) = (units + u32::from(parts), left * 1_000);
        if self.tail != 0 {
            let more = u32::from(rest) + u32::from(self.tail / 10) * 254;
            units += more / REST as u32;
            rest = (more % REST as u32) as u16;
        }
        self.exact(units, rest)
    }

    /// Rounds a magnitude of `units` + `rest` / 10,000, and gives it the sign of the number.
    #[inline(always)]
    fn exact(&self, units: u32, rest: u16) -> Result<Exact, Status> {
        let up = rest >= 5_000;
        let rest = if up { rest as i16 - REST } else { rest as i16 };
        let units = units + u32::from(up);
        let units = i32::try_from(units).map_err(|_| Status::OutOfRange)?;
        Ok(match self.negative {
            true => Exact { units: Length(-units), rest: -rest },
            false => Exact { units: Length(units), rest },
        })
    }

    /// Returns half of the number, exact to eight decimals.
    #[small]
    pub fn half(self) -> Self {
        const CARRY: u16 = REST as u16 / 2;
        let odd = |value: u16| if value & 1 == 0 { 0 } else { CARRY };
        let (whole, frac) = (self.whole / 2, self.frac / 2 + odd(self.whole as u16));
        let tail = self.tail / 2 + odd(self.frac);
        let negative = self.negative && (whole != 0 || frac != 0 || tail != 0);
        Self { whole, frac, tail, negative }
    }

    /// Whether the number is 0.
    #[inline(never)]
    #[small]
    pub fn is_zero(&self) -> bool {
        self.whole == 0 && self.frac == 0 && self.tail == 0
    }

    /// Returns the number as a whole number. Error 110 if it is negative, error 102 if it has decimals.
    #[inline(never)]
    #[small]
    pub fn integer(&self) -> Result<u32, Status> {
        match self {
            Decimal { negative: true, .. } => Err(Status::OutOfRange),
            Decimal { frac: 0, tail: 0, whole, .. } => Ok(*whole),
            _ => Err(Status::BadNumber),
        }
    }

    /// Returns the whole part and the tenths, as in the number of a G or M code: 28 and 3 of `G28.3`. `None` if it
    /// cannot be the number of a code: the highest is 999.9.
    pub fn code(&self) -> Option<(u16, u8)> {
        let whole = u16::try_from(self.whole).ok().filter(|whole| *whole < 1_000)?;
        let tenth = if self.frac == 0 { 0 } else { (self.frac / 1_000) as u8 };
        let exact = self.tail == 0 && u16::from(tenth) * 1_000 == self.frac;
        (exact && !self.negative).then_some((whole, tenth))
    }

    /// Converts the number from seconds to milliseconds. Error 163 if it is negative, error 110 beyond 32 bits.
    #[inline(never)]
    #[small]
    pub fn milliseconds(&self) -> Result<u32, Status> {
        if self.negative {
            return Err(Status::PWordNegative);
        }
        let part = u32::from((self.frac + 5) / 10);
        let whole = (self.whole < u32::MAX / 1_000).then(|| self.whole * 1_000);
        whole.map(|whole| whole + part).ok_or(Status::OutOfRange)
    }

    /// Rounds the number to a float. For feeds, never for positions.
    #[inline(never)]
    #[small]
    pub fn to_f32(self) -> f32 {
        let mut value = self.whole as f32;
        if self.frac != 0 || self.tail != 0 {
            value += f32::from(self.frac) * 1e-4 + f32::from(self.tail) * 1e-8;
        }
        if self.negative { -value } else { value }
    }
}

#[cfg(test)]
mod tests {
    use super::super::number::tests::read;
    use super::*;

    fn mm(text: &str) -> Result<(i32, i16), Status> {
        read(text).mm().map(|exact| (exact.units.0, exact.rest))
    }

    fn inch(text: &str) -> Result<(i32, i16), Status> {
        read(text).inch().map(|exact| (exact.units.0, exact.rest))
    }

    #[test]
    fn halves_are_exact() {
        for (text, half) in [
            ("1", "0.5"),
            ("-7.0001", "-3.50005"),
            ("4294967295", "2147483647.5"),
            ("0.00000002", "0.00000001"),
            ("-0.00000001", "0"),
            ("19.99990001", "9.999950005"),
            ("3.0003", "1.50015"),
        ] {
            assert_eq!(read(text).half(), read(half), "{text}");
        }
    }

    #[test]
    fn whole_numbers() {
        assert_eq!(read("4294967295").integer(), Ok(u32::MAX));
        assert_eq!(read("1.5").integer(), Err(Status::BadNumber));
        assert_eq!(read("-1").integer(), Err(Status::OutOfRange));
    }

    #[test]
    fn millimetres_round_halves_away_from_zero() {
        assert_eq!(mm("12.3456"), Ok((123_456, 0)));
        assert_eq!(mm("0.00004"), Ok((0, 4_000)));
        assert_eq!(mm("0.00005"), Ok((1, -5_000)));
        assert_eq!(mm("-0.00005"), Ok((-1, 5_000)));
        assert_eq!(mm("0.99999"), Ok((10_000, -1_000)));
        assert_eq!(mm("214748.3647"), Ok((i32::MAX, 0)));
        assert_eq!(mm("-214748.3647"), Ok((-i32::MAX, 0)));
        assert_eq!(mm("214748.36475"), Err(Status::OutOfRange));
        assert_eq!(mm("214749"), Err(Status::OutOfRange));
    }

    #[test]
    fn inches_are_exact() {
        assert_eq!(inch("1"), Ok((254_000, 0)));
        assert_eq!(inch("0.0001"), Ok((25, 4_000)));
        assert_eq!(inch("-0.00001"), Ok((-3, 4_600)));
        assert_eq!(inch("0.0000001"), Ok((0, 254)));
        assert_eq!(inch("8454.6588"), Ok((2_147_483_335, 2_000)));
        assert_eq!(inch("8454.7"), Err(Status::OutOfRange));
        assert_eq!(inch("8455"), Err(Status::OutOfRange));
    }

    #[test]
    fn codes_are_read_digit_by_digit() {
        assert_eq!(read("28.3").code(), Some((28, 3)));
        assert_eq!(read("1.00").code(), Some((1, 0)));
        assert_eq!(read("028.30").code(), Some((28, 3)));
        assert_eq!(read("255").code(), Some((255, 0)));
        assert_eq!(read("999.9").code(), Some((999, 9)));
        for text in ["28.35", "28.30001", "-1", "65537", "1000"] {
            assert_eq!(read(text).code(), None, "{text}");
        }
    }

    #[test]
    fn seconds_and_feeds() {
        assert_eq!(read("1.2345").milliseconds(), Ok(1_235));
        assert_eq!(read("0.9999").milliseconds(), Ok(1_000));
        assert_eq!(read("-1").milliseconds(), Err(Status::PWordNegative));
        assert_eq!(read("4294968").milliseconds(), Err(Status::OutOfRange));
        assert_eq!(read("1500").to_f32(), 1_500.0);
        assert_eq!(read("-0.5").to_f32(), -0.5);
    }
}
