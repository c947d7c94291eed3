//! Writes JSON and plain text, byte by byte, into an [`Out`].

use super::format::{COMMA, EXPAND, Format, HUSHED, MUTE, SILENT, STRICT, WRAPPED};
use super::token::Shown;
use super::variation::Variation;
use crate::config::{Digits, Fixed, Settings, hex};
use crate::plain;
use crate::progmem::{Plain, Text};
pub use crate::protocol::{Ending, Out};
use crate::status::Status;

/// Writes a line end.
pub fn put_line_end(settings: &Settings, out: &mut impl Out) {
    Writer::body(out, &mut Format::plain(settings)).end_line();
}

/// A writer, made for one step.
pub struct Writer<'a, O> {
    out: &'a mut O,
    format: &'a mut Format,
    shown: bool,
}

impl<'a, O: Out> Writer<'a, O> {
    /// Makes a writer for names and values, or for a report.
    pub fn body(out: &'a mut O, format: &'a mut Format) -> Self {
        Self::unless(HUSHED, out, format)
    }

    /// Makes a writer for messages, and for what a response reports of its line.
    pub fn message(out: &'a mut O, format: &'a mut Format) -> Self {
        Self::unless(MUTE, out, format)
    }

    /// Makes a writer for the frame of a response.
    pub fn frame(out: &'a mut O, format: &'a mut Format) -> Self {
        Self::unless(SILENT, out, format)
    }

    fn unless(hidden: u8, out: &'a mut O, format: &'a mut Format) -> Self {
        let shown = format.flags & hidden == 0;
        Writer { out, format, shown }
    }

    /// Returns whose phrases are used.
    pub fn variation(&self) -> Variation {
        self.format.variation
    }

    /// Whether output is text.
    pub fn is_plain(&self) -> bool {
        self.format.is_plain()
    }

    /// Writes a byte.
    pub fn byte(&mut self, byte: u8) {
        if !self.shown {
            return;
        }
        if self.format.flags & WRAPPED != 0 && matches!(byte, b'"' | b'\\') {
            self.out.put(b'\\');
        }
        self.out.put(byte);
    }

    /// Writes a line end.
    pub fn end_line(&mut self) {
        if !self.shown {
            return;
        }
        if self.format.flags & WRAPPED != 0 {
            return self.out.put_plain(plain!("\\n"));
        }
        let expand = self.format.flags & EXPAND != 0;
        self.out.put_plain(if expand { plain!("\n\r") } else { plain!("\n") });
    }

    /// Writes a received byte; one that is not printable as `?`.
    pub fn printable(&mut self, byte: u8) {
        self.byte(if matches!(byte, b' '..=b'~') { byte } else { b'?' });
    }

    /// Writes a received byte within a string. Takes at most two bytes of output.
    pub fn escaped(&mut self, byte: u8) {
        if matches!(byte, b'"' | b'\\') {
            self.byte(b'\\');
        }
        self.printable(byte);
    }

    /// Writes a text. Not inlined, because it is called in many places.
    #[inline(never)]
    #[small]
    pub fn text(&mut self, text: Text) {
        text.bytes().for_each(|byte| self.byte(byte));
    }

