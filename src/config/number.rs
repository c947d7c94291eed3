//! Decimal numbers without floats: text to fixed point and back. Bits as hexadecimal.
//!
//! Conversions round half away from zero and are otherwise exact, inches included (an inch is 25.4 mm). A number is
//! first divided by ten with truncation, then rounded in the last division. This keeps the result exact, because the
//! truncated part can never lift a value over a tie.
//!
//! Cost on AVR: a few thousand cycles a conversion (64-bit arithmetic). Never used on the motion path.

use heapless::Vec;

use crate::progmem;

/// `value` / 10^`decimals`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fixed {
    /// The scaled integer.
    pub value: i32,
    /// The number of decimals in `value`.
    pub decimals: u8,
}

/// A buffer with room for any [`Fixed`] as text.
pub type Digits = [u8; 12];

#[small]
impl Fixed {
    /// Makes an integer.
    pub fn int(value: i32) -> Fixed {
        Fixed { value, decimals: 0 }
    }

    /// Returns the number rounded to at most `decimals` decimals.
    pub fn rounded(self, decimals: u8) -> Fixed {
        let mut value = self.value.unsigned_abs();
        let mut have = self.decimals;
        while have > decimals.saturating_add(1) {
            value /= 10;
            have -= 1;
        }
        if have > decimals {
            value = (value + 5) / 10;
            have -= 1;
        }
        Fixed { value: signed(value.into(), self.value < 0), decimals: have }
    }

    /// Converts millimetres to inches with at most `decimals` decimals.
    pub fn inches(self, decimals: u8) -> Fixed {
        let decimals = decimals.min(self.decimals);
        let mut divisor = 254u64;
        for _ in decimals..self.decimals {
            divisor = divisor.saturating_mul(10);
        }
        let inches = (u64::from(self.value.unsigned_abs()) * 20 + divisor) / (divisor * 2);
        Fixed { value: signed(inches, self.value < 0), decimals }
    }

    /// Returns the number with at least `decimals` decimals. The scaled value must fit 32 bits.
    pub fn padded(mut self, decimals: u8) -> Fixed {
        while self.decimals < decimals {
            self.value = self.value.wrapping_mul(10);
            self.decimals += 1;
        }
        self
    }

    /// Returns the number as text with every decimal. Cost on AVR: 300 cycles up to 9,999, else 700; and 70 for each
    /// digit that is not 0.
    pub fn render(self, buffer: &mut Digits) -> &[u8] {
        let decimals = self.decimals.min(9);
        let mut rest = self.value.unsigned_abs();
        let mut len = 0;
        let mut put = |byte| {
            if let Some(place) = buffer.get_mut(len) {
                *place = byte;
                len += 1;
            }
        };
        if self.value < 0 {
            put(b'-');
        }
        let mut begun = false;
        // Most numbers have at most four digits.
        let places = if rest < 10_000 && decimals < 4 { 4 } else { POWERS.len() as u8 };
        for place in (0..places).rev() {
            let power = POWERS.at(place.into()).unwrap_or(1);
            let mut digit = b'0';
            // Repeated subtraction is faster: a division takes 600 cycles, one round of this loop 15.
            while rest >= power {
                rest -= power;
                digit += 1;
            }
            begun |= digit != b'0' || place <= decimals;
            if begun {
                put(digit);
            }
            if place == decimals && place != 0 {
                put(b'.');
            }
        }
        buffer.get(..len).unwrap_or(&[])
    }
}

progmem! {
    /// 10 to the power of the index.
    static POWERS: [u32; 10] = [
        1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000, 1_000_000_000,
    ];
}

fn signed(magnitude: u64, negative: bool) -> i32 {
    let magnitude = magnitude.min(i32::MAX as u64) as i32;
    if negative { -magnitude } else { magnitude }
}

/// A number as received: (-1)^`negative` * `digits` * 10^`exponent`.
///
/// Sixteen significant digits are kept. More digits could not change any value that fits 32 bits.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Number {
    digits: u64,
    exponent: i16,
    negative: bool,
}

