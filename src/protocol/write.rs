//! Writing JSON and plain text, byte by byte, into an [`Out`].

use super::token::Shown;
use crate::config::{Digits, Fixed};
use crate::progmem::Text;
use crate::text;

/// Where output goes. One step of a [`Request`](super::Request) or a report puts at most
/// [`CHUNK`](super::CHUNK) bytes.
pub trait Out {
    /// Takes one byte.
    fn put(&mut self, byte: u8);

    /// Takes a text.
    fn put_text(&mut self, text: Text) {
        self.put_all(text.bytes());
    }

    /// Takes several.
    fn put_all(&mut self, bytes: impl Iterator<Item = u8>) {
        bytes.for_each(|byte| self.put(byte));
    }
}

/// How to write, and where in an object we are. Kept from step to step.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Format(u8);

const STRICT: u8 = 1;
const COMMA: u8 = 2;
const PLAIN: u8 = 4;
const HUSHED: u8 = 8;
const SILENT: u8 = 16;

impl Format {
    /// JSON, with quoted keys if `strict`.
    pub fn json(strict: bool) -> Format {
        Format(if strict { STRICT } else { 0 })
    }

    /// JSON of which the verbosity `jv` lets through: 0 nothing, 1 no bodies, else all.
    pub fn response(strict: bool, jv: u8) -> Format {
        let hidden = match jv {
            0 => SILENT | HUSHED,
            1 => HUSHED,
            _ => 0,
        };
        Format(Format::json(strict).0 | hidden)
    }

    /// Text: `key:value,key:value`.
    pub fn plain() -> Format {
        Format(PLAIN)
    }

    /// Whether it is text.
    pub fn is_plain(self) -> bool {
        self.0 & PLAIN != 0
    }
}

/// A writer for the time of one step.
pub struct Writer<'a, O> {
    out: &'a mut O,
    format: &'a mut Format,
    hidden: u8,
}

impl<'a, O: Out> Writer<'a, O> {
    /// Writes what belongs to the body of a response, or a report.
    pub fn body(out: &'a mut O, format: &'a mut Format) -> Self {
        Writer { out, format, hidden: HUSHED }
    }

    /// Writes the frame of a response, which shows while bodies do not.
    pub fn frame(out: &'a mut O, format: &'a mut Format) -> Self {
        Writer { out, format, hidden: SILENT }
    }

    /// Whether this is text.
    pub fn is_plain(&self) -> bool {
        self.format.is_plain()
    }

    /// One byte.
    pub fn byte(&mut self, byte: u8) {
        if self.format.0 & self.hidden == 0 {
            self.out.put(byte);
        }
    }

    /// One byte of somebody else's text; what does not print becomes `?`.
    pub fn printable(&mut self, byte: u8) {
        self.byte(if matches!(byte, b' '..=b'~') { byte } else { b'?' });
    }

    /// One byte of somebody else's text within a string. At most two bytes come out.
    pub fn escaped(&mut self, byte: u8) {
        if matches!(byte, b'"' | b'\\') {
            self.byte(b'\\');
        }
        self.printable(byte);
    }

    /// A text.
    pub fn text(&mut self, text: Text) {
        if self.format.0 & self.hidden == 0 {
            self.out.put_text(text);
        }
    }

