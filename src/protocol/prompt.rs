//! Text mode: the prompt that answers a line.

use super::block::byte_of;
use super::machine::Machine;
use super::request::{Context, Phase, Request};
use super::status_text::status_text;
use super::write::{Out, Writer};
use crate::config::Fixed;
use crate::status::Status;
use crate::text;

impl Request {
    /// `tinyg [mm] ok> `, or the beginning of `tinyg [mm] err: <text>: <line> `.
    pub(super) fn prompt<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        if c.machine.settings().text_verbosity() == 0 {
            self.phase = Phase::Done;
            return;
        }
        let ok = matches!(self.status, Status::Ok | Status::Noop);
        let units = if c.machine.inches() { text!("inch") } else { text!("mm") };
        let mut writer = Writer::body(c.out, &mut self.format);
        writer.text(text!("tinyg ["));
        writer.text(units);
        writer.text(if ok { text!("] ok> ") } else { text!("] err: ") });
        self.phase = if ok { Phase::Message } else { Phase::Failure };
    }

    pub(super) fn failure<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let mut writer = Writer::body(c.out, &mut self.format);
        match status_text(self.status) {
            Some(text) => writer.text(text),
            None => writer.fixed(Fixed::int((self.status as u8).into())),
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
