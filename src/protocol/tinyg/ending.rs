//! The end of a response: what remains to be reported, and the footer. For a malformed line also the line itself.

use super::block::byte_of;
use super::json;
use super::remark::Remark;
use super::request::{Context, Phase, Request};
use super::write::Writer;
use crate::protocol::{Ending, Machine, Out, Value};
use crate::status::Status;
use crate::text;

impl Request {
    /// Whether only the footer is left to be written.
    pub(super) fn adds_nothing(&self) -> bool {
        !self.identified && self.status == Status::Ok && self.remark == Remark::None
    }

    /// Reports the `tid` of the line. A line that has failed may have it in a pair that was not reached.
    pub(super) fn warning<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        self.open(c);
        self.phase = Phase::Advice;
        let id = |name: &[u8]| name.eq_ignore_ascii_case(b"tid");
        if (self.identified || self.is_json && self.status != Status::Ok)
            && let Some(pair) = json::find(c.line, id)
        {
            self.tell_sent(&pair, true, c);
        }
    }

    pub(super) fn advice<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let text = self.remark.text();
        if !text.is_empty() {
            let mut writer = Writer::message(c.out, &mut self.format);
            writer.key_text(text!("msg"));
            writer.string(text);
        }
        self.phase = Phase::Footer;
    }

    pub(super) fn footer<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let ending = self.ending(c.machine);
        Writer::frame(c.out, &mut self.format).end_response(self.status, ending);
        self.phase = Phase::Done;
    }

    pub(super) fn ending(&self, machine: &mut impl Machine) -> Ending {
        Ending { free: machine.value(Value::SlotsFree) as u8, length: self.length }
    }

    pub(super) fn echo<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        self.open(c);
        let mut writer = Writer::message(c.out, &mut self.format);
        writer.key_text(text!("err"));
        writer.byte(b'"');
        self.phase = Phase::EchoText;
    }

    pub(super) fn echo_text<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let mut writer = Writer::message(c.out, &mut self.format);
        for _ in 0..super::CHUNK / 2 {
            let Some(byte) = byte_of(c.line, self.item, u8::MAX) else {
                writer.byte(b'"');
                self.phase = Phase::Warning;
                return;
            };
            writer.escaped(byte);
            self.item = self.item.saturating_add(1);
        }
    }
}
