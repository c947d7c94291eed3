//! `(PRINT,..)` and `(DEBUG,..)`: comments that tell the sender something, with the values of parameters.
//!
//! Only the last comment of a line counts. `#5` and `#<name>` are replaced by values, no expressions. `%d`, `%f` and `%.2f`
//! choose the number of decimals of the values behind them. A value that does not exist, or has no room, is written as
//! `######`. A text is cut at [`LONGEST`] bytes.

use heapless::Vec;

use super::expression::Scope;
use super::parameters::NUMBER_MAX;
use super::text::Name;

/// The longest text.
pub const LONGEST: usize = 100;
/// What is written in place of a value that does not exist.
const NONE: &[u8] = b"######";
/// Decimals, unless a format says otherwise.
const DECIMALS: usize = 6;
/// The most digits of a `u64`.
const DIGITS: usize = 20;
/// Values nearer to 0 are written as 0.
const NOTHING: f64 = 1e-6;

/// What the last line has told.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Said {
    bytes: [u8; LONGEST],
    length: u8,
}

impl Said {
    /// Nothing.
    pub const NOTHING: Self = Self { bytes: [0; LONGEST], length: 0 };

    /// Returns the text.
    pub fn text(&self) -> &[u8] {
        self.bytes.get(..self.length.into()).unwrap_or_default()
    }

    /// Writes a text, in which parameters are replaced by their values.
    pub fn of(text: &[u8], scope: &dyn Scope) -> Self {
        let (mut said, mut rest, mut decimals) = (Self::NOTHING, text, DECIMALS);
        while let Some((&byte, after)) = rest.split_first() {
            rest = match byte {
                b'#' => said.parameter(after, scope, decimals),
                b'%' => said.format(after, &mut decimals),
                _ => {
                    said.put(byte);
                    after
                }
            };
        }
        said
    }

    fn put(&mut self, byte: u8) {
        if let Some(place) = self.bytes.get_mut(usize::from(self.length)) {
            *place = byte;
            self.length += 1;
        }
    }

    /// Reads a format. Returns what is behind it.
    fn format<'a>(&mut self, text: &'a [u8], decimals: &mut usize) -> &'a [u8] {
        match text {
            [b'd', rest @ ..] => (*decimals = 0, rest).1,
            [b'f', rest @ ..] => (*decimals = 4, rest).1,
            [b'.', digit @ b'0'..=b'9', b'f', rest @ ..] => {
                (*decimals = usize::from(digit - b'0'), rest).1
            }
            [b'.', ..] => text,
            _ => {
                self.put(b'%');
                text
            }
        }
    }

    /// Writes the value of the parameter behind `#`. Returns what is behind it.
    fn parameter<'a>(&mut self, text: &'a [u8], scope: &dyn Scope, decimals: usize) -> &'a [u8] {
        if let Some(name) = text.strip_prefix(b"<") {
            let Some(end) = name.iter().position(|byte| *byte == b'>') else { return &[] };
            let (name, rest) = name.split_at_checked(end).unwrap_or_default();
            self.value(scope.named(Name(name)), decimals);
            return rest.get(1..).unwrap_or_default();
        }
        let end = text.iter().position(|byte| !byte.is_ascii_digit()).unwrap_or(text.len());
        let (digits, rest) = text.split_at_checked(end).unwrap_or_default();
        if !digits.is_empty() {
            let number = digits.iter().try_fold(0u16, |number, digit| {
                number.checked_mul(10)?.checked_add(u16::from(digit - b'0'))
            });
            let known = number.filter(|number| (1..=NUMBER_MAX).contains(number));
            self.value(known.and_then(|number| scope.numbered(number).ok()), decimals);
        } else if !rest.is_empty() {
            self.put(b'#');
        }
        rest
    }

    /// Writes a value.
    fn value(&mut self, value: Option<f64>, decimals: usize) {
        let before = *self;
        if !value.is_some_and(|value| self.number(value, decimals)) {
            *self = before;
            NONE.iter().for_each(|byte| self.put(*byte));
        }
    }

    /// Writes a number, with halves rounded to even. Returns false if there is no room.
    fn number(&mut self, value: f64, decimals: usize) -> bool {
        let size = value.abs();
        let mut whole = size as u64;
        if whole == u64::MAX {
            return false;
        }
        let scale = 10u64.pow(decimals as u32);
        let mut part = match decimals {
            0 => u64::from(libm::rint(size - (whole & !1) as f64) as u64 > whole & 1),
            _ => libm::rint((size - whole as f64) * scale as f64) as u64,
        };
        if part >= scale {
            (whole, part) = (whole + 1, 0);
        }
        let is_nothing = size < NOTHING || (whole, part) == (0, 0);
        if is_nothing {
            (whole, part) = (0, 0);
        } else if value < 0.0 {
            self.put(b'-');
        }
        self.digits(whole, 1);
        if decimals > 0 {
            self.put(b'.');
            self.digits(part, decimals);
        }
        usize::from(self.length) < LONGEST
    }

    /// Writes a whole number with at least this many digits.
    fn digits(&mut self, mut number: u64, least: usize) {
        let mut digits = Vec::<u8, DIGITS>::new();
        while digits.len() < least || number > 0 {
            let _ = digits.push(b'0' + (number % 10) as u8);
            number /= 10;
        }
        digits.iter().rev().for_each(|digit| self.put(*digit));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status::Status;
    use std::string::String;

    struct Fixed;

    impl Scope for Fixed {
        fn numbered(&self, number: u16) -> Result<f64, Status> {
            Ok(match number {
                1 => 2.5,
                2 => 1e30,
                3 => -0.0000001,
                4 => 1e300,
                5 => 1_234_567_890_123_456_789.0,
                6 => 3.5,
                7 => -1.5,
                8 => -0.9996,
                _ => 0.0,
            })
        }
        fn named(&self, name: Name) -> Option<f64> {
            name.is(Name(b"x")).then_some(-1.25)
        }
        fn has(&self, _number: f64) -> bool {
            false
        }
    }

    fn said(text: &str) -> String {
        String::from_utf8(Said::of(text.as_bytes(), &Fixed).text().into()).unwrap()
    }

    #[test]
    fn values_are_written_in_their_format() {
        for (text, expected) in [
            ("a #1 b", "a 2.500000 b"),
            ("int %d#1 four %f#1 two %.2f#1 #<X>", "int 2 four 2.5000 two 2.50 -1.25"),
            ("bad %.x %5 %% # #[1] ##1", "bad .x %5 %% # #[1] #2.500000"),
            ("#5999 #<none> #<x", "###### ###### "),
            ("zero #3 big %d#2", "zero 0.000000 big ######"),
            ("%d#5 #6 #7 %.3f#8", "1234567890123456768 4 -2 -1.000"),
            ("#4|", "######|"),
            ("end #", "end "),
        ] {
            assert_eq!(said(text), expected, "{text}");
        }
    }

    #[test]
    fn long_texts_are_cut() {
        let text = "x".repeat(98);
        assert_eq!(said(&[&text, "#1y"].concat()), [&text, "##"].concat());
    }
}
