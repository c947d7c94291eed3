//! The pairs of a JSON line: carries them out one by one, and reports the result of each.

use super::Format;
use super::amend::{is_amended, reported};
use super::json::{self, Kind, Pair};
use super::notice::put_exception;
use super::request::{Context, Phase, Request};
use super::token::{Group, Operation, Target, Token, resolve};
use super::write::Writer;
use crate::config::Name;
#[cfg(feature = "sd")]
use crate::protocol::files::Files;
use crate::protocol::{Machine, Out};
use crate::status::Status;
use crate::text;

/// The result of a pair: a token whose value is to be reported, `None` to report the pair as sent, or a status.
pub(super) type Outcome = Result<Option<Token>, Status>;

#[small]
impl Request {
    #[inline(never)]
    pub(super) fn pair<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let Some(pair) = json::pair(c.line, self.at) else {
            self.phase = Phase::Warning;
            return;
        };
        let target = resolve(Name::new(), pair.name.of(c.line));
        match (target, pair.kind) {
            (Target::Group(group), Kind::Null) => self.enter(group, &pair, Phase::List, c),
            (Target::Group(Group::Report), Kind::Object) if is_amended(pair.name.of(c.line)) => {
                self.enter(Group::Report, &pair, Phase::Amend, c);
            }
            (Target::Group(Group::Report), Kind::Object) => {
                self.enter(Group::Report, &pair, Phase::Select, c);
                self.item = pair.next;
                self.selected = false;
            }
            (Target::Group(group), Kind::Object) => self.enter(group, &pair, Phase::Member, c),
            (Target::Operation(Operation::Block), Kind::Text) if !self.begun => {
                self.block = pair.value;
                self.phase = Phase::Gcode;
            }
            (Target::Operation(Operation::Program), Kind::Null) => self.show_program(&pair, c),
            #[cfg(feature = "sd")]
            (Target::Operation(Operation::Files(Files::List)), Kind::Null) => {
                match self.show_files(&pair, c) {
                    Ok(()) => {}
                    Err(Status::Again) => {
                        self.waits = true;
                        return;
                    }
                    Err(status) => {
                        self.at = pair.next;
                        self.open(c);
                        return self.refuse_pair(&pair, target, status, c);
                    }
                }
            }
            (Target::Operation(Operation::Text), Kind::Text) => {
                self.at = pair.next;
                let Err(status) = self.wrap(&pair, c) else { return };
                self.open(c);
                self.refuse_pair(&pair, target, status, c);
            }
            (Target::Operation(Operation::Message), Kind::Text) => self.give_string(&pair, c),
            // The `tid` is reported at the end, so that a block may still run.
            (Target::Operation(Operation::Id), Kind::Number | Kind::Null) => self.identified = true,
            (Target::Operation(Operation::Id), _) => {
                self.status = Status::UnsupportedType;
                self.phase = Phase::Warning;
            }
            (Target::Operation(Operation::Exception), _) if !self.begun => {
                self.format = Format::json(c.machine.settings());
                self.block = pair.name;
                self.item = 0;
                self.phase = Phase::Raise;
            }
            // `carry_out` moves on by itself, because a pair may have to wait.
            _ => return self.carry_out(&pair, target, c),
        }
        self.at = pair.next;
    }

    /// Writes a part of an exception report that was asked for. Begins the response after the last part.
    pub(super) fn raise<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let (stage, status) = (self.item, Status::ExceptionReport);
        self.item += 1;
        let mut writer = Writer::body(c.out, &mut self.format);
        if !put_exception(stage, status, c.machine, &mut writer) {
            self.open(c);
            let mut writer = Writer::body(c.out, &mut self.format);
            writer.key(self.block.of(c.line));
            writer.text(text!("null"));
            self.status = status;
            self.phase = Phase::Warning;
        }
    }

    fn enter<M: Machine, O: Out>(
        &mut self,
        group: Group,
        pair: &Pair,
        phase: Phase,
        c: &mut Context<'_, M, O>,
    ) {
        self.open(c);
        let mut writer = Writer::body(c.out, &mut self.format);
        writer.key(pair.name.of(c.line));
        writer.open();
        self.group = Some(group);
        self.item = 0;
        self.phase = phase;
    }

    pub(super) fn leave<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        if self.group.take().is_some() {
            Writer::body(c.out, &mut self.format).close();
        }
        let on = matches!(self.status, Status::Ok | Status::Initializing);
        self.phase = if on { Phase::Pair } else { Phase::Warning };
    }

    #[inline(never)]
    pub(super) fn member<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let Some(pair) = json::pair(c.line, self.at) else {
            self.at = json::behind_object(c.line, self.at);
            return self.leave(c);
        };
        let prefix = self.group.map_or(Name::new(), Group::prefix);
        let target = match resolve(prefix, pair.name.of(c.line)) {
            // A group contains neither groups nor strings.
            Target::Group(_) => Target::Unknown,
            Target::Operation(
                Operation::Block | Operation::Text | Operation::Message | Operation::Id,
            ) => Target::Unknown,
            target => target,
        };
        self.carry_out(&pair, target, c);
    }

    /// Writes one member of the group, in order.
    #[inline(never)]
    pub(super) fn list<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let member =
            self.group.and_then(|group| Some((group, group.member(self.item, c.machine)?)));
        let Some((group, (index, token))) = member else {
            return self.leave(c);
        };
        c.machine.moment(self.item == 0);
        self.item = index + 1;
        let shown = token.read(c.machine);
        let (name, prefix) = (token.name(), group.prefix().bytes().len());
        let mut writer = Writer::body(c.out, &mut self.format);
        writer.key(name.bytes().get(prefix..).unwrap_or(&[]));
        writer.shown(shown);
    }

    /// Selects one entry of a new status report. Names that cannot be reported are skipped. A report without any
    /// entry is refused.
    #[inline(never)]
    pub(super) fn select<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let Some(pair) = json::pair(c.line, self.at) else {
            self.at = json::behind_object(c.line, self.at);
            return self.selected(c);
        };
        self.at = pair.next;
        if pair.kind == Kind::Object {
            self.status = Status::UnsupportedType;
            return self.leave(c);
        }
        let Ok(token) = reported(pair.name.of(c.line)) else { return };
        if pair.kind != Kind::True {
            return;
        }
        let report = &mut c.machine.memory().tinyg;
        if !core::mem::replace(&mut self.selected, true) {
            report.clear();
        }
        if !report.add(token) {
            self.status = Status::JsonTooManyPairs;
        }
    }

    /// Lists the new report, or reports why there is none.
    fn selected<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        if self.selected {
            self.item = 0;
            self.phase = Phase::List;
            return;
        }
        self.status = Status::MalformedCommand;
        if let Some(first) = json::pair(c.line, self.item) {
            let found = reported(first.name.of(c.line));
            self.status = found.err().unwrap_or(Status::UnrecognizedName);
            let known = found != Err(Status::UnrecognizedName);
            self.tell_sent(&first, known, c);
        }
        self.leave(c);
    }

    #[inline(never)]
    fn carry_out<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        target: Target,
        c: &mut Context<'_, M, O>,
    ) {
        let outcome = self.apply(pair, target, c);
        if outcome == Err(Status::Again) {
            // The pair is repeated from its beginning later.
            self.waits = true;
            return;
        }
        self.at = pair.next;
        self.open(c);
        match outcome {
            Ok(Some(token)) => {
                let shown = token.read(c.machine);
                let mut writer = Writer::body(c.out, &mut self.format);
                writer.key(pair.name.of(c.line));
                writer.shown(shown);
                // A short request is answered in one step: each step costs 700 cycles, and may have to wait for
                // motion.
                if self.phase == Phase::Pair
                    && self.adds_nothing()
                    && json::is_last(c.line, self.at)
                {
                    self.footer(c);
                }
            }
            Ok(None) if self.phase == Phase::Greeting => {}
            Ok(None) => self.tell_sent(pair, true, c),
            Err(status) => self.refuse_pair(pair, target, status, c),
        }
    }

    fn refuse_pair<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        target: Target,
        status: Status,
        c: &mut Context<'_, M, O>,
    ) {
        self.status = status;
        self.tell_sent(pair, target != Target::Unknown, c);
        self.leave(c);
    }

    /// Reports a pair as it was sent; as null if its name is unknown, or its value a string.
    pub(super) fn tell_sent<M, O: Out>(
        &mut self,
        pair: &Pair,
        known: bool,
        c: &mut Context<'_, M, O>,
    ) {
        let mut writer = Writer::body(c.out, &mut self.format);
        writer.key(pair.name.of(c.line));
        match pair.kind {
            Kind::True if known => writer.text(text!("true")),
            Kind::False if known => writer.text(text!("false")),
            Kind::Number if known => writer.lower(plain_number(pair.value.of(c.line))),
            _ => writer.text(text!("null")),
        }
    }
}

/// Returns a number without the leading zeros that JSON forbids.
#[small]
fn plain_number(mut text: &[u8]) -> &[u8] {
    while let [b'0', rest @ ..] = text
        && matches!(rest, [b'0'..=b'9', ..])
    {
        text = rest;
    }
    text
}
