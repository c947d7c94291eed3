//! What comes and goes in strings: `txt`, of which what text mode would say is told in a string, and `msg`.
//!
//! A `txt` holds what a line of text mode does: `{txt:"$xvm"}` is answered with
//! `{"r":{"txt":"[xvm] x velocity maximum        800 mm/min\\n"},"f":[...]}`. There are no prompts in it; the status is the
//! line's. G-code has nothing to say there. JSON within JSON is refused (114). A g2core has no text mode that a line could
//! switch to: there `$xvm` alone is answered like this, with one response.

use super::block::byte_of;
use super::json::{Kind, Pair};
use super::request::{Context, Phase, Request};
use super::token::Group;
use super::write::Writer;
use super::{CHUNK, help};
use crate::protocol::{Machine, Out, Span};
use crate::status::Status;
use crate::text;

#[small]
impl Request {
    /// Does what the line says, as if it stood in a `txt`.
    pub(super) fn wrap_line<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let value = core::mem::take(&mut self.block);
        let next = value.end.saturating_add(1);
        let pair = Pair { name: Span::default(), kind: Kind::Text, value, next };
        if let Err(status) = self.wrap(&pair, c) {
            self.status = status;
            self.phase = Phase::Warning;
        }
    }

    /// Does what the text of `pair` says.
    #[inline(never)]
    pub(super) fn wrap<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        c: &mut Context<'_, M, O>,
    ) -> Result<(), Status> {
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

    /// The text is at its end.
    pub(super) fn unwrap_text<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        self.format.wrap(false);
        Writer::body(c.out, &mut self.format).byte(b'"');
        self.at = core::mem::take(&mut self.resume);
        let on = self.status == Status::Ok;
        self.phase = if on { Phase::Pair } else { Phase::Warning };
    }

    /// A block in a `txt` has run.
    pub(super) fn unwrap_block<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        if core::mem::take(&mut self.resume) != 0 {
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

    /// Gives the string of `pair` back.
    pub(super) fn give_string<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        c: &mut Context<'_, M, O>,
    ) {
        self.open_string(pair, c);
        self.block = pair.value;
        self.phase = Phase::Quote;
    }

    /// The next part of it, as it came.
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

/// Puts a character of a string of the request into one of the response; returns how many bytes it was. An escape of JSON
/// stays as it is; any other backslash is a character. At most two bytes come out.
#[small]
pub(super) fn pass_on<O: Out>(line: &[u8], at: u8, end: u8, writer: &mut Writer<'_, O>) -> u8 {
    let byte = byte_of(line, at, end).unwrap_or(b' ');
    let next = byte_of(line, at.saturating_add(1), end);
    match (byte, next) {
        // Digits follow a `u`: `json::check` has seen to it.
        (b'\\', Some(letter @ (b'"' | b'\\' | b'/' | b'b' | b'f' | b'n' | b'r' | b't' | b'u'))) => {
            writer.byte(byte);
            writer.byte(letter);
            2
        }
        // A tabulator may stand in a request, not in a response.
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
