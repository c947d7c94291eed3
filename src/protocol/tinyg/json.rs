//! Reads a line of relaxed JSON in place: no copies, no tree.
//!
//! [`check`] validates a whole line before any of it is carried out. [`pair`] then reads one name and value at a
//! time. Keys may be unquoted, blanks may stand anywhere. Values are numbers, strings, the words `true`, `false` and
//! `null` or their first letters, and one level of objects, or two if the second one is called `set`.

use crate::config::Name;
use crate::plain;
use crate::protocol::Span;
use crate::status::Status;

/// The longest name that is accepted.
const LONGEST_NAME: u8 = 32;
/// The longest number that is accepted: any 64-bit float fits.
const LONGEST_NUMBER: u8 = 24;

/// The type of a value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// `n`, `null`, or the empty string.
    Null,
    /// `t` or `true`.
    True,
    /// `f` or `false`.
    False,
    /// A number.
    Number,
    /// A string. The span is between the quotes, with escapes.
    Text,
    /// An object. The span is empty and behind the opening brace.
    Object,
}

/// A name and its value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Pair {
    /// The name, without quotes.
    pub name: Span,
    /// The type of the value.
    pub kind: Kind,
    /// The position of the value.
    pub value: Span,
    /// The position to read on.
    pub next: u8,
}

#[small]
fn is_punctuation(byte: u8) -> bool {
    matches!(byte, b'"' | b'{' | b'}' | b'[' | b']' | b':' | b',' | b'\\')
}

/// Checks that `line` is one object, no deeper than `{srs:{set:{vel:t}}}`. The error says what is wrong. About 80
/// cycles a byte on AVR.
#[small]
pub fn check(line: &[u8]) -> Result<(), Status> {
    Cursor { line, at: 0 }.object().unwrap_or(Err(Status::JsonSyntax))
}

/// Returns the first pair of the outer object for whose name `wanted` is true. The line has passed [`check`].
#[small]
pub fn find(line: &[u8], wanted: impl Fn(&[u8]) -> bool) -> Option<Pair> {
    let mut cursor = Cursor { line, at: 0 };
    cursor.take(b'{');
    let (mut at, mut depth) = (cursor.at, 1u8);
    while depth > 0 {
        match pair(line, at) {
            Some(pair) if depth == 1 && wanted(pair.name.of(line)) => return Some(pair),
            Some(pair) => {
                depth += u8::from(pair.kind == Kind::Object);
                at = pair.next;
            }
            None => {
                depth -= 1;
                at = behind_object(line, at);
            }
        }
    }
    None
}

/// The pair at `at`, or `None` at the end of the object. The line has passed [`check`].
#[small]
pub fn pair(line: &[u8], at: u8) -> Option<Pair> {
    let mut cursor = Cursor { line, at };
    cursor.take(b',');
    cursor.pair()
}

/// Returns the position behind the brace that closes an object, the first brace at or behind `at`.
#[small]
pub fn behind_object(line: &[u8], at: u8) -> u8 {
    let mut cursor = Cursor { line, at };
    cursor.take(b'}');
    cursor.at
}

/// Whether the object ends at `at`, without another pair. The line has passed [`check`].
#[small]
pub fn is_last(line: &[u8], at: u8) -> bool {
    Cursor { line, at }.take(b'}')
}

/// Returns the index of the first byte of `line` that is not a blank.
#[small]
pub fn skip_blanks(line: &[u8]) -> u8 {
    let mut cursor = Cursor { line, at: 0 };
    cursor.blanks();
    cursor.at
}

/// The rest of `null`, `true` and `false`, after the first letter.
const ULL: u32 = u32::from_be_bytes(*b"\0ull");
const RUE: u32 = u32::from_be_bytes(*b"\0rue");
const ALSE: u32 = u32::from_be_bytes(*b"alse");

struct Cursor<'a> {
    line: &'a [u8],
    at: u8,
}

