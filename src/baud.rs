//! Rates of the serial line: the rates that `{baud:n}` may ask for, and the divisor that produces a rate.
//!
//! A rate is given in bits a second, or as one of TinyG's codes 1 to 6. `config` checks a rate with these pure
//! functions, and the UART driver takes its divisor from them. Each costs a 32-bit division, 600 cycles on AVR.

use crate::boards::ACTIVE;
use crate::progmem;

/// The rate at power-up.
pub const DEFAULT: u32 = 115_200;
/// The lowest and the highest rate that may be asked for by value.
const LIMITS: core::ops::RangeInclusive<u32> = 9_600..=1_000_000;
/// The clock has to produce a rate to 1 in 40, or 2.5 %. The sender adds its own error, and the receiver at double speed
/// tolerates a sender that is up to 3.9 % faster or 4.0 % slower.
const NEARNESS: u32 = 40;

progmem! {
    /// The rates of the codes 1 to 6. All six are accepted, although the clock produces 230,400 with an error of 3.5 %, so
    /// that the sender is 3.7 % faster: senders offer this rate. A sender whose own rate is more than 0.2 % high may fail.
    static CODES: [u32; 6] = [9_600, 19_200, 38_400, 57_600, 115_200, 230_400];
}

/// Returns the rate, in bits a second, that `value` stands for. `None` if `value` is neither a code nor a possible
/// rate.
#[small]
pub fn rate(value: i32) -> Option<u32> {
    let value = u32::try_from(value).ok()?;
    let code = usize::try_from(value).ok().and_then(|v| v.checked_sub(1));
    if let Some(rate) = code.and_then(|code| CODES.at(code)) {
        return Some(rate);
    }
    let named = (0..CODES.len()).any(|code| CODES.at(code) == Some(value));
    (named || (LIMITS.contains(&value) && is_near(value))).then_some(value)
}

#[small]
fn is_near(rate: u32) -> bool {
    let ideal = rate * (u32::from(divisor(rate)) + 1);
    eighth().abs_diff(ideal) * NEARNESS <= ideal
}

/// Returns the value of the UART's rate register for the rate nearest to `baud`, at double speed (data sheet,
/// table 22-1). `baud` is a rate that [`rate`] has returned.
#[small]
pub fn divisor(baud: u32) -> u16 {
    let nearest = (eighth() + baud / 2) / baud.max(1);
    nearest.saturating_sub(1).min(0xFFF) as u16
}

#[small]
const fn eighth() -> u32 {
    ACTIVE.clock_hz / 8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_and_rates() {
        assert_eq!(rate(1), Some(9_600));
        assert_eq!(rate(5), Some(DEFAULT));
        assert_eq!(rate(6), Some(230_400));
        for usual in [9_600, 14_400, 28_800, 57_600, 76_800, 115_200, 230_400] {
            assert_eq!(rate(usual as i32), Some(usual));
        }
        for exact in [125_000, 200_000, 250_000, 400_000, 500_000, 1_000_000] {
            assert_eq!(rate(exact as i32), Some(exact));
        }
    }

    #[test]
    fn others_are_none() {
        for bad in [i32::MIN, -5, 0, 7, 9_599, 240_000, 460_800, 921_600, 1_000_001, i32::MAX] {
            assert_eq!(rate(bad), None, "{bad}");
        }
    }

    #[test]
    fn every_rate_is_made_nearly() {
        for value in 0..=1_100_000 {
            let Some(rate) = rate(value).filter(|rate| *rate != 230_400) else { continue };
            let made = 2e6 / (f64::from(divisor(rate)) + 1.0);
            assert!((made / f64::from(rate) - 1.0).abs() <= 0.025, "{rate}: {made}");
        }
    }

    #[test]
    fn divisors_of_the_data_sheet() {
        let known = [(9_600, 207), (115_200, 16), (230_400, 8), (500_000, 3), (1_000_000, 1)];
        for (rate, divisor_of) in known {
            assert_eq!(divisor(rate), divisor_of, "{rate}");
        }
    }
}
