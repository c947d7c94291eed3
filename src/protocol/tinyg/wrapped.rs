//! Strings in requests and responses: `txt`, whose text-mode output is returned in a string, and `msg`.
//!
//! A `txt` holds a line of text mode: `{txt:"$xvm"}` is answered with `{"r":{"txt":"[xvm] x velocity maximum  800
//! mm/min\\n"},"f":[...]}`. The string has no prompts; the status in the footer is that of the line. G-code returns
//! an empty string. JSON within JSON is refused (114). A g2core has no text mode to switch to: there a plain `$xvm`
//! is answered in this form, with one response.

use super::block::byte_of;
use super::json::{Kind, Pair};
use super::request::{Context, Phase, Request};
use super::token::Group;
use super::write::Writer;
use super::{CHUNK, help};
use crate::capability::Capability;
use crate::protocol::{Machine, Out, Span};
use crate::status::Status;
use crate::text;

#[small]
impl Request {
    /// Carries out the line as if it stood in a `txt`.
    pub(super) fn wrap_line<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let value = core::mem::take(&mut self.block);
        let next = value.end.saturating_add(1);
        let pair = Pair { name: Span::default(), kind: Kind::Text, value, next };
        if let Err(status) = self.wrap(&pair, c) {
            self.status = status;
            self.phase = Phase::Warning;
        }
    }

    /// Carries out the text of `pair`. The error is the status with which it is refused.
    #[inline(never)]
    pub(super) fn wrap<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        c: &mut Context<'_, M, O>,
    ) -> Result<(), Status> {
        Capability::Text.check()?;
        let text = pair.value.of(c.line);
        let blanks = text.iter().take_while(|byte| matches!(byte, b' ' | b'\t')).count() as u8;
        let start = pair.value.start + blanks;
        match c.line.get(usize::from(start)) {
            Some(b'{') => return Err(Status::TextNested),
            Some(b'$') => {
                self.at = start + 1;
                self.phase = Phase::Command;
            }
            Some(b'?') if text.trim_ascii().len() > 1 => return Err(Status::MalformedCommand),
            Some(b'?') => self.enlist(Some(Group::Report), None),
            _ if help::asks_help(text) => self.help(help::GENERAL),
            _ if self.begun => return Err(Status::NotAccepted),
            _ => {
                self.block = pair.value;
                self.phase = Phase::Gcode;
                self.resume = pair.next;
                return Ok(());
            }
        }
        self.resume = pair.next;
        self.open(c);
        let mut writer = Writer::body(c.out, &mut self.format);
        writer.key_text(text!("txt"));
        writer.byte(b'"');
        self.format.wrap(true);
        Ok(())
    }

    /// Ends the string after its text.
    pub(super) fn unwrap_text<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        self.format.wrap(false);
        Writer::body(c.out, &mut self.format).byte(b'"');
        self.at = core::mem::take(&mut self.resume);
        let on = self.status == Status::Ok;
        self.phase = if on { Phase::Pair } else { Phase::Warning };
    }

    /// Reports an empty `txt` after the block in a `txt` has run.
    pub(super) fn unwrap_block<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        if Capability::Text.is_built_in() && core::mem::take(&mut self.resume) != 0 {
            let mut writer = Writer::body(c.out, &mut self.format);
            writer.key_text(text!("txt"));
            writer.text(text!("\"\""));
        }
    }

    /// Begins a string as the value of a pair.
    pub(super) fn open_string<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        c: &mut Context<'_, M, O>,
    ) {
        self.open(c);
        let mut writer = Writer::body(c.out, &mut self.format);
        writer.key(pair.name.of(c.line));
        writer.byte(b'"');
    }

    /// Starts to send the string of `pair` back.
    pub(super) fn give_string<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        c: &mut Context<'_, M, O>,
    ) {
        self.open_string(pair, c);
        self.block = pair.value;
        self.phase = Phase::Quote;
    }

    /// Writes the next part of the string, as received.
    pub(super) fn quote<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let mut writer = Writer::body(c.out, &mut self.format);
        for _ in 0..CHUNK / 2 {
            if byte_of(c.line, self.block.start, self.block.end).is_none() {
                writer.byte(b'"');
                self.block = Span::default();
                self.phase = Phase::Pair;
                return;
            }
            self.block.start += pass_on(c.line, self.block.start, self.block.end, &mut writer);
        }
    }
}

/// Copies one character of a string from the request to the response, and returns its length in the request. An
/// escape of JSON is kept; any other backslash is a plain character. Writes at most two bytes.
#[small]
pub(super) fn pass_on<O: Out>(line: &[u8], at: u8, end: u8, writer: &mut Writer<'_, O>) -> u8 {
    let byte = byte_of(line, at, end).unwrap_or(b' ');
    let next = byte_of(line, at.saturating_add(1), end);
    match (byte, next) {
        // After a `u` there are digits: `json::check` has made sure.
        (b'\\', Some(letter @ (b'"' | b'\\' | b'/' | b'b' | b'f' | b'n' | b'r' | b't' | b'u'))) => {
            writer.byte(byte);
            writer.byte(letter);
            2
        }
        // A tab is allowed in a request but not in a response.
        (b'\t', _) => {
            writer.byte(b' ');
            1
        }
        _ => {
            writer.escaped(byte);
            1
        }
    }
}