#[small]
impl Cursor<'_> {
    fn peek(&self) -> Option<u8> {
        self.line.get(usize::from(self.at)).copied()
    }

    fn next_if(&mut self, wanted: impl Fn(u8) -> bool) -> Option<u8> {
        let byte = self.peek().filter(|&b| wanted(b))?;
        self.at = self.at.checked_add(1)?;
        Some(byte)
    }

    fn blanks(&mut self) {
        while self.next_if(|b| matches!(b, b' ' | b'\t')).is_some() {}
    }

    fn take(&mut self, byte: u8) -> bool {
        self.blanks();
        self.next_if(|b| b == byte).is_some()
    }

    fn span(&mut self, wanted: impl Fn(u8) -> bool) -> Span {
        let start = self.at;
        while self.next_if(&wanted).is_some() {}
        Span { start, end: self.at }
    }

    /// Checks the object. `None` if it is malformed.
    fn object(&mut self) -> Option<Result<(), Status>> {
        let mut depth = u8::from(self.take(b'{'));
        let mut empty = true;
        while depth > 0 {
            if !(empty && self.take(b'}')) {
                let pair = self.pair()?;
                if pair.kind == Kind::Object {
                    depth += 1;
                    empty = true;
                    let is_set = Name::beginning(pair.name.of(self.line)).is(plain!("set"));
                    if depth > 2 + u8::from(is_set) {
                        return Some(Err(Status::JsonTooDeep));
                    }
                    continue;
                }
            } else {
                depth -= 1;
            }
            while depth > 0 && self.take(b'}') {
                depth -= 1;
            }
            if depth == 0 {
                self.blanks();
                return self.peek().is_none().then_some(Ok(()));
            }
            if !self.take(b',') {
                return None;
            }
            empty = false;
        }
        None
    }

    fn pair(&mut self) -> Option<Pair> {
        self.blanks();
        let name = match self.peek()? {
            b'"' => self.quoted().filter(|name| !name.of(self.line).contains(&b'\\'))?,
            _ => self.span(|b| b.is_ascii_graphic() && !is_punctuation(b)),
        };
        if name.start == name.end || name.end - name.start > LONGEST_NAME || !self.take(b':') {
            return None;
        }
        self.blanks();
        let (kind, value) = self.value()?;
        Some(Pair { name, kind, value, next: self.at })
    }

    fn value(&mut self) -> Option<(Kind, Span)> {
        match self.peek()?.to_ascii_lowercase() {
            b'"' => {
                let text = self.quoted()?;
                Some((if text.start == text.end { Kind::Null } else { Kind::Text }, text))
            }
            b'-' | b'0'..=b'9' => self.number().map(|span| (Kind::Number, span)),
            b'{' => {
                self.take(b'{');
                Some((Kind::Object, Span { start: self.at, end: self.at }))
            }
            letter => {
                // The last four letters after the first one, packed into 32 bits.
                let mut rest = 0u32;
                let span = self.span(|b| b.is_ascii_alphanumeric());
                for byte in span.of(self.line).iter().skip(1) {
                    rest = rest << 8 | u32::from(byte.to_ascii_lowercase());
                }
                let kind = match (letter, rest, span.end - span.start) {
                    (b'n', 0 | ULL, ..=4) => Kind::Null,
                    (b't', 0 | RUE, ..=4) => Kind::True,
                    (b'f', 0 | ALSE, ..=5) => Kind::False,
                    _ => return None,
                };
                Some((kind, span))
            }
        }
    }

    /// Reads a string of printable ASCII and escapes. Other bytes are removed by the framing or refused.
    fn quoted(&mut self) -> Option<Span> {
        self.next_if(|b| b == b'"')?;
        let start = self.at;
        loop {
            let end = self.at;
            match self.next_if(|b| matches!(b, b' '..=b'~' | b'\t'))? {
                b'"' => return Some(Span { start, end }),
                b'\\' => {
                    let letter = self.next_if(|b| matches!(b, b' '..=b'~'))?;
                    if letter == b'u' {
                        // Four digits belong to the escape. Further digits are plain characters.
                        let digits = self.span(|b| b.is_ascii_hexdigit());
                        (digits.end - digits.start >= 4).then_some(())?;
                    }
                }
                _ => {}
            }
        }
    }

    fn number(&mut self) -> Option<Span> {
        let start = self.at;
        self.next_if(|b| b == b'-');
        self.digits()?;
        if self.next_if(|b| b == b'.').is_some() {
            self.digits()?;
        }
        if self.next_if(|b| matches!(b, b'e' | b'E')).is_some() {
            self.next_if(|b| matches!(b, b'-' | b'+'));
            self.digits()?;
        }
        let short = self.at - start <= LONGEST_NUMBER;
        short.then_some(Span { start, end: self.at })
    }

    fn digits(&mut self) -> Option<()> {
        let digits = self.span(|b| b.is_ascii_digit());
        (digits.start != digits.end).then_some(())
    }
}

#[cfg(test)]
mod tests;
