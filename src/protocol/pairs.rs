//! Names and values of a JSON line: reading, setting, doing, and telling the result.

use super::json::{self, Kind, Pair};
use super::machine::{Machine, Warning};
use super::request::{Context, Phase, Request};
use super::token::{Action, Group, Target, Token, resolve};
use super::write::{Out, Writer};
use crate::config::table;
use crate::config::{Name, Number, Setting};
use crate::status::Status;
use crate::text;

/// What to tell of a pair that was carried out.
pub(super) type Outcome = Result<Option<Token>, Status>;

impl Request {
    pub(super) fn pair<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let Some(pair) = json::pair(c.line, self.at) else {
            self.phase = Phase::Warning;
            return;
        };
        self.at = pair.next;
        let target = resolve(Name::new(), pair.name.of(c.line));
        match (target, pair.kind) {
            (Target::Group(group), Kind::Null) => self.enter(group, &pair, Phase::List, c),
            (Target::Group(Group::Report), Kind::Object) => {
                self.enter(Group::Report, &pair, Phase::Select, c);
                self.item = pair.next;
                self.selected = false;
            }
            (Target::Group(group), Kind::Object) => self.enter(group, &pair, Phase::Member, c),
            (Target::Action(Action::Block), Kind::Text) if !self.begun => {
                self.block = pair.value;
                self.phase = Phase::Gcode;
            }
            _ => self.carry_out(&pair, target, c),
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

    fn leave<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        if self.group.take().is_some() {
            Writer::body(c.out, &mut self.format).close();
        }
        let on = matches!(self.status, Status::Ok | Status::Initializing);
        self.phase = if on { Phase::Pair } else { Phase::Warning };
    }