#[small]
impl Number {
    /// Makes an integer.
    pub fn int(value: u32) -> Number {
        Number { digits: value.into(), exponent: 0, negative: false }
    }

    /// Reads a number such as `-12.5e3`: digits with an optional sign, decimals and exponent. Commas are ignored.
    /// `None` for any other text.
    pub fn parse(text: &[u8]) -> Option<Number> {
        let mut number = Number::int(0);
        let mut bytes = text.iter().copied().filter(|byte| *byte != b',').peekable();
        number.negative = bytes.next_if_eq(&b'-').is_some();
        let mut any = false;
        while let Some(digit) = bytes.next_if(u8::is_ascii_digit) {
            number.push(digit, false);
            any = true;
        }
        if bytes.next_if_eq(&b'.').is_some() {
            while let Some(digit) = bytes.next_if(u8::is_ascii_digit) {
                number.push(digit, true);
                any = true;
            }
        }
        if bytes.next_if(|b| b.eq_ignore_ascii_case(&b'e')).is_some() {
            let down = bytes.next_if_eq(&b'-').is_some();
            if !down {
                bytes.next_if_eq(&b'+');
            }
            let mut exponent = 0i16;
            any &= bytes.peek().is_some();
            while let Some(digit) = bytes.next_if(u8::is_ascii_digit) {
                exponent = (exponent * 10 + i16::from(digit - b'0')).min(999);
            }
            number.exponent += if down { -exponent } else { exponent };
        }
        (any && bytes.next().is_none()).then_some(number)
    }

    fn push(&mut self, digit: u8, decimal: bool) {
        if self.digits < 1_000_000_000_000_000 {
            self.digits = self.digits * 10 + u64::from(digit - b'0');
            self.exponent -= i16::from(decimal);
        } else {
            self.exponent += i16::from(!decimal);
        }
    }

    /// Whether the number has no fraction.
    #[inline(never)]
    #[small]
    pub fn is_integer(self) -> bool {
        let mut digits = self.digits;
        for _ in self.exponent..0 {
            if digits == 0 || !digits.is_multiple_of(10) {
                return digits == 0;
            }
            digits /= 10;
        }
        true
    }

    /// Whether the number is below zero.
    pub fn is_negative(self) -> bool {
        self.negative && self.digits != 0
    }

    /// Returns a thousandth of the number.
    pub fn thousandth(self) -> Number {
        Number { exponent: self.exponent - 3, ..self }
    }

    /// Returns a millionth of the number.
    pub fn millionth(self) -> Number {
        Number { exponent: self.exponent - 6, ..self }
    }

    /// Returns the number as a fixed-point integer; `None` if it is out of range. With `inches` the number is in
    /// inches and the result in millimetres.
    pub fn fixed(self, decimals: u8, inches: bool) -> Option<i32> {
        let mut value = self.digits;
        let mut exponent = self.exponent + i16::from(decimals);
        if inches {
            value *= 254;
            exponent -= 1;
        }
        while exponent > 0 && value != 0 {
            value = value.checked_mul(10)?;
            exponent -= 1;
        }
        while exponent < -1 && value != 0 {
            value /= 10;
            exponent += 1;
        }
        if exponent == -1 {
            value = (value + 5) / 10;
        }
        (value <= i32::MAX as u64).then(|| signed(value, self.negative))
    }
}

