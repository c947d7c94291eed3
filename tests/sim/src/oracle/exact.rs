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