    pub(super) fn member<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let Some(pair) = json::pair(c.line, self.at) else {
            self.at = json::behind_object(c.line, self.at);
            return self.leave(c);
        };
        self.at = pair.next;
        let prefix = self.group.map_or(Name::new(), Group::prefix);
        let target = match resolve(prefix, pair.name.of(c.line)) {
            // A group has no groups, and no G-code, in it.
            Target::Group(_) | Target::Action(Action::Block) => Target::Unknown,
            target => target,
        };
        self.carry_out(&pair, target, c);
    }

    /// One member of the group, in its order.
    pub(super) fn list<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let member =
            self.group.and_then(|group| Some((group, group.member(self.item, c.machine)?)));
        let Some((group, (index, token))) = member else {
            return self.leave(c);
        };
        self.item = index + 1;
        let shown = token.read(c.machine);
        let (name, prefix) = (token.name(), group.prefix().bytes().len());
        let mut writer = Writer::body(c.out, &mut self.format);
        writer.key(name.bytes().get(prefix..).unwrap_or(&[]));
        writer.shown(shown);
    }

    /// One entry of a new status report. Names that mean nothing here are passed over; a report
    /// that would hold nothing is refused.
    pub(super) fn select<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let Some(pair) = json::pair(c.line, self.at) else {
            self.at = json::behind_object(c.line, self.at);
            return self.selected(c);
        };
        self.at = pair.next;
        let Target::Token(token) = resolve(Name::new(), pair.name.of(c.line)) else { return };
        if pair.kind != Kind::True {
            return;
        }
        let report = c.machine.report();
        if !core::mem::replace(&mut self.selected, true) {
            report.clear();
        }
        if !report.add(token) {
            self.status = Status::JsonTooManyPairs;
        }
    }

    /// Tells the new report, or why there is none.
    fn selected<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        if self.selected {
            self.item = 0;
            self.phase = Phase::List;
            return;
        }
        self.status = Status::MalformedCommand;
        if let Some(first) = json::pair(c.line, self.item) {
            self.status = Status::UnrecognizedName;
            let known = resolve(Name::new(), first.name.of(c.line)) != Target::Unknown;
            self.tell_sent(&first, known, c);
        }
        self.leave(c);
    }

    fn carry_out<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        target: Target,
        c: &mut Context<'_, M, O>,
    ) {
        let outcome = self.apply(pair, target, c);
        self.open(c);
        match outcome {
            Ok(Some(token)) => {
                let shown = token.read(c.machine);
                let mut writer = Writer::body(c.out, &mut self.format);
                writer.key(pair.name.of(c.line));
                writer.shown(shown);
            }
            Ok(None) if self.phase == Phase::Greeting => {}
            Ok(None) => self.tell_sent(pair, true, c),
            Err(status) => {
                self.status = status;
                self.tell_sent(pair, target != Target::Unknown, c);
                self.leave(c);
            }
        }
    }

    pub(super) fn apply<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        target: Target,
        c: &mut Context<'_, M, O>,
    ) -> Outcome {
        match (target, pair.kind) {
            (Target::Unknown, _) => Err(Status::UnrecognizedName),
            (_, Kind::Object) | (Target::Group(_), _) => Err(Status::UnsupportedType),
            (Target::Token(token), Kind::Null) => Ok(Some(token)),
            (Target::Token(token), _) => {
                self.set(token.setting().ok_or(Status::ReadOnly)?, pair, c)?;
                Ok(Some(token))
            }
            (Target::Action(Action::Help), _) => self.advise(Warning::Help),
            (Target::Action(Action::Defaults), _) => self.restore(pair, c),
            (Target::Action(action), _) => act(action, pair, c).map(|()| None),
        }
    }

    fn set<M: Machine, O: Out>(
        &mut self,
        setting: Setting,
        pair: &Pair,
        c: &mut Context<'_, M, O>,
    ) -> Result<(), Status> {
        let small = match setting.row().kind {
            table::Kind::Small => true,
            table::Kind::Large => false,
            table::Kind::Constant | table::Kind::Text => return Err(Status::ReadOnly),
        };
        let number = match pair.kind {
            Kind::Number => Number::parse(pair.value.of(c.line)).ok_or(Status::BadNumber)?,
            Kind::True | Kind::False if small => Number::int((pair.kind == Kind::True).into()),
            _ => return Err(Status::UnsupportedType),
        };
        let inches = c.machine.inches();
        let value = c.machine.settings().check(setting, number, inches)?;
        let warning = c.machine.set(setting, value)?;
        let unusual = setting.is_microsteps() && !matches!(value, 1 | 2 | 4 | 8);
        let unusual = if unusual { Warning::Microsteps } else { Warning::None };
        self.warning = self.warning.max(warning).max(unusual);
        Ok(())
    }

    /// Tells a pair as it was sent; null if its name means nothing, or for a string.
    fn tell_sent<M, O: Out>(&mut self, pair: &Pair, known: bool, c: &mut Context<'_, M, O>) {
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

/// A number without the leading zeros that JSON does not allow.
fn plain_number(mut text: &[u8]) -> &[u8] {
    while let [b'0', rest @ ..] = text
        && matches!(rest, [b'0'..=b'9', ..])
    {
        text = rest;
    }
    text
}

fn done(status: Status) -> Result<(), Status> {
    if status == Status::Ok { Ok(()) } else { Err(status) }
}

/// The value of a pair as a whole number.
fn whole<M, O>(pair: &Pair, c: &Context<'_, M, O>) -> Result<i32, Status> {
    if pair.kind != Kind::Number {
        return Err(Status::UnsupportedType);
    }
    Number::parse(pair.value.of(c.line))
        .filter(|number| number.is_integer())
        .and_then(|number| number.fixed(0, false))
        .ok_or(Status::BadNumber)
}

fn act<M: Machine, O>(
    action: Action,
    pair: &Pair,
    c: &mut Context<'_, M, O>,
) -> Result<(), Status> {
    let on = match action {
        // A block is run only where nothing of the response is out yet.
        Action::Block if pair.kind == Kind::Null => return Ok(()),
        Action::Block if pair.kind == Kind::Text => return Err(Status::NotAccepted),
        Action::Block => return Err(Status::UnsupportedType),
        Action::Clear => return done(c.machine.clear()),
        Action::Test if pair.kind == Kind::Null => return Ok(()),
        Action::Test => {
            let number = whole(pair, c)?;
            let number = u8::try_from(number).map_err(|_| Status::OutOfRange)?;
            return done(c.machine.start_job(number));
        }
        Action::Flush => {
            let wanted = match pair.kind {
                Kind::Null | Kind::False => false,
                Kind::True => true,
                _ => whole(pair, c)? != 0,
            };
            return if wanted { done(c.machine.flush()) } else { Ok(()) };
        }
        Action::Energize => true,
        Action::Release => false,
        Action::Defaults | Action::Help => return Ok(()),
    };
    let motor = match pair.kind {
        Kind::Null | Kind::True => 0,
        _ => whole(pair, c)?,
    };
    match motor {
        0 => done(c.machine.energize(None, on)),
        1..=4 => done(c.machine.energize(Some(motor as u8 - 1), on)),
        _ => Err(Status::OutOfRange),
    }
}