    /// Writes bytes in lower case, without escapes.
    pub fn lower(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.printable(byte.to_ascii_lowercase()));
    }

    /// Writes `count` blanks.
    pub fn blanks(&mut self, count: usize) {
        (0..count).for_each(|_| self.byte(b' '));
    }

    /// Writes a number.
    pub fn fixed(&mut self, fixed: Fixed) {
        let mut digits = Digits::default();
        let digits = fixed.render(&mut digits);
        if self.shown {
            // A number has no character that would need an escape.
            self.out.put_all(digits.iter().copied());
        }
    }

    /// Writes a number that ends in column `width`.
    pub fn aligned(&mut self, fixed: Fixed, width: usize) {
        let mut digits = Digits::default();
        let digits = fixed.render(&mut digits);
        self.blanks(width.saturating_sub(digits.len()));
        digits.iter().for_each(|&byte| self.byte(byte));
    }

    /// Begins a member of an object: a comma if one is due, the key, a colon.
    pub fn key(&mut self, name: &[u8]) {
        self.before_key();
        self.lower(name);
        self.after_key();
    }

    /// Begins a member whose key is a text of the firmware.
    pub fn key_text(&mut self, name: Text) {
        self.before_key();
        self.text(name);
        self.after_key();
    }

    fn before_key(&mut self) {
        if !self.shown {
            return;
        }
        if self.format.flags & COMMA != 0 {
            self.byte(b',');
        }
        self.format.flags |= COMMA;
        self.key_quote();
    }

    fn after_key(&mut self) {
        self.key_quote();
        self.byte(b':');
    }

    fn key_quote(&mut self) {
        if self.format.flags & STRICT != 0 {
            self.byte(b'"');
        }
    }

    /// Writes a text of the firmware as a string value.
    pub fn string(&mut self, text: Text) {
        self.byte(b'"');
        self.text(text);
        self.byte(b'"');
    }

    /// Writes the value of a token.
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

    /// Writes 32 bits as hexadecimal, such as `0x2a`.
    pub fn bits(&mut self, bits: i32) {
        hex(bits).iter().for_each(|byte| self.byte(*byte));
    }

    /// Opens an object.
    pub fn open(&mut self) {
        if self.shown {
            self.byte(b'{');
            self.format.flags &= !COMMA;
        }
    }

    /// Closes an object.
    pub fn close(&mut self) {
        if self.shown {
            self.byte(b'}');
            self.format.flags |= COMMA;
        }
    }

    /// Opens a response and its body.
    pub fn begin_response(&mut self) {
        self.begin_sum();
        self.frame_part(plain!("{\"r\":{"), plain!("{r:{"));
        self.format.flags &= !COMMA;
    }

    /// Closes the body of a response, and the response with its footer: `},"f":[1,status,free]}`. See [`Ending`].
    pub fn end_response(&mut self, status: Status, ending: Ending) {
        self.frame_part(plain!("},\"f\":[1,"), plain!("},f:[1,"));
        self.footer_values(status, ending);
    }

    /// Writes a whole response with an empty body.
    pub fn empty_response(&mut self, status: Status, ending: Ending) {
        self.begin_sum();
        self.frame_part(plain!("{\"r\":{},\"f\":[1,"), plain!("{r:{},f:[1,"));
        self.footer_values(status, ending);
    }

    /// Writes a part of the frame of a response at once. The frame is never within a string, so no byte needs an
    /// escape. On AVR this saves 100 cycles a byte compared with [`Writer::byte`].
    fn frame_part(&mut self, strict: Plain, relaxed: Plain) {
        if self.shown {
            self.out.put_plain(if self.format.flags & STRICT != 0 { strict } else { relaxed });
        }
    }

    fn begin_sum(&mut self) {
        if self.format.variation == Variation::Characters {
            self.out.begin_sum();
        }
    }

    fn footer_values(&mut self, status: Status, ending: Ending) {
        let variation = self.format.variation;
        self.small(variation.code(status).into());
        self.byte(b',');
        self.small(match variation {
            Variation::Lines => ending.free.into(),
            _ => ending.length.max(variation.phrases().no_line.into()),
        });
        if variation == Variation::Characters {
            let sum = self.out.take_sum();
            self.byte(b',');
            self.fixed(Fixed::int(sum.into()));
        }
        if self.shown {
            let expand = self.format.flags & EXPAND != 0;
            self.out.put_plain(if expand { plain!("]}\n\r") } else { plain!("]}\n") });
        }
    }

    /// Writes a number that usually has one digit.
    fn small(&mut self, value: u16) {
        match value {
            ..10 => self.byte(b'0' + value as u8),
            _ => self.fixed(Fixed::int(value.into())),
        }
    }
}

#[cfg(test)]
mod tests;
