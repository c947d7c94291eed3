//! Values: numbers, parameters, functions, and expressions in brackets.
//!
//! What has been read and cannot be computed yet is kept in two stacks of fixed size, so that no text makes functions
//! call themselves. A text that needs more than [`BRACKETS`] open brackets, or more than [`PENDING`] places in a stack,
//! is refused with [`Status::ExpressionTooDeep`].
//!
//! A sign before digits is a part of the number: `-2**2` is 4. Signs and `#` bind tighter than operators: `#1+2` is
//! `[#1]+2`. Operators are allowed in brackets alone.

use heapless::Vec;

use super::number;
use super::operations::{Function, Operator, angle};
use super::text::{Name, Text};
use crate::status::Status;

/// The most brackets that may be open.
pub const BRACKETS: u8 = 16;
/// The most values and operators that may wait: for each bracket one of each rank, and signs.
const PENDING: usize = 96;

/// What an expression reads parameters from.
pub trait Scope {
    /// Returns the value of a numbered parameter.
    fn numbered(&self, number: u16) -> Result<f64, Status>;
    /// Returns the value of a named parameter; `None` if there is none of that name.
    fn named(&self, name: Name) -> Option<f64>;
    /// Whether there can be a numbered parameter.
    fn has(&self, number: f64) -> bool;
}

/// What waits for a value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Pending {
    /// A bracket.
    Open,
    /// A function and its bracket.
    Function(Function),
    /// ATAN and its first bracket.
    Atan,
    /// The second bracket of ATAN.
    AtanOver,
    /// EXISTS, its bracket and `#`.
    Exists,
    /// `#`.
    Parameter,
    Minus,
    Plus,
    /// An operator whose first value is known.
    Operator(Operator),
}

impl Pending {
    /// Whether a closing bracket ends this.
    fn is_bracket(self) -> bool {
        use Pending::{Atan, AtanOver, Exists, Function, Open};
        matches!(self, Open | Function(_) | Atan | AtanOver | Exists)
    }
}

/// Reads a value, and computes it.
pub fn value(text: &mut Text, scope: &dyn Scope) -> Result<f64, Status> {
    let mut work = Work { scope, values: Vec::new(), pending: Vec::new(), open: 0 };
    loop {
        work.operand(text)?;
        loop {
            work.bind()?;
            if work.pending.is_empty() {
                return work.values.pop().ok_or(Status::ExpressionInvalid);
            }
            if !text.eat(b']') {
                work.operator(text)?;
                break;
            }
            if work.close(text)? {
                break;
            }
        }
    }
}

/// Reads the number of a parameter, behind `#`.
pub fn parameter(text: &mut Text, scope: &dyn Scope) -> Result<u16, Status> {
    index(value(text, scope)?)
}

/// Returns the number of a parameter that a value stands for.
fn index(value: f64) -> Result<u16, Status> {
    number::whole(value).and_then(|n| u16::try_from(n).ok()).ok_or(Status::ParameterInvalid)
}

/// A value that is being computed.
struct Work<'a> {
    scope: &'a dyn Scope,
    values: Vec<f64, PENDING>,
    pending: Vec<Pending, PENDING>,
    open: u8,
}

