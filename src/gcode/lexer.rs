//! The lexer: reads words and comments, with `nom`: `G01 X-1.5 (comment) ; comment`.
//!
//! Blanks may stand anywhere, inside numbers too (RS274). The parsers are called one after the other and not combined
//! into trees, because on AVR every level of combinators would copy what it returns.

use kerf_macros::small;
use nom::combinator::fail;
use nom::error::{ErrorKind, ParseError};
use nom::{IResult, Parser};

use super::comment;
use super::decimal::Decimal;
use super::number::decimal;
use crate::status::Status;

/// The reason why bytes are no word.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fault(pub Status);

/// What a parser here returns.
pub type Lexed<'a, T> = IResult<&'a [u8], T, Fault>;

impl ParseError<&[u8]> for Fault {
    fn from_error_kind(_: &[u8], _: ErrorKind) -> Self {
        Fault(Status::MalformedCommand)
    }
    fn append(_: &[u8], _: ErrorKind, other: Self) -> Self {
        other
    }
}

/// Returns an error that ends parsing, without trying other alternatives.
pub fn failure(status: Status) -> nom::Err<Fault> {
    nom::Err::Failure(Fault(status))
}

/// An item of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Item<'a> {
    /// A letter, upper case, and its number.
    Word(u8, Decimal),
    /// The text of a comment.
    Comment(&'a [u8]),
}

/// Whether a byte is white space within a line.
pub fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r')
}

/// Skips white space. If there is none, `nom`'s `take_while` takes three times as long.
pub fn blanks(input: &[u8]) -> Lexed<'_, ()> {
    let mut rest = input;
    while let Some((&byte, after)) = rest.split_first()
        && is_blank(byte)
    {
        rest = after;
    }
    Ok((rest, ()))
}

/// Reads the next item and the blanks behind it.
///
/// Error 101 where no item can begin, error 102 for a letter without a number.
#[inline(always)]
pub fn item(input: &[u8]) -> Lexed<'_, Item<'_>> {
    match input.first() {
        Some(b'(' | b';') => comment(input),
        _ => word(input),
    }
}

#[inline(always)]
fn word(input: &[u8]) -> Lexed<'_, Item<'_>> {
    let (input, letter) = letter(input)?;
    let (input, number) = decimal(input)?;
    Ok((input, Item::Word(letter, number)))
}

/// Reads a letter and returns it in upper case. `nom`'s own parser would convert it to a 32-bit character.
#[inline(always)]
fn letter(input: &[u8]) -> Lexed<'_, u8> {
    match input.split_first() {
        Some((byte, rest)) if byte.is_ascii_alphabetic() => Ok((rest, byte.to_ascii_uppercase())),
        _ => fail().parse(input),
    }
}

/// Reads a comment: `( ... )`, closed or not, or `;` to the end of the line.
///
/// Error 101 if the comment is not closed and text stands behind one within it: `(a (b) Y5` may be meant either way.
#[inline(never)]
#[small]
fn comment(input: &[u8]) -> Lexed<'_, Item<'_>> {
    let Some((mark, text)) = input.split_first() else { return fail().parse(input) };
    if *mark == b';' {
        return Ok((&[], Item::Comment(text)));
    }
    let (text, rest) = text.split_at_checked(comment::length(text)).unwrap_or((text, &[]));
    match rest.split_first() {
        Some((_, rest)) => blanks(rest).map(|(rest, ())| (rest, Item::Comment(text))),
        None if hides_words(text) => fail().parse(input),
        None => Ok((rest, Item::Comment(text))),
    }
}

/// Whether text stands behind the last comment within a comment.
fn hides_words(text: &[u8]) -> bool {
    let text = text.trim_ascii_end();
    let last = text.iter().rposition(|byte| *byte == b')');
    last.is_some_and(|at| at + 1 != text.len())
}

/// Returns the text of a comment behind `MSG`, and behind the comma if one follows. `None` if the comment does not
/// begin with `MSG`.
pub fn message(comment: &[u8]) -> Option<&[u8]> {
    let (text, _) = blanks(comment).ok()?;
    let (mark, text) = text.split_at_checked(3)?;
    let text = text.strip_prefix(b",").unwrap_or(text);
    mark.eq_ignore_ascii_case(b"MSG").then_some(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Returns the items of a line as text, or the error.
    fn items(line: &str) -> Result<Vec<(char, std::string::String)>, Status> {
        let (mut rest, _) = blanks(line.as_bytes()).unwrap();
        let mut found = Vec::new();
        while !rest.is_empty() {
            let (after, item) = match item(rest) {
                Ok(done) => done,
                Err(nom::Err::Failure(fault) | nom::Err::Error(fault)) => return Err(fault.0),
                Err(nom::Err::Incomplete(_)) => unreachable!(),
            };
            found.push(match item {
                Item::Word(letter, value) => (letter as char, std::format!("{}", value.to_f32())),
                Item::Comment(text) => (';', std::str::from_utf8(text).unwrap().into()),
            });
            rest = after;
        }
        Ok(found)
    }

    fn list(expected: &[(char, &str)]) -> Result<Vec<(char, std::string::String)>, Status> {
        Ok(expected.iter().map(|(letter, text)| (*letter, (*text).into())).collect())
    }

    #[test]
    fn blanks_case_and_comments() {
        let words = list(&[('G', "1"), ('X', "10.5"), ('Y', "-2")]);
        for line in ["G1X10.5Y-2", "g01 x10.5 y-2", " G 1\tX 1 0 . 5 Y - 2 ", "G1X+10.5Y-2\r"] {
            assert_eq!(items(line), words, "{line}");
        }
        let commented = list(&[('G', "1"), (';', "a ; b"), ('X', "2"), (';', " rest (x)")]);
        assert_eq!(items("G1 (a ; b) X2 ; rest (x)"), commented);
        assert_eq!(items("(open"), list(&[(';', "open")]));
    }

    #[test]
    fn comments_in_comments() {
        for (line, text) in [
            ("(MSG 1/8\" bit (flat))", "MSG 1/8\" bit (flat)"),
            ("(a (b) c (d (e)) f)", "a (b) c (d (e)) f"),
            ("(()) ", "()"),
            ("(a (b) ", "a (b) "),
            ("(a (b", "a (b"),
            (";a) (b", "a) (b"),
        ] {
            assert_eq!(items(line), list(&[(';', text)]), "{line}");
        }
        assert_eq!(items("(a(b))X1(c)"), list(&[(';', "a(b)"), ('X', "1"), (';', "c")]));
        // Nobody can tell whether the Y word belongs to the comment.
        for line in ["(a (b) Y5", "G1 X3 (a (b) Y5 ; c", "(a))", "(a) b)"] {
            assert!(items(line).is_err(), "{line}");
        }
    }

    #[test]
    fn refusals() {
        for line in ["1X", "G1*55", "X1.2.3", "X1-2", "#1=2", "G1 %", "X1)"] {
            assert_eq!(items(line), Err(Status::MalformedCommand), "{line}");
        }
        for line in ["X", "GX1", "X-", "X(1)2", "X1 Y"] {
            assert_eq!(items(line), Err(Status::BadNumber), "{line}");
        }
        assert_eq!(items("N4294967296"), Err(Status::OutOfRange));
    }

    #[test]
    fn messages() {
        assert_eq!(message(b"MSG Hello"), Some(&b" Hello"[..]));
        assert_eq!(message(b" msg,Hello"), Some(&b"Hello"[..]));
        assert_eq!(message(b"MSG"), Some(&b""[..]));
        assert_eq!(message(b"MS"), None);
        assert_eq!(message(b"a MSG"), None);
    }
}
