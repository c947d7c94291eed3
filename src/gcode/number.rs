//! Parsers for the numbers of a G-code line.

use core::slice;

use super::decimal::Decimal;
use super::lexer::{Lexed, blanks, failure, is_blank};
use crate::status::Status;

/// Reads a number: sign, digits, point, digits, with blanks anywhere, at least one digit, and no exponent. Reads the
/// blanks behind the number too.
///
/// Cost on AVR: 100 cycles, and 20 for a digit. With blanks inside, or more than four digits on either
/// side of the point, 300 more, and 50 for a digit.
#[inline(always)]
pub fn decimal(input: &[u8]) -> Lexed<'_, Decimal> {
    match usual(input) {
        Some(done) => Ok(done),
        None => any(input),
    }
}

/// Reads a number without blanks, with one to four digits left of the point and at most four right of it. `None` for
/// any other input.
#[inline(always)]
fn usual(input: &[u8]) -> Option<(&[u8], Decimal)> {
    let mut at = input.iter();
    let negative = input.first() == Some(&b'-');
    if negative {
        at.next();
    }
    let whole = usual_whole(&mut at)?;
    let mut frac = 0;
    if at.as_slice().first() == Some(&b'.') {
        at.next();
        frac = usual_fraction(&mut at);
    }
    let mut rest = at.as_slice();
    if rest.first().is_some_and(|&byte| is_blank(byte)) {
        (rest, _) = blanks(rest).ok()?;
    }
    // More digits follow, or a byte that no word can begin with. `any` handles these cases.
    if rest.first().is_some_and(|&byte| byte < b'A' && byte != b'(') {
        return None;
    }
    let negative = negative && (whole | frac) != 0;
    Some((rest, Decimal { whole: whole.into(), frac, tail: 0, negative }))
}

/// Reads one to four digits, in pairs, because AVR multiplies bytes.
#[inline(always)]
fn usual_whole(at: &mut slice::Iter<u8>) -> Option<u16> {
    let first = digit(at)?;
    let Some(second) = digit(at) else { return Some(first.into()) };
    let high = pair(first, second);
    let Some(third) = digit(at) else { return Some(high.into()) };
    let Some(fourth) = digit(at) else { return Some(u16::from(high) * 10 + u16::from(third)) };
    Some(u16::from(high) * 100 + u16::from(pair(third, fourth)))
}

/// Reads up to four decimals and returns them as ten-thousandths.
#[inline(always)]
fn usual_fraction(at: &mut slice::Iter<u8>) -> u16 {
    let Some(first) = digit(at) else { return 0 };
    let second = digit(at);
    let high = u16::from(pair(first, second.unwrap_or(0))) * 100;
    let Some(third) = second.and_then(|_| digit(at)) else { return high };
    high + u16::from(pair(third, digit(at).unwrap_or(0)))
}

fn pair(ten: u8, one: u8) -> u8 {
    ten * 10 + one
}

#[inline(always)]
fn digit(at: &mut slice::Iter<u8>) -> Option<u8> {
    let digit = at.as_slice().first()?.wrapping_sub(b'0');
    if digit > 9 {
        return None;
    }
    at.next();
    Some(digit)
}

/// Reads a number of any form.
#[cold]
#[inline(never)]
#[small]
fn any(input: &[u8]) -> Lexed<'_, Decimal> {
    let mut rest = input;
    let mut value = Decimal::default();
    let sign = next_if(&mut rest, |byte| matches!(byte, b'-' | b'+'));
    let mut digits = whole(&mut rest, &mut value).ok_or(failure(Status::OutOfRange))?;
    if next_if(&mut rest, |byte| byte == b'.').is_some() {
        digits += fraction(&mut rest, &mut value);
    }
    if digits == 0 {
        return Err(failure(Status::BadNumber));
    }
    value.negative = sign == Some(b'-') && !value.is_zero();
    Ok((rest, value))
}

