//! Reads a line that has more than words with numbers: assignments, computed words, comments that tell something.
//!
//! All values are read with the parameters as the line before has left them. What the line assigns takes effect when it
//! is accepted, and before its comment is told.

use heapless::Vec;

use super::super::block::Block;
use super::super::comment::{self, Kind};
use super::super::lexer::{self, Fault, Item};
use super::super::number::decimal;
use super::super::tables::Tables;
use super::Language;
use super::expression::{Scope, parameter, value};
use super::live::{Live, is_read_only};
use super::number;
use super::parameters::NUMBER_MAX;
use super::text::{Name, Text};
use crate::status::Status;

/// The most assignments of a line.
const ASSIGNED: usize = 50;

/// A parameter that a line assigns.
#[derive(Clone, Copy)]
pub enum Target<'a> {
    /// A numbered parameter.
    Number(u16),
    /// A named parameter.
    Name(Name<'a>),
}

/// A line that is being read.
pub struct Line<'a, 'm, T> {
    /// The parameters before it.
    pub known: Known<'m, T>,
    /// What the line assigns, in its order.
    pub assigned: Vec<(Target<'a>, f64), ASSIGNED>,
    /// What the last comment tells.
    pub said: Option<(Kind, &'a [u8])>,
}

impl<'a, T: Tables> Line<'a, '_, T> {
    /// Reads the items of a line. `rest` is the part of it that is still to be read, and begins with no blank.
    pub fn read(
        &mut self,
        block: &mut Block,
        line: &'a [u8],
        mut rest: &'a [u8],
    ) -> Result<(), Status> {
        while let Some(first) = rest.first() {
            rest = match first {
                b'#' => self.assignment(rest)?,
                b'(' | b';' => self.comment(block, line, rest)?,
                _ => self.word(block, rest)?,
            };
        }
        Ok(())
    }

    fn assignment(&mut self, rest: &'a [u8]) -> Result<&'a [u8], Status> {
        let mut text = Text::new(rest);
        text.eat(b'#');
        let target = match text.eat(b'<') {
            true => Target::Name(text.name()?),
            false => Target::Number(parameter(&mut text, self)?),
        };
        if !text.eat(b'=') {
            return Err(Status::ExpressionInvalid);
        }
        match target {
            Target::Number(1..=NUMBER_MAX) => {}
            Target::Number(_) => return Err(Status::ParameterInvalid),
            Target::Name(_) => {}
        }
        let value = value(&mut text, self)?;
        let read_only = match target {
            Target::Number(number) => is_read_only(number),
            Target::Name(name) => {
                let known = &self.known;
                known.live.named(name).or_else(|| known.language.called(name)).is_some()
            }
        };
        if read_only {
            return Err(Status::ParameterReadOnly);
        }
        self.assigned.push((target, value)).map_err(|_| Status::ParametersFull)?;
        text.peek();
        Ok(text.rest())
    }

    fn comment(
        &mut self,
        block: &mut Block,
        line: &[u8],
        rest: &'a [u8],
    ) -> Result<&'a [u8], Status> {
        let (after, item) = lexer::item(rest).map_err(status)?;
        if let Item::Comment(text) = item {
            block.comment(line, text);
            // Text behind a semicolon tells nothing.
            self.said = comment::kind(text).filter(|_| rest.first() == Some(&b'('));
        }
        Ok(after)
    }

    fn word(&mut self, block: &mut Block, rest: &'a [u8]) -> Result<&'a [u8], Status> {
        let mut text = Text::new(rest);
        let letter = text.peek().filter(u8::is_ascii_alphabetic).ok_or(Status::MalformedCommand)?;
        text.eat(letter);
        if letter == b'N' || text.is_at_number() || text.peek().is_none() {
            let (rest, number) = decimal(text.rest()).map_err(status)?;
            block.word(letter, number)?;
            return Ok(rest);
        }
        let number = number::word(letter, value(&mut text, self)?)?;
        block.word(letter, number)?;
        text.peek();
        Ok(text.rest())
    }

    /// Checks that there is room for what the line assigns.
    pub fn check_room(&self) -> Result<(), Status> {
        let (numbered, named) = (&self.known.language.numbered, &self.known.language.named);
        let numbers = self.assigned.iter().filter(|(target, value)| match target {
            Target::Number(number) => *value != 0.0 && numbered.lacks(*number),
            Target::Name(_) => false,
        });
        if numbers.count() > numbered.room() {
            return Err(Status::ParametersFull);
        }
        named.check_room(self.assigned.iter().filter_map(|(target, _)| match target {
            Target::Name(name) if named.get(*name).is_none() => Some(name.bytes().count()),
            _ => None,
        }))
    }
}

/// The parameters as they are.
pub struct Known<'a, T> {
    /// The parameters.
    pub language: &'a Language,
    /// The state of the machine.
    pub live: Live<'a, T>,
}

impl<T: Tables> Scope for Known<'_, T> {
    fn numbered(&self, number: u16) -> Result<f64, Status> {
        match number {
            0 | NUMBER_MAX.. if number != NUMBER_MAX => Err(Status::ParameterInvalid),
            _ if is_read_only(number) => Ok(self.live.numbered(number)),
            _ => Ok(self.language.get(number)),
        }
    }

    fn named(&self, name: Name) -> Option<f64> {
        let live = self.live.named(name).or_else(|| self.language.called(name));
        live.or_else(|| self.language.named.get(name))
    }

    fn has(&self, number: f64) -> bool {
        number::whole(number).is_some_and(|number| (1..=i32::from(NUMBER_MAX)).contains(&number))
    }
}

impl<T: Tables> Scope for Line<'_, '_, T> {
    fn numbered(&self, number: u16) -> Result<f64, Status> {
        self.known.numbered(number)
    }

    fn named(&self, name: Name) -> Option<f64> {
        // A name that the line itself is going to assign is 0 before that.
        let is_assigned =
            |target: &Target| matches!(target, Target::Name(other) if name.is(*other));
        let assigned = || self.assigned.iter().any(|(target, _)| is_assigned(target));
        self.known.named(name).or_else(|| assigned().then_some(0.0))
    }

    fn has(&self, number: f64) -> bool {
        self.known.has(number)
    }
}

fn status(error: nom::Err<Fault>) -> Status {
    match error {
        nom::Err::Error(fault) | nom::Err::Failure(fault) => fault.0,
        nom::Err::Incomplete(_) => Status::MalformedCommand,
    }
}