    /// Bytes as they are, in lower case.
    pub fn lower(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.printable(byte.to_ascii_lowercase()));
    }

    /// A blank, `count` times.
    pub fn blanks(&mut self, count: usize) {
        (0..count).for_each(|_| self.byte(b' '));
    }

    /// A number.
    pub fn fixed(&mut self, fixed: Fixed) {
        let mut digits = Digits::default();
        fixed.render(&mut digits).iter().for_each(|&byte| self.byte(byte));
    }

    /// A number, ending in column `width`.
    pub fn aligned(&mut self, fixed: Fixed, width: usize) {
        let mut digits = Digits::default();
        let digits = fixed.render(&mut digits);
        self.blanks(width.saturating_sub(digits.len()));
        digits.iter().for_each(|&byte| self.byte(byte));
    }

    /// Begins a member: a comma if one is due, the key, a colon.
    pub fn key(&mut self, name: &[u8]) {
        self.before_key();
        self.lower(name);
        self.after_key();
    }

    /// The same with a key of ours.
    pub fn key_text(&mut self, name: Text) {
        self.before_key();
        self.text(name);
        self.after_key();
    }

    fn before_key(&mut self) {
        if self.format.0 & COMMA != 0 {
            self.byte(b',');
        }
        self.format.0 |= COMMA;
        self.key_quote();
    }

    fn after_key(&mut self) {
        self.key_quote();
        self.byte(b':');
    }

    fn key_quote(&mut self) {
        if self.format.0 & STRICT != 0 {
            self.byte(b'"');
        }
    }

    /// A string of ours as a value.
    pub fn string(&mut self, text: Text) {
        self.byte(b'"');
        self.text(text);
        self.byte(b'"');
    }

    /// A token's value.
    pub fn shown(&mut self, shown: Shown) {
        match shown {
            Shown::Number(fixed) => self.fixed(fixed),
            Shown::Text(text) => self.string(text),
            Shown::Data(bits) => {
                self.byte(b'"');
                self.bits(bits);
                self.byte(b'"');
            }
        }
    }

    /// 32 bits: `0x2a`.
    pub fn bits(&mut self, bits: i32) {
        self.text(text!("0x"));
        let mut begun = false;
        for place in (0..8).rev() {
            let digit = (bits >> (4 * place)) as u8 & 15;
            begun |= digit != 0 || place == 0;
            if begun {
                self.byte(if digit < 10 { b'0' + digit } else { b'a' - 10 + digit });
            }
        }
    }

    /// Opens an object.
    pub fn open(&mut self) {
        self.byte(b'{');
        self.format.0 &= !COMMA;
    }

    /// Closes an object.
    pub fn close(&mut self) {
        self.byte(b'}');
        self.format.0 |= COMMA;
    }

    /// The footer of a response and its end: `,"f":[1,status,free]}`.
    pub fn footer(&mut self, status: u8, free: i32) {
        self.key_text(text!("f"));
        self.text(text!("[1,"));
        self.footer_values(status, free);
    }

    /// A whole response of which nothing but the frame shows.
    pub fn empty_response(&mut self, status: u8, free: i32) {
        let strict = self.format.0 & STRICT != 0;
        self.text(if strict { text!("{\"r\":{},\"f\":[1,") } else { text!("{r:{},f:[1,") });
        self.footer_values(status, free);
    }

    fn footer_values(&mut self, status: u8, free: i32) {
        self.small(status);
        self.byte(b',');
        self.small(free as u8);
        self.text(text!("]}\n"));
    }

    /// A number, which most often has one digit.
    fn small(&mut self, value: u8) {
        match value {
            ..10 => self.byte(b'0' + value),
            _ => self.fixed(Fixed::int(value.into())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    impl Out for Vec<u8> {
        fn put(&mut self, byte: u8) {
            self.push(byte);
        }
    }

    fn written(mut format: Format, body: bool) -> Vec<u8> {
        let mut out = Vec::new();
        let mut writer = if body {
            Writer::body(&mut out, &mut format)
        } else {
            Writer::frame(&mut out, &mut format)
        };
        writer.open();
        writer.key(b"R");
        writer.open();
        writer.key_text(text!("a"));
        writer.fixed(Fixed { value: -1500, decimals: 3 });
        writer.key(b"b");
        writer.string(text!("c"));
        writer.close();
        writer.footer(3, 7);
        out
    }

    #[test]
    fn writes_json() {
        let expected = br#"{"r":{"a":-1.500,"b":"c"},"f":[1,3,7]}"#;
        assert_eq!(written(Format::json(true), true), [&expected[..], b"\n"].concat());
        let relaxed = br#"{r:{a:-1.500,b:"c"},f:[1,3,7]}"#;
        assert_eq!(written(Format::json(false), true), [&relaxed[..], b"\n"].concat());
    }

    #[test]
    fn an_empty_response_is_what_its_parts_are() {
        for (strict, status, free) in [(true, 0, 8), (false, 255, 0), (true, 13, 7), (true, 101, 3)]
        {
            let (mut parts, mut whole) = (Vec::new(), Vec::new());
            let mut format = Format::response(strict, 1);
            let mut writer = Writer::frame(&mut parts, &mut format);
            writer.open();
            writer.key_text(text!("r"));
            writer.open();
            writer.close();
            writer.footer(status, free);
            let mut format = Format::response(strict, 1);
            Writer::frame(&mut whole, &mut format).empty_response(status, free);
            assert_eq!(parts, whole);
        }
    }

    #[test]
    fn verbosity_hides() {
        assert_eq!(written(Format::response(true, 0), false), b"");
        assert_eq!(written(Format::response(true, 1), true), b"");
        assert!(!written(Format::response(true, 1), false).is_empty());
        assert!(!written(Format::response(true, 2), true).is_empty());
    }

    #[test]
    fn foreign_text_is_escaped() {
        let mut out = Vec::new();
        let mut format = Format::json(true);
        let mut writer = Writer::body(&mut out, &mut format);
        b"a\"\\\n\xff".iter().for_each(|&b| writer.escaped(b));
        assert_eq!(out, br#"a\"\\??"#);
    }
}
