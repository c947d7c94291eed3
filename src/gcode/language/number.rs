//! Numbers of expressions: from text, as whole numbers, and as words.

use super::super::decimal::Decimal;
use super::text::Text;
use crate::status::Status;

/// How far a number may be from a whole one that it stands for, and as much for rounding.
const NEAR: f64 = 1e-4 + 1e-9;
/// How far the tenths of a G code may be from a whole number.
const NEAR_TENTHS: f64 = 1e-3 + 1e-9;
/// Mantissas below this take another digit.
const MOST: u64 = 100_000_000_000_000_000;
/// The most decimals that count: powers of ten up to this one are exact.
const DECIMALS: u32 = 22;
/// Units of the last decimal of a [`Decimal`].
const PER_UNIT: f64 = 1e8;

/// Reads a number: a sign or none, and digits with at most one point. There is no exponent.
pub fn read(text: &mut Text) -> Result<f64, Status> {
    let negative = text.eat(b'-');
    if !negative {
        text.eat(b'+');
    }
    let (mut mantissa, mut power, mut count) = (0u64, 0, 0u32);
    while let Some(digit) = text.digit() {
        count += 1;
        if mantissa < MOST {
            mantissa = mantissa * 10 + u64::from(digit);
        } else {
            power += 1;
        }
    }
    let mut decimals = 0;
    if text.eat(b'.') {
        while let Some(digit) = text.digit() {
            count += 1;
            if mantissa < MOST && decimals < DECIMALS && power == 0 {
                mantissa = mantissa * 10 + u64::from(digit);
                decimals += 1;
            }
        }
    }
    if count == 0 {
        return Err(Status::BadNumber);
    }
    let value = mantissa as f64 * tens(power) / tens(decimals);
    Ok(if negative { -value } else { value })
}

/// Returns a power of ten. A line is too short for one that is infinite.
fn tens(power: u32) -> f64 {
    (0..power).fold(1.0, |value, _| value * 10.0)
}

/// Returns the whole number that a value stands for, if it is near enough to one.
pub fn whole(value: f64) -> Option<i32> {
    near(value, NEAR)
}

fn near(value: f64, by: f64) -> Option<i32> {
    let nearest = libm::round(value);
    let is_near = (value - nearest).abs() <= by && nearest.abs() <= f64::from(i32::MAX);
    is_near.then_some(nearest as i32)
}

/// Returns a value as the number of a word, rounded to eight decimals.
pub fn decimal(value: f64) -> Result<Decimal, Status> {
    let size = value.abs();
    if size.is_nan() || size >= f64::from(u32::MAX) {
        return Err(Status::OutOfRange);
    }
    let units = libm::round(size * PER_UNIT) as u64;
    let tail = (units % 10_000) as u16;
    let frac = (units / 10_000 % 10_000) as u16;
    let whole = (units / 100_000_000) as u32;
    Ok(Decimal { whole, frac, tail, negative: value < 0.0 && units != 0 })
}

/// Returns the number of the word `letter` for a computed value. Numbers that have to be whole, and those of codes,
/// may be off by 0.0001.
pub fn word(letter: u8, value: f64) -> Result<Decimal, Status> {
    let value = match letter {
        b'G' => near(value * 10.0, NEAR_TENTHS).map_or(value, |tenths| f64::from(tenths) / 10.0),
        b'M' | b'T' | b'H' | b'L' | b'D' | b'O' => whole(value).map_or(value, f64::from),
        _ => value,
    };
    decimal(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(text: &str) -> Result<f64, Status> {
        read(&mut Text::new(text.as_bytes()))
    }

    #[test]
    fn numbers_are_read_as_rust_reads_them() {
        for text in ["0", "1.", ".5", "0.1", "-2.75", "123456.789", "0.000001", "99999999.9999"] {
            assert_eq!(number(text), Ok(text.parse().unwrap()), "{text}");
        }
        assert_eq!(number(" + 1 2 . 5 0"), Ok(12.5));
        for text in ["", "-", ".", "+.", "x"] {
            assert_eq!(number(text), Err(Status::BadNumber), "{text}");
        }
    }

    #[test]
    fn endless_digits_end() {
        let long = "9".repeat(240);
        assert!((number(&long).unwrap() / 1e240 - 1.0).abs() < 1e-12);
        let small = ["0.", &"0".repeat(240), "1"].concat();
        assert!(number(&small).unwrap() < 1e-20);
        let third = ["0.", &"3".repeat(240)].concat();
        assert!((number(&third).unwrap() - 1.0 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn whole_numbers_have_a_tolerance() {
        assert_eq!(whole(1.00005), Some(1));
        assert_eq!(whole(1.99995), Some(2));
        assert_eq!(whole(-3.0), Some(-3));
        assert_eq!(whole(1.0002), None);
        assert_eq!(whole(1e12), None);
    }

    #[test]
    fn words_are_rounded_to_eight_decimals() {
        let decimal = |value| decimal(value).unwrap();
        assert_eq!(decimal(0.1 + 0.2), Decimal { whole: 0, frac: 3_000, tail: 0, negative: false });
        assert_eq!(decimal(-1e-12), Decimal::default());
        assert_eq!(decimal(-0.0), Decimal::default());
        let other = Decimal { whole: 12, frac: 3_456, tail: 7_891, negative: true };
        assert_eq!(decimal(-12.345_678_91), other);
        assert_eq!(super::decimal(4294967296.0), Err(Status::OutOfRange));
        assert_eq!(word(b'G', 54.99995).unwrap(), decimal(55.0));
        assert_eq!(word(b'G', 59.100001).unwrap(), decimal(59.1));
        assert_eq!(word(b'M', 3.0001), Ok(decimal(3.0)));
        assert_eq!(word(b'X', 3.0001), Ok(decimal(3.0001)));
    }
}