impl Work<'_> {
    /// Reads signs, `#`, functions and opening brackets, up to a number or a name.
    fn operand(&mut self, text: &mut Text) -> Result<(), Status> {
        loop {
            if text.is_at_number() {
                let number = number::read(text)?;
                return self.push(number);
            }
            let next = match text.peek().ok_or(Status::ExpressionInvalid)? {
                b'#' => {
                    text.eat(b'#');
                    if text.eat(b'<') {
                        let found = self.scope.named(text.name()?);
                        return self.push(found.ok_or(Status::ParameterUnknown)?);
                    }
                    Pending::Parameter
                }
                b'-' => sign(text, b'-', Pending::Minus),
                b'+' => sign(text, b'+', Pending::Plus),
                b'[' => Pending::Open,
                _ => function(text)?,
            };
            if next.is_bracket() {
                self.open(text)?;
            }
            self.wait(next)?;
            if next == Pending::Exists && self.exists(text)? {
                return Ok(());
            }
        }
    }

    /// Reads an opening bracket.
    fn open(&mut self, text: &mut Text) -> Result<(), Status> {
        if !text.eat(b'[') {
            return Err(Status::ExpressionInvalid);
        }
        self.open += 1;
        if self.open > BRACKETS { Err(Status::ExpressionTooDeep) } else { Ok(()) }
    }

    /// Reads `#` of EXISTS, and the name if there is one. Returns whether there is.
    fn exists(&mut self, text: &mut Text) -> Result<bool, Status> {
        if !text.eat(b'#') {
            return Err(Status::ExpressionInvalid);
        }
        let named = text.eat(b'<');
        if named {
            let known = self.scope.named(text.name()?).is_some();
            self.pending.pop();
            self.wait(Pending::Open)?;
            self.push(if known { 1.0 } else { 0.0 })?;
        }
        Ok(named)
    }

    /// Applies signs and `#` to the value behind them.
    fn bind(&mut self) -> Result<(), Status> {
        while let Some(last @ (Pending::Minus | Pending::Plus | Pending::Parameter)) =
            self.pending.last().copied()
        {
            let value = self.pop()?;
            let bound = match last {
                Pending::Minus => -value,
                Pending::Parameter => self.scope.numbered(index(value)?)?,
                _ => value,
            };
            self.pending.pop();
            self.push(bound)?;
        }
        Ok(())
    }

    /// Reads an operator, and applies those before it that bind at least as tight.
    fn operator(&mut self, text: &mut Text) -> Result<(), Status> {
        let operator = Operator::read(text).ok_or(Status::ExpressionInvalid)?;
        self.apply(operator.rank())?;
        if self.pending.last() == Some(&Pending::Exists) {
            return Err(Status::ExpressionInvalid);
        }
        self.wait(Pending::Operator(operator))
    }

    /// Applies the operators that wait and have at least this rank.
    fn apply(&mut self, rank: u8) -> Result<(), Status> {
        while let Some(Pending::Operator(operator)) = self.pending.last().copied()
            && operator.rank() >= rank
        {
            let (b, a) = (self.pop()?, self.pop()?);
            self.pending.pop();
            self.push(operator.apply(a, b)?)?;
        }
        Ok(())
    }

    /// Ends a bracket. Returns whether another value has to follow.
    fn close(&mut self, text: &mut Text) -> Result<bool, Status> {
        self.apply(0)?;
        let (bracket, value) = (self.pending.pop().ok_or(Status::ExpressionInvalid)?, self.pop()?);
        self.open -= 1;
        let value = match bracket {
            Pending::Function(function) => function.apply(value)?,
            Pending::Exists => f64::from(u8::from(self.scope.has(value))),
            Pending::AtanOver => angle(self.pop()?, value)?,
            Pending::Atan => {
                if !text.eat(b'/') {
                    return Err(Status::ExpressionInvalid);
                }
                self.open(text)?;
                self.wait(Pending::AtanOver)?;
                self.push(value)?;
                return Ok(true);
            }
            _ => value,
        };
        self.push(value)?;
        Ok(false)
    }

    fn push(&mut self, value: f64) -> Result<(), Status> {
        self.values.push(value).map_err(|_| Status::ExpressionTooDeep)
    }

    fn pop(&mut self) -> Result<f64, Status> {
        self.values.pop().ok_or(Status::ExpressionInvalid)
    }

    fn wait(&mut self, what: Pending) -> Result<(), Status> {
        self.pending.push(what).map_err(|_| Status::ExpressionTooDeep)
    }
}

/// Reads a sign.
fn sign(text: &mut Text, byte: u8, sign: Pending) -> Pending {
    text.eat(byte);
    sign
}

/// Reads the name of a function.
fn function(text: &mut Text) -> Result<Pending, Status> {
    if text.eat_word(b"ATAN") {
        return Ok(Pending::Atan);
    }
    if text.eat_word(b"EXISTS") {
        return Ok(Pending::Exists);
    }
    Function::read(text).map(Pending::Function).ok_or(Status::ExpressionInvalid)
}
