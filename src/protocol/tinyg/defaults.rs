//! Operations that need a confirmation. Restoring the defaults is answered with the identity of the firmware, status
//! 15 and a message; entering the boot loader with status 16.

use super::json::{Kind, Pair};
use super::notice::{BANNER_ROWS, put_row};
use super::pairs::Outcome;
use super::remark::Remark;
use super::request::{Context, Phase, Request};
use super::write::Writer;
use crate::config::Number;
use crate::protocol::{Machine, Out};
use crate::status::Status;

#[small]
impl Request {
    /// Restores the defaults if the value of `pair` confirms it; otherwise tells how to do it.
    pub(super) fn restore<M: Machine, O>(
        &mut self,
        pair: &Pair,
        c: &mut Context<'_, M, O>,
    ) -> Outcome {
        if !is_sure(pair, c)? {
            return self.advise(Remark::AskDefaults);
        }
        // The answer is the identity of the firmware, so nothing may have been written before.
        let status = if self.begun { Status::NotAccepted } else { c.machine.restore(false) };
        if status != Status::Ok {
            return Err(status);
        }
        self.status = Status::Initializing;
        self.remark = Remark::Defaults;
        self.item = 0;
        self.phase = Phase::Greeting;
        Ok(None)
    }

    /// Restarts the machine in its boot loader if the value of `pair` confirms it; otherwise tells how to do it.
    pub(super) fn boot<M: Machine, O>(
        &mut self,
        pair: &Pair,
        c: &mut Context<'_, M, O>,
    ) -> Outcome {
        if !is_sure(pair, c)? {
            return self.advise(Remark::AskBoot);
        }
        match c.machine.restart(true) {
            Status::Ok => {
                self.remark = Remark::Boot;
                Err(Status::BootLoader)
            }
            status => Err(status),
        }
    }

    /// Makes the response give a hint.
    pub(super) fn advise(&mut self, remark: Remark) -> Outcome {
        self.remark = self.remark.max(remark);
        Ok(None)
    }

    /// Writes one row of the firmware's identity.
    pub(super) fn greeting<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        put_row(self.item, c.machine, &mut Writer::body(c.out, &mut self.format));
        self.item += 1;
        if self.item == BANNER_ROWS {
            self.item = 0;
            self.phase = Phase::Pair;
        }
    }
}

/// Whether the value of a pair confirms an operation.
#[small]
pub(super) fn is_sure<M, O>(pair: &Pair, c: &Context<'_, M, O>) -> Result<bool, Status> {
    match pair.kind {
        Kind::True => Ok(true),
        Kind::Number => {
            let number = Number::parse(pair.value.of(c.line)).ok_or(Status::BadNumber)?;
            Ok(number.fixed(0, false) != Some(0))
        }
        Kind::Null | Kind::False => Ok(false),
        Kind::Text | Kind::Object => Err(Status::UnsupportedType),
    }
}