/// Returns 32 bits as hexadecimal, such as `0x2a`.
#[inline(never)]
#[small]
pub fn hex(bits: i32) -> Vec<u8, 10> {
    let mut text = Vec::new();
    // There is room for ten bytes.
    let mut put = |byte| text.push(byte).is_ok();
    let _ = put(b'0') && put(b'x');
    let mut begun = false;
    for place in (0..8u8).rev() {
        let digit = (bits >> (4 * place)) as u8 & 15;
        begun |= digit != 0 || place == 0;
        if begun {
            put(if digit < 10 { b'0' + digit } else { b'a' - 10 + digit });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::string::String;

    fn shown(value: i32, decimals: u8) -> String {
        let mut buffer = Digits::default();
        String::from_utf8(Fixed { value, decimals }.render(&mut buffer).to_vec()).unwrap()
    }

    fn read(text: &str, decimals: u8, inches: bool) -> Option<i32> {
        Number::parse(text.as_bytes()).and_then(|n| n.fixed(decimals, inches))
    }

    #[test]
    fn bits_are_written_without_leading_zeros() {
        for (bits, text) in [(0, "0x0"), (0x2a, "0x2a"), (0x1000, "0x1000"), (-1, "0xffffffff")] {
            assert_eq!(hex(bits), text.as_bytes());
        }
    }

    #[test]
    fn prints() {
        assert_eq!(shown(0, 0), "0");
        assert_eq!(shown(-5, 3), "-0.005");
        assert_eq!(shown(44020, 2), "440.20");
        assert_eq!(shown(i32::MIN, 9), "-2.147483648");
        assert_eq!(shown(100, 0), "100");
    }

    #[test]
    fn rounds_half_away_from_zero() {
        let fixed = |value| Fixed { value, decimals: 4 }.rounded(3).value;
        assert_eq!([fixed(15), fixed(14), fixed(-15), fixed(-4)], [2, 1, -2, 0]);
        assert_eq!(Fixed { value: 12_700, decimals: 4 }.inches(3).value, 50);
        assert_eq!(Fixed { value: -127, decimals: 4 }.inches(3).value, -1);
        assert_eq!(Fixed { value: 126, decimals: 4 }.inches(3).value, 0);
    }

    #[test]
    fn pads() {
        assert_eq!(Fixed::int(8).padded(2), Fixed { value: 800, decimals: 2 });
        assert_eq!(Fixed { value: 970, decimals: 3 }.padded(2).decimals, 3);
    }

    #[test]
    fn reads() {
        assert_eq!(read("1.0005", 3, false), Some(1001));
        assert_eq!(read("-0.0005", 3, false), Some(-1));
        assert_eq!(read("1e3", 3, false), Some(1_000_000));
        assert_eq!(read("1.5E-3", 6, false), Some(1500));
        assert_eq!(read("10", 3, true), Some(254_000));
        assert_eq!(read("2147483.648", 3, false), None);
        assert_eq!(read("0.000000000000000000000001", 6, false), Some(0));
        assert_eq!(
            [read(".5", 1, false), read("-.5", 1, false), read("5.", 1, false)],
            [Some(5), Some(-5), Some(50)]
        );
        assert_eq!(read("0e999", 6, true), Some(0));
        assert_eq!(read("1,200.5", 1, false), Some(12_005));
        for bad in ["", "-", ".", "1.2.3", "1e", "1e-", "+1", "0x10", "nan", "e5"] {
            assert_eq!(read(bad, 3, false), None, "{bad}");
        }
        let whole = |t: &str| Number::parse(t.as_bytes()).unwrap().is_integer();
        assert!(whole("3") && whole("3.000") && whole("0e-5") && whole("30e-1"));
        assert!(!whole("3.5") && !whole("35e-1"));
    }

    proptest! {
        #[test]
        fn text_round_trips(value in -i32::MAX..i32::MAX, decimals in 0u8..=9) {
            prop_assert_eq!(read(&shown(value, decimals), decimals, false), Some(value));
        }

        #[test]
        fn inch_conversion_is_exact(value in -8_000_000i64..8_000_000, decimals in 0u8..=6) {
            let text = shown(value as i32, 5);
            let numerator = i128::from(value.abs()) * 254 * 10i128.pow(decimals.into());
            let millimetres = (numerator * 2 + 1_000_000) / 2_000_000;
            let expected = i32::try_from(millimetres).ok().map(|v| v * value.signum() as i32);
            prop_assert_eq!(read(&text, decimals, true), expected);
        }

        #[test]
        fn never_panics(text in "[-0-9.eE+]{0,30}", decimals in 0u8..=9, inches: bool) {
            let _ = read(&text, decimals, inches);
            let _ = Number::parse(text.as_bytes()).map(Number::is_integer);
        }
    }
}
