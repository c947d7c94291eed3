//! The text of a line as expressions see it: without blanks, in upper case.

use super::super::lexer::is_blank;
use crate::status::Status;

/// A place in a line.
#[derive(Clone, Copy)]
pub struct Text<'a> {
    rest: &'a [u8],
}

/// The name of a parameter as it is written. Blanks and the case of letters do not count.
#[derive(Clone, Copy)]
pub struct Name<'a>(pub &'a [u8]);

impl<'a> Text<'a> {
    /// Returns the beginning of a text.
    pub fn new(rest: &'a [u8]) -> Self {
        Self { rest }
    }

    /// Returns what has not been read yet.
    pub fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Returns the next byte in upper case without reading it, and skips the blanks before it. `None` at the end.
    pub fn peek(&mut self) -> Option<u8> {
        while let Some((&byte, after)) = self.rest.split_first() {
            if !is_blank(byte) {
                return Some(byte.to_ascii_uppercase());
            }
            self.rest = after;
        }
        None
    }

    /// Reads the next byte if it is a certain one. Returns whether it was.
    pub fn eat(&mut self, byte: u8) -> bool {
        let is = self.peek() == Some(byte);
        if is {
            self.rest = self.rest.get(1..).unwrap_or_default();
        }
        is
    }

    /// Reads a word of upper-case letters or signs, or nothing. Returns whether the word was next.
    pub fn eat_word(&mut self, word: &[u8]) -> bool {
        let before = *self;
        let is = word.iter().all(|byte| self.eat(*byte));
        if !is {
            *self = before;
        }
        is
    }

    /// Reads a digit.
    pub fn digit(&mut self) -> Option<u8> {
        let byte = self.peek().filter(u8::is_ascii_digit)?;
        self.eat(byte);
        Some(byte - b'0')
    }

    /// Whether a number is next, with its sign or without.
    pub fn is_at_number(&mut self) -> bool {
        let mut ahead = *self;
        if !ahead.eat(b'-') {
            ahead.eat(b'+');
        }
        ahead.peek().is_some_and(|byte| byte.is_ascii_digit() || byte == b'.')
    }

    /// Reads the name of a parameter. The text is behind the `<`; the `>` is read, too.
    pub fn name(&mut self) -> Result<Name<'a>, Status> {
        let end = self.rest.iter().position(|byte| *byte == b'>');
        let (name, rest) =
            end.and_then(|end| self.rest.split_at_checked(end)).ok_or(Status::ExpressionInvalid)?;
        self.rest = rest.get(1..).unwrap_or_default();
        let name = Name(name);
        if name.bytes().next().is_none() { Err(Status::ExpressionInvalid) } else { Ok(name) }
    }
}

impl<'a> Name<'a> {
    /// Returns the bytes that count, in lower case.
    pub fn bytes(self) -> impl Iterator<Item = u8> + 'a {
        self.0.iter().filter(|byte| !is_blank(**byte)).map(u8::to_ascii_lowercase)
    }

    /// Whether the parameter is known at each level of calls.
    pub fn is_global(self) -> bool {
        self.bytes().next() == Some(b'_')
    }

    /// Whether two names are the same.
    pub fn is(self, other: Name) -> bool {
        self.bytes().eq(other.bytes())
    }
}
