//! Text mode: the prompt, which answers a line.

use super::Format;
use super::block::byte_of;
use super::request::{Context, Phase, Request};
use super::write::Writer;
use crate::config::Fixed;
use crate::protocol::{Machine, Out};
use crate::status::Status;
use crate::text;

#[small]
impl Request {
    /// Writes `tinyg [mm] ok> `, or the beginning of `tinyg [mm] err: <text>: <line> `.
    pub(super) fn prompt<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        if self.resume != 0 {
            return self.unwrap_text(c);
        }
        if c.machine.settings().text_verbosity() == 0 {
            self.phase = Phase::Done;
            return;
        }
        let ok = matches!(self.status, Status::Ok | Status::Noop | Status::BootLoader);
        put_prompt(ok, c.machine, &mut Writer::body(c.out, &mut self.format));
        self.phase = if ok { Phase::Message } else { Phase::Failure };
    }

    pub(super) fn failure<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let mut writer = Writer::body(c.out, &mut self.format);
        let variation = writer.variation();
        let (phrases, code) = (variation.phrases(), Fixed::int(variation.code(self.status).into()));
        if !phrases.code.is_empty() {
            writer.fixed(code);
            writer.text(phrases.code);
        }
        match variation.status_text(self.status) {
            Some(text) => writer.text(text),
            None => writer.fixed(code),
        }
        writer.text(text!(": "));
        self.item = 0;
        self.phase = Phase::Complaint;
    }

    pub(super) fn complaint<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let mut writer = Writer::body(c.out, &mut self.format);
        for _ in 0..super::CHUNK / 2 {
            let Some(byte) = byte_of(c.line, self.item, u8::MAX) else {
                writer.byte(b' ');
                self.phase = Phase::Message;
                return;
            };
            writer.printable(byte);
            self.item = self.item.saturating_add(1);
        }
    }
}

#[small]
fn put_prompt<O: Out>(ok: bool, machine: &mut impl Machine, writer: &mut Writer<'_, O>) {
    let phrases = writer.variation().phrases();
    writer.text(phrases.prompt);
    writer.text(if machine.inches() { text!("inch") } else { text!("mm") });
    writer.text(if ok { phrases.ok } else { phrases.err });
}

/// Writes the prompt of a machine that has started in text mode.
#[small]
pub fn put_ready_prompt(machine: &mut impl Machine, out: &mut impl Out) {
    if machine.settings().text_verbosity() != 0 {
        let mut format = Format::plain(machine.settings());
        let mut writer = Writer::body(out, &mut format);
        put_prompt(true, machine, &mut writer);
        writer.end_line();
    }
}
