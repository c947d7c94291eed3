//! Changes to the status report: `{srs:{set:{vel:t,posa:f}}}`, `{srs:{clear:t}}`, `{srs:{defa:t}}`.
//!
//! Each step handles one pair and reports it as it was sent. The first invalid pair is refused; the pairs before it
//! have taken effect.

use super::json::{self, Kind, Pair};
use super::request::{Context, Request};
use super::token::{Target, Token, resolve};
use super::write::Writer;
use crate::config::Name;
use crate::plain;
use crate::protocol::{Machine, Out, Remembers};
use crate::status::Status;

/// Whether an object with this name (`srs`) changes the report. An object named `sr` replaces the report.
#[small]
pub(super) fn is_amended(name: &[u8]) -> bool {
    name.len() > 2
}

#[small]
impl Request {
    /// Carries out one pair of the object. `selected` means that the pair is in the inner object `set`.
    #[inline(never)]
    pub(super) fn amend<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let Some(pair) = json::pair(c.line, self.at) else {
            self.at = json::behind_object(c.line, self.at);
            return self.amended(c);
        };
        self.at = pair.next;
        let name = Name::beginning(pair.name.of(c.line));
        if !self.selected && pair.kind == Kind::Object && name.is(plain!("set")) {
            let mut writer = Writer::body(c.out, &mut self.format);
            writer.key(name.bytes());
            writer.open();
            self.selected = true;
            return;
        }
        let done = match self.selected {
            true => change(&pair, c),
            false => reset(&name, &pair, c.machine),
        };
        self.tell_sent(&pair, done != Err(Status::UnrecognizedName), c);
        if let Err(status) = done {
            self.status = status;
            self.amended(c);
            if self.group.is_some() {
                self.leave(c);
            }
        }
    }

    /// Handles the end of an object.
    fn amended<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        match core::mem::take(&mut self.selected) {
            true => Writer::body(c.out, &mut self.format).close(),
            false => self.leave(c),
        }
    }
}

/// Carries out `clear` or `defa`.
#[small]
fn reset(name: &Name, pair: &Pair, machine: &mut impl Machine) -> Result<(), Status> {
    let clears = name.is(plain!("clear"));
    if !(clears || name.is(plain!("defa"))) {
        return Err(Status::UnrecognizedName);
    }
    match pair.kind {
        Kind::True if clears => machine.memory().tinyg.clear(),
        Kind::True => machine.memory().tinyg.restore(),
        Kind::False => {}
        _ => return Err(Status::UnsupportedType),
    }
    Ok(())
}

/// Returns the value of this name. An error says why it cannot be in the report.
#[inline(never)]
#[small]
pub(super) fn reported(name: &[u8]) -> Result<Token, Status> {
    match resolve(Name::new(), name) {
        Target::Token(token) if token.is_far() => Err(Status::CannotRead),
        Target::Token(token) => Ok(token),
        _ => Err(Status::UnrecognizedName),
    }
}

/// Adds a value to the report, or removes it.
#[small]
fn change<M: Machine, O>(pair: &Pair, c: &mut Context<'_, M, O>) -> Result<(), Status> {
    let token = reported(pair.name.of(c.line))?;
    match pair.kind {
        Kind::True if !c.machine.memory().tinyg.add(token) => Err(Status::JsonTooManyPairs),
        Kind::True => Ok(()),
        Kind::False => {
            c.machine.memory().tinyg.remove(token);
            Ok(())
        }
        _ => Err(Status::UnsupportedType),
    }
}
