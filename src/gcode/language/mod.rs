//! The language beyond words and numbers: parameters, expressions, comments that tell values.
//!
//! Owns [`Language`], a part of the [`Interpreter`]: the parameters of programs, and what the last line has told.
//! `Interpreter::slow_path` calls it, in the parser task, for a line that [needs it](is_needed); other lines cost the
//! look at their characters, 10 cycles each. Works step by step without a wait, and no function calls itself:
//!
//! ```text
//! line -> line (assignments, words, comments) -> expression (values) -> number (of a word) -> Block -> as other lines
//!                                                  |  operations: operators, functions
//!                                                  |  parameters: assigned; live: read from the machine
//! accepted -> assigned parameters -> said (the text of the comment), which the answer to the line takes
//! ```
//!
//! Limits: 254 characters in a line, [`expression::BRACKETS`] open brackets, [`parameters::NUMBERED`] parameters beyond
//! the first 30 that are not 0, [`parameters::NAMED`] names with [`parameters::NAMES`] characters together. A line beyond a limit
//! is refused with a status of its own, as is one that is no valid text. A line that is refused assigns nothing.
//!
//! RAM: 6,400 bytes for the parameters. Stack: 4 KB while such a line is read. Cost on the RP2040: 0.2 ms for a line with ten
//! operators, 5 ms for the worst of 254 characters (estimated). An image without
//! [`Capability::Language`](crate::capability::Capability) has `absent.rs` in place of this.

mod expression;
mod line;
mod live;
mod number;
mod operations;
mod parameters;
mod said;
#[cfg(test)]
mod tests;
mod text;

use core::borrow::BorrowMut;

use heapless::Vec;

use super::block::Block;
use super::command::Commands;
use super::interpreter::{Info, Interpreter};
use super::setup::Setup;
use super::state::State;
use super::tables::Tables;
use crate::status::Status;
use crate::units::{Length, PerAxis};
use line::{After, Line, Target};
use live::Live;
use parameters::{Named, Numbered};
use said::{Kind, Said};

/// The parameters from this number on are the machine's: an assignment has no effect.
const FAULTS: u16 = 5_600;

/// The parameters of programs, and what the last line has told.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Language {
    numbered: Numbered,
    named: Named,
    said: Said,
}

/// How the firmware keeps the parameters: they are too large to be moved to their place.
pub type Placed = &'static mut Language;

impl Language {
    /// Returns the parameters at power-up. All bytes are 0.
    pub const fn new() -> Self {
        Self { numbered: Numbered::NONE, named: Named::NONE, said: Said::NOTHING }
    }

    /// Returns the value of a numbered parameter that programs assign.
    fn get(&self, number: u16) -> f64 {
        self.numbered.get(number) + at_first(number)
    }

    fn assign(&mut self, assigned: &[(Target, f64)]) {
        for (target, value) in assigned {
            match target {
                Target::Number(FAULTS..) => {}
                Target::Number(number) => self.numbered.set(*number, *value - at_first(*number)),
                Target::Name(name) => self.named.set(*name, *value),
            }
        }
    }
}

impl Default for Language {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns the value of a parameter at power-up. It is kept without this.
fn at_first(number: u16) -> f64 {
    f64::from(u8::from(number == live::DEBUG))
}

/// Whether a line has more than words with numbers and plain comments.
pub fn is_needed(line: &[u8]) -> bool {
    let mut sign = false;
    for (at, byte) in line.iter().enumerate() {
        match byte {
            b'#' | b'[' => return true,
            b'-' | b'+' if sign => return true,
            b'(' if said::kind(line.get(at + 1..).unwrap_or_default()).is_some() => return true,
            b';' => return false,
            b' ' | b'\t' => continue,
            _ => {}
        }
        sign = matches!(byte, b'-' | b'+');
    }
    false
}

/// Whether a text ends in a comment that tells values.
pub fn is_telling(text: &[u8]) -> bool {
    let begin = text.iter().rposition(|byte| *byte == b'(');
    begin.and_then(|at| text.get(at + 1..)).is_some_and(|comment| said::kind(comment).is_some())
}

/// Returns the status with which a line is refused that is no valid one.
#[inline(always)]
pub fn refusal(_line: &[u8], status: Status) -> Status {
    status
}

impl<T: Tables, L: BorrowMut<Language>> Interpreter<T, L> {
    /// Interprets a line that [needs it](is_needed), as [`Interpreter::slow_path`] does.
    #[inline(never)]
    pub(super) fn computed(
        &mut self,
        line: &[u8],
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<Info, Status> {
        let (mut block, deletes) = (Block::new(), setup.deletes_blocks());
        let (state, tables) = (self.state, &self.tables);
        let mut read = Line {
            language: self.language.borrow(),
            live: Live { state: &state, tables },
            assigned: Vec::new(),
            said: None,
        };
        let done = match block.begin(line, deletes)? {
            Some(rest) => read.read(&mut block, line, rest),
            None => Ok(()),
        };
        let done = done.and_then(|()| block.check(self.state.modal.motion));
        if let Err(status) = done.and_then(|()| read.check_room()) {
            return if block.named { Ok(Info::default()) } else { Err(status) };
        }
        let (assigned, said) = (read.assigned, read.said);
        let info = self.finish(&mut block, deletes, setup, out)?;
        let language = self.language.borrow_mut();
        language.assign(&assigned);
        language.said = Said::NOTHING;
        if let Some((kind, text)) = said
            && (kind == Kind::Print || language.get(live::DEBUG) > 0.0)
        {
            let live = Live { state: &state, tables: &self.tables };
            let said = Said::of(text, &After { language, live });
            language.said = said;
        }
        Ok(info)
    }

    /// Returns what the last line has told; nothing after [`Self::hush`].
    pub fn said(&self) -> &[u8] {
        self.language.borrow().said.text()
    }

    /// Forgets what the last line has told.
    pub fn hush(&mut self) {
        self.language.borrow_mut().said = Said::NOTHING;
    }

    /// Records the place of the last probing, in machine coordinates, and whether there was a contact.
    pub fn note_probe(&mut self, place: &PerAxis<Length>, contact: bool) {
        let state = State { position: *place, ..self.state };
        let live = Live { state: &state, tables: &self.tables };
        let numbered = &mut self.language.borrow_mut().numbered;
        for (axis, number) in (live::PROBED..live::CONTACT).enumerate() {
            numbered.set(number, live.work(axis as u16));
        }
        numbered.set(live::CONTACT, f64::from(u8::from(contact)));
    }
}
