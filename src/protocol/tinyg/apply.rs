//! Carries out a pair of a request: reads, sets, acts.

use super::defaults::is_sure;
use super::json::{Kind, Pair};
use super::pairs::Outcome;
use super::program;
use super::remark::Remark;
use super::request::{Context, Request};
use super::token::{Group, Operation, Subject, Target};
use super::value::{Form, Source, place_form};
use crate::boards::MOTORS;
use crate::capability::Capability;
use crate::config::name::axis_of;
use crate::config::table;
use crate::config::{Number, Setting};
use crate::gcode::overrides::{Change, Override};
use crate::gcode::tables::TableRow;
use crate::protocol::{Machine, Out, Value};
use crate::status::Status;
use crate::units::Length;

/// The number of the last motor.
const LAST_MOTOR: i32 = MOTORS as i32;

#[small]
impl Request {
    pub(super) fn apply<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        target: Target,
        c: &mut Context<'_, M, O>,
    ) -> Outcome {
        match (target, pair.kind) {
            (Target::Unknown, _) => Err(Status::UnrecognizedName),
            (_, Kind::Object) | (Target::Group(_), _) => Err(Status::UnsupportedType),
            (Target::Token(token), Kind::Null) => {
                if matches!(token.subject(), Some(Subject::Setting(setting)) if setting.is_dialect())
                {
                    self.tell_choice(c);
                }
                Ok(Some(token))
            }
            (Target::Token(token), _) => {
                match token.subject() {
                    Some(Subject::Setting(setting)) => self.set(setting, pair, c)?,
                    Some(Subject::TableRow(row, axis)) if !row.is_stored() => {
                        set_row(row, axis, pair, c)?
                    }
                    Some(Subject::Member(vector, _, axis))
                        if Group::Vector(vector) == Group::TOOL_OFFSETS =>
                    {
                        // In millimetres, as the length is reported.
                        let length = fixed(pair, c.line, Length::DECIMALS, false)?;
                        c.machine.set_tool_length(axis, Length(length))?;
                    }
                    Some(Subject::Single(single)) => set_value(single.source, pair, c)?,
                    _ => return Err(Status::ReadOnly),
                }
                Ok(Some(token))
            }
            (Target::Operation(Operation::Help), _) => {
                Capability::Help.check()?;
                self.advise(Remark::Help)
            }
            (Target::Operation(Operation::Defaults), _) => self.restore(pair, c),
            (Target::Operation(Operation::Boot), _) => self.boot(pair, c),
            #[cfg(feature = "sd")]
            (Target::Operation(Operation::Files(what)), _) => {
                self.files(what, pair, c).map(|()| None)
            }
            (Target::Operation(action), _) => {
                let done = act(action, pair, c);
                if action == Operation::Test && done == Err(Status::Error) {
                    self.remark = self.remark.max(Remark::Test);
                }
                done.map(|()| None)
            }
        }
    }

    /// Reports what has decided the dialect of the port, if the image has several dialects.
    #[inline(never)]
    fn tell_choice<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let remark = match c.machine.value(Value::Choice) {
            0 => return,
            1 => Remark::Set,
            _ => Remark::Said,
        };
        self.remark = self.remark.max(remark);
    }

    #[inline(never)]
    fn set<M: Machine, O: Out>(
        &mut self,
        setting: Setting,
        pair: &Pair,
        c: &mut Context<'_, M, O>,
    ) -> Result<(), Status> {
        let small = match setting.row().kind {
            table::Kind::Small => true,
            table::Kind::Large | table::Kind::Cold => false,
            table::Kind::Data | table::Kind::Job => {
                let value = bits(pair, c.line)?;
                return c.machine.set(setting, value).map(|_| ());
            }
            table::Kind::Constant | table::Kind::Text => return Err(setting.refusal()),
        };
        let value = match pair.kind {
            Kind::Number => number(pair, c.line)?,
            Kind::True | Kind::False if small => Number::int((pair.kind == Kind::True).into()),
            _ => return Err(Status::UnsupportedType),
        };
        let inches = c.machine.inches();
        let checked = c.machine.settings().check(setting, value, inches);
        if checked.is_err() && setting.is_baud() {
            self.remark = self.remark.max(Remark::Baud);
        }
        let value = checked?;
        let remark = Remark::from(c.machine.set(setting, value)?);
        let unusual = setting.is_microsteps() && !matches!(value, 1 | 2 | 4 | 8);
        let unusual = if unusual { Remark::Microsteps } else { Remark::None };
        self.remark = self.remark.max(remark).max(unusual);
        Ok(())
    }
}

/// Returns the value of a pair as 32 bits, as in `"0x2a"`.
#[small]
fn bits(pair: &Pair, line: &[u8]) -> Result<i32, Status> {
    if !matches!(pair.kind, Kind::Text | Kind::Number) {
        return Err(Status::UnsupportedType);
    }
    let digits = match pair.value.of(line) {
        [b'0', b'x' | b'X', digits @ ..] if (1..=8).contains(&digits.len()) => digits,
        _ => return Err(Status::BadNumber),
    };
    let digit = |bits: u32, byte: &u8| Some(bits << 4 | char::from(*byte).to_digit(16)?);
    let bits = digits.iter().try_fold(0, digit).ok_or(Status::BadNumber)?;
    Ok(bits.cast_signed())
}

/// Sets a value of the interpreter's tables.
#[small]
fn set_row<M: Machine, O>(
    row: TableRow,
    axis: u8,
    pair: &Pair,
    c: &mut Context<'_, M, O>,
) -> Result<(), Status> {
    let inches = c.machine.inches() && place_form(axis) == Form::Length;
    let value = fixed(pair, c.line, Length::DECIMALS, inches)?;
    c.machine.set_row(row, axis, Length(value))
}

