//! Exact decimals, and the rounding to whole units and steps.

/// A decimal number, `digits` / 10^`places`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Decimal {
    digits: i128,
    places: u32,
}

impl Decimal {
    /// Converts a whole number.
    pub const fn whole(n: i128) -> Self {
        Decimal { digits: n, places: 0 }
    }

    /// Parses `-12.5`, `.5`, `5.` and the like, up to 18 digits. `None` for other text.
    pub fn parse(text: &str) -> Option<Self> {
        let (negative, rest) = match text.strip_prefix('-') {
            Some(rest) => (true, rest),
            None => (false, text.strip_prefix('+').unwrap_or(text)),
        };
        let (whole, fraction) = rest.split_once('.').unwrap_or((rest, ""));
        let all = format!("{whole}{fraction}");
        if all.is_empty() || all.len() > 18 || !all.bytes().all(|b| b.is_ascii_digit()) {
            return None;
        }
        let digits: i128 = all.parse().ok()?;
        let digits = if negative { -digits } else { digits };
        Some(Decimal { digits, places: fraction.len() as u32 })
    }

    /// Multiplies by `factor` and rounds to a whole number.
    pub fn scaled(self, factor: i128) -> i64 {
        divide(self.digits * factor, 10i128.pow(self.places)) as i64
    }

    /// Returns the number if it is whole, else `None`.
    pub fn as_whole(self) -> Option<i64> {
        let one = 10i128.pow(self.places);
        (self.digits % one == 0).then_some((self.digits / one) as i64)
    }

    /// Returns ten times the number, with further decimals cut off: 28.3 gives 283.
    pub fn tenths(self) -> i64 {
        (self.digits * 10 / 10i128.pow(self.places)) as i64
    }

    /// Returns numerator and denominator.
    pub fn ratio(self) -> (i128, i128) {
        (self.digits, 10i128.pow(self.places))
    }
}

/// Decimals of a word that count. In inches one less does.
const COUNTED: u32 = 8;
/// Parts of a unit in which rests are counted.
const PARTS: i128 = 10_000;

/// A length in whole units, and the rest that was left when it was rounded, in parts of a unit.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Exact {
    /// The length.
    pub units: i64,
    /// The rest.
    pub rest: i64,
}

impl Exact {
    /// Adds the rest of an earlier word, as an increment does.
    pub fn with(self, rest: i64) -> Exact {
        let (half, whole) = (PARTS as i64 / 2, PARTS as i64);
        let rest = self.rest + rest;
        let more = i64::from(rest >= half) - i64::from(rest <= -half);
        Exact { units: self.units + more, rest: rest - more * whole }
    }
}

impl Decimal {
    /// Converts a length that is written in a unit of so many units; with `halved` half of it. Decimals that do not
    /// count are cut off.
    pub fn exact(self, unit: i128, halved: bool) -> Exact {
        let decimals = |digits: i128, to: u32| match self.places > to {
            true => digits / 10i128.pow(self.places - to),
            false => digits * 10i128.pow(to - self.places),
        };
        let counted = decimals(self.digits, COUNTED);
        let counted = if halved { counted / 2 } else { counted };
        // A tenth of the last decimal of an inch is no whole number of parts.
        let (counted, one) = match unit % PARTS {
            0 => (counted, COUNTED),
            _ => (counted / 10, COUNTED - 1),
        };
        let parts = counted * unit * PARTS / 10i128.pow(one);
        let units = divide(parts, PARTS);
        Exact { units: units as i64, rest: (parts - units * PARTS) as i64 }
    }
}

/// Divides and rounds to the nearest whole number, halves away from zero.
pub fn divide(a: i128, b: i128) -> i128 {
    let (a, b) = if b < 0 { (-a, -b) } else { (a, b) };
    let half = b / 2 + b % 2;
    let (quotient, rest) = (a / b, a % b);
    if rest.abs() >= half && rest != 0 { quotient + rest.signum() } else { quotient }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_halves_away_from_zero() {
        let cases =
            [(5, 2, 3), (-5, 2, -3), (7, 3, 2), (8, 3, 3), (-8, 3, -3), (0, 3, 0), (1, 3, 0)];
        for (a, b, want) in cases {
            assert_eq!(divide(a, b), want, "{a} / {b}");
        }
    }

    #[test]
    fn increments_add_up() {
        // Random increments of up to eight decimals: the sum is the exact sum, to half a unit.
        let mut seed = 1u64;
        for unit in [10_000, 254_000] {
            let (mut place, mut rest, mut sum) = (0i64, 0i64, 0i128);
            for _ in 0..1_000 {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let decimals = if unit == 10_000 { 8 } else { 7 };
                let digits = i128::from(seed >> 40) - (1 << 23);
                let word = Decimal { digits, places: decimals }.exact(unit, false).with(rest);
                (place, rest) = (place + word.units, word.rest);
                sum += digits * unit;
                let off = sum - i128::from(place) * 10i128.pow(decimals);
                assert!(off.abs() * 2 <= 10i128.pow(decimals), "{off}");
            }
        }
    }

    #[test]
    fn reads_what_senders_write() {
        for (text, want) in [("1.5", 15_000), ("-.25", -2_500), ("3.", 30_000), ("+2", 20_000)] {
            assert_eq!(Decimal::parse(text).map(|d| d.scaled(10_000)), Some(want), "{text}");
        }
        for bad in ["", ".", "-", "1e3", "1.2.3"] {
            assert_eq!(Decimal::parse(bad), None, "{bad}");
        }
    }

    #[test]
    fn tenths_of_codes_are_exact() {
        assert_eq!(Decimal::parse("28.3").map(Decimal::tenths), Some(283));
        assert_eq!(Decimal::parse("92.1").map(Decimal::tenths), Some(921));
        assert_eq!(Decimal::parse("01").map(Decimal::tenths), Some(10));
    }
}