/// Reads the digits left of the point. Returns their number, where 5 stands for 5 or more. `None` beyond 32 bits.
#[small]
fn whole(rest: &mut &[u8], value: &mut Decimal) -> Option<u8> {
    let (start, mut count) = four(rest);
    value.whole = start.into();
    if count == 4 {
        while let Some(digit) = next_digit(rest) {
            if value.whole > u32::MAX / 10 {
                return None;
            }
            value.whole = (value.whole * 10).checked_add(digit.into())?;
            count = 5;
        }
    }
    Some(count)
}

/// Reads the digits right of the point. Returns their number, where 4 stands for 4 or more.
#[small]
fn fraction(rest: &mut &[u8], value: &mut Decimal) -> u8 {
    let (digits, count) = four(rest);
    value.frac = aligned(digits, count);
    if count == 4 {
        let (digits, count) = four(rest);
        value.tail = aligned(digits, count);
        while next_digit(rest).is_some() {}
    }
    count
}

/// Reads up to four digits. Returns their value and their number.
#[small]
fn four(rest: &mut &[u8]) -> (u16, u8) {
    let (mut value, mut count) = (0, 0);
    // A local copy stays in registers.
    let mut at = *rest;
    while count < 4 {
        let Some(digit) = next_digit(&mut at) else { break };
        value = value * 10 + u16::from(digit);
        count += 1;
    }
    *rest = at;
    (value, count)
}

/// Converts the value of the first `count` decimals to ten-thousandths.
fn aligned(digits: u16, count: u8) -> u16 {
    match count {
        0 => 0,
        1 => digits * 1_000,
        2 => digits * 100,
        3 => digits * 10,
        _ => digits,
    }
}

/// Takes the next digit, if one is next. Blanks before it are skipped in any case.
#[inline(always)]
fn next_digit(rest: &mut &[u8]) -> Option<u8> {
    next_if(rest, |byte| byte.is_ascii_digit()).map(|byte| byte - b'0')
}

/// Takes the next byte if it is `wanted`. Blanks before it are skipped in any case.
#[inline(always)]
fn next_if(rest: &mut &[u8], wanted: impl Fn(u8) -> bool) -> Option<u8> {
    while let Some((&byte, after)) = rest.split_first() {
        if wanted(byte) {
            *rest = after;
            return Some(byte);
        }
        if !is_blank(byte) {
            break;
        }
        *rest = after;
    }
    None
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Returns the number, if the whole text is one.
    pub fn read(text: &str) -> Decimal {
        let (rest, value) = decimal(text.as_bytes()).expect(text);
        assert!(rest.is_empty(), "{text}");
        value
    }

    fn refusal(text: &str) -> Status {
        match decimal(text.as_bytes()) {
            Err(nom::Err::Failure(fault)) => fault.0,
            other => panic!("{text}: {other:?}"),
        }
    }

    #[test]
    fn every_way_to_write_a_number() {
        let quarter = Decimal { whole: 0, frac: 2_500, tail: 0, negative: false };
        for text in ["0.25", ".25", "+.25", "00.2500", " 0 . 2\t5", ".250000000"] {
            assert_eq!(read(text), quarter, "{text}");
        }
        assert_eq!(read("-0"), Decimal::default());
        assert_eq!(read("5."), Decimal { whole: 5, ..Decimal::default() });
        let long = Decimal { whole: 12, frac: 3_456, tail: 7_890, negative: true };
        assert_eq!(read("-12.3456789"), long);
        assert_eq!(read("4294967295").whole, u32::MAX);
    }

    #[test]
    fn what_is_no_number() {
        for text in ["", "-", ".", "+.", "x", "--1"] {
            assert_eq!(refusal(text), Status::BadNumber, "{text}");
        }
        for text in ["4294967296", "42949672950", "99999999999999"] {
            assert_eq!(refusal(text), Status::OutOfRange, "{text}");
        }
    }
}