/// Jogs the axis whose letter ends the name. The position is in mm or degrees, even if the units are inches.
#[inline(never)]
#[small]
fn jog<M: Machine, O>(pair: &Pair, c: &mut Context<'_, M, O>) -> Result<(), Status> {
    let axis = pair.name.of(c.line).last().copied().and_then(axis_of);
    let place = fixed(pair, c.line, Length::DECIMALS, false)?;
    done(c.machine.jog(axis.ok_or(Status::UnrecognizedName)?, Length(place)))
}

/// Sets a value of the machine: changes an override, starts homing, or switches check mode.
#[small]
fn set_value<M: Machine, O>(
    source: Source,
    pair: &Pair,
    c: &mut Context<'_, M, O>,
) -> Result<(), Status> {
    let change = match source {
        Source::Of(Value::Home) => {
            let sure = is_sure(pair, c)?;
            return if sure { done(c.machine.home(u8::MAX, false)) } else { Ok(()) };
        }
        Source::Of(Value::Check) => {
            let on = is_sure(pair, c)?;
            return done(c.machine.check(on));
        }
        Source::Of(Value::Override(which)) => {
            let on = c.machine.value(Value::OverrideOn(which)) != 0;
            Change::new(which, on, factor(which, pair, c.line)?)
        }
        Source::Of(Value::OverrideOn(which)) => {
            let on = match pair.kind {
                Kind::True => 1,
                Kind::False => 0,
                _ => whole(pair, c.line)?,
            };
            Change::switch(
                which,
                (0..=1).contains(&on).then_some(on != 0).ok_or(Status::OutOfRange)?,
            )
        }
        _ => return Err(Status::ReadOnly),
    };
    c.machine.change_override(change);
    Ok(())
}

/// Returns the factor that a pair gives an override, in thousandths.
#[small]
fn factor(which: Override, pair: &Pair, line: &[u8]) -> Result<u16, Status> {
    let factor = fixed(pair, line, 3, false)?;
    let factor = u32::try_from(factor).ok().and_then(|factor| which.checked(factor));
    factor.ok_or(Status::OutOfRange)
}

#[small]
fn done(status: Status) -> Result<(), Status> {
    if status == Status::Ok { Ok(()) } else { Err(status) }
}

/// Returns the value of a pair as a number.
#[inline(never)]
#[small]
fn number(pair: &Pair, line: &[u8]) -> Result<Number, Status> {
    match pair.kind {
        Kind::Number => Number::parse(pair.value.of(line)).ok_or(Status::BadNumber),
        _ => Err(Status::UnsupportedType),
    }
}

/// Returns the value of a pair, scaled to `decimals` decimals.
#[inline(never)]
#[small]
fn fixed(pair: &Pair, line: &[u8], decimals: u8, inches: bool) -> Result<i32, Status> {
    number(pair, line)?.fixed(decimals, inches).ok_or(Status::OutOfRange)
}

/// Returns the value of a pair as a whole number.
#[inline(never)]
#[small]
fn whole(pair: &Pair, line: &[u8]) -> Result<i32, Status> {
    let number = number(pair, line)?;
    let value = if number.is_integer() { number.fixed(0, false) } else { None };
    value.ok_or(Status::BadNumber)
}

#[small]
fn act<M: Machine, O>(
    action: Operation,
    pair: &Pair,
    c: &mut Context<'_, M, O>,
) -> Result<(), Status> {
    let on = match action {
        // A block runs only before the response has begun.
        Operation::Block if pair.kind == Kind::Null => return Ok(()),
        Operation::Block if pair.kind == Kind::Text => return Err(Status::NotAccepted),
        Operation::Block => return Err(Status::UnsupportedType),
        Operation::Clear => return done(c.machine.clear()),
        Operation::Raise(alarm) => {
            c.machine.alarm(alarm, alarm.status());
            return Ok(());
        }
        Operation::Test if pair.kind == Kind::Null => return Ok(()),
        Operation::Test => {
            let number = whole(pair, c.line)?;
            let number = u8::try_from(number).map_err(|_| Status::OutOfRange)?;
            return done(c.machine.start_job(number));
        }
        Operation::Jog if pair.kind == Kind::Null => return Ok(()),
        Operation::Jog => return jog(pair, c),
        Operation::Text if pair.kind != Kind::Null => return Err(Status::UnsupportedType),
        Operation::Program => return program::store(pair, c),
        Operation::Flush => {
            let sure = is_sure(pair, c)?;
            return if sure { done(c.machine.flush()) } else { Ok(()) };
        }
        Operation::Reset => {
            let sure = is_sure(pair, c)?;
            return if sure { done(c.machine.restart(false)) } else { Ok(()) };
        }
        // The report would interrupt the response.
        Operation::Exception => return Err(Status::NotAccepted),
        #[cfg(feature = "sd")]
        Operation::Files(_) => return Ok(()),
        Operation::Energize => true,
        Operation::Release => false,
        Operation::Defaults | Operation::Help | Operation::Boot => return Ok(()),
        Operation::Text | Operation::Message | Operation::Id => return Ok(()),
    };
    let motor = match pair.kind {
        Kind::Null | Kind::True => 0,
        _ => whole(pair, c.line)?,
    };
    match motor {
        0 => done(c.machine.energize(None, on)),
        1..=LAST_MOTOR => done(c.machine.energize(Some(motor as u8 - 1), on)),
        _ => Err(Status::OutOfRange),
    }
}
