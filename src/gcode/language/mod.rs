//! The language beyond words and numbers: parameters, expressions, O words, comments that tell values.
//!
//! Owns [`Language`], a part of the [`Interpreter`]: the parameters of programs, recorded lines, and what the last line has
//! told. `Interpreter::slow_path` calls it, in the parser task, for a line that [needs it](is_needed); other lines cost the
//! look at their characters, 10 cycles each. Works step by step without a wait, and no function calls itself:
//!
//! ```text
//! line -> run (O words: flow, oword; recorded lines: record)
//!          -> line (assignments, words, comments) -> expression (values) -> number (of a word) -> Block -> as other lines
//!                                                     |  operations: operators, functions
//!                                                     |  parameters: assigned; live: read from the machine
//! accepted -> assigned parameters -> said (the text of the comment), which the answer to the line takes
//! ```
//!
//! A line that begins a replay has its answer when that is over: until then [`Interpreter::is_replay`] is true, and the
//! caller asks for the next lines, after it has served everything else.
//!
//! Limits: 254 characters in a line, [`expression::BRACKETS`] open brackets, [`parameters::NUMBERED`] parameters beyond
//! the first 30 that are not 0, [`parameters::NAMED`] names with [`parameters::NAMES`] characters together,
//! [`record::TEXT`] characters of recorded lines, [`flow::BLOCKS`] blocks and [`flow::CALLS`] calls within each other. A line
//! beyond a limit is refused with a status of its own, as is one that is no valid text. A line that is refused assigns
//! nothing.
//!
//! RAM: 11 KB. Stack: 6 KB from the task to the deepest operation. Cost on the RP2040: 0.2 ms for a line with ten operators,
//! 5 ms for the worst of 254 characters (estimated). An image without
//! [`Capability::Language`](crate::capability::Capability) has `absent.rs` in place of this.

mod expression;
mod flow;
#[cfg(test)]
mod flow_tests;
mod line;
mod live;
mod number;
mod operations;
mod oword;
mod parameters;
mod record;
mod run;
mod said;
#[cfg(test)]
mod tests;
mod text;

use core::borrow::BorrowMut;

use heapless::Vec;

use super::block::Block;
use super::codes::StopCode;
use super::command::Commands;
use super::comment::{self, Kind};
use super::interpreter::{Info, Interpreter};
use super::setup::Setup;
use super::state::State;
use super::tables::Tables;
use crate::status::Status;
use crate::units::{Length, PerAxis};
use flow::Flow;
use line::{Known, Line, Target};
use live::Live;
use parameters::{Named, Numbered, Saved};
use said::Said;
use text::{Name, Text};

/// The parameters from this number on are the machine's: an assignment has no effect.
const FAULTS: u16 = 5_600;

/// The parameters of programs, and what the last line has told.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Language {
    numbered: Numbered,
    named: Named,
    said: Said,
    flow: Flow,
    /// The arguments of callers.
    saved: Saved,
    /// The value that the last subroutine has returned.
    returned: Option<f64>,
}

/// How the firmware keeps the parameters: they are too large to be moved to their place.
pub type Placed = &'static mut Language;

impl Language {
    /// Returns the parameters at power-up. All bytes are 0.
    pub const fn new() -> Self {
        Self {
            numbered: Numbered::NONE,
            named: Named::NONE,
            said: Said::NOTHING,
            flow: Flow::NONE,
            saved: Saved::NONE,
            returned: None,
        }
    }

    /// Ends the replay, all loops and all calls. Subroutines stay.
    fn stop_flow(&mut self) {
        while self.flow.level() > 0 {
            let level = self.flow.level();
            self.flow.call_ends();
            self.saved.restore(&mut self.numbered, level);
            self.named.leave();
        }
        self.flow.stop();
    }

    /// Ends all that O words have begun, and forgets subroutines.
    fn clear_flow(&mut self) {
        self.stop_flow();
        self.flow.clear();
    }

    /// Returns the value of a parameter that calls set, by its name.
    fn called(&self, name: Name) -> Option<f64> {
        if name.is(Name(b"_value")) {
            Some(self.returned.unwrap_or(0.0))
        } else if name.is(Name(b"_value_returned")) {
            Some(f64::from(u8::from(self.returned.is_some())))
        } else if name.is(Name(b"_call_level")) {
            Some(f64::from(self.flow.level()))
        } else {
            None
        }
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
    if oword::is_next(Text::new(line)) {
        return true;
    }
    let mut sign = false;
    for (at, byte) in line.iter().enumerate() {
        match byte {
            b'#' | b'[' => return true,
            b'-' | b'+' if sign => return true,
            b'(' if comment::kind(line.get(at + 1..).unwrap_or_default()).is_some() => return true,
            b';' => return false,
            b' ' | b'\t' => continue,
            _ => {}
        }
        sign = matches!(byte, b'-' | b'+');
    }
    false
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
        self.in_order(line, setup, out)
    }

    /// Whether any line is for [`Self::computed`].
    pub(super) fn has_flow(&self) -> bool {
        self.language.borrow().flow.is_busy()
    }

    /// Whether no line is for the fast path.
    #[inline(always)]
    pub(super) fn takes_all(&self) -> bool {
        self.language.borrow().flow.takes_all()
    }

    /// Carries out a line without an O word.
    #[inline(never)]
    fn without_oword(
        &mut self,
        line: &[u8],
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<Info, Status> {
        let (mut block, deletes) = (Block::new(), setup.deletes_blocks());
        let (state, tables) = (self.state, &self.tables);
        let mut read = Line {
            known: Known { language: self.language.borrow(), live: Live { state: &state, tables } },
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
        let ends = block.stop == Some(StopCode::End);
        let language = self.language.borrow_mut();
        language.assign(&assigned);
        if ends {
            language.clear_flow();
        }
        language.said = Said::NOTHING;
        if let Some((kind, text)) = said
            && (kind == Kind::Print || language.get(live::DEBUG) > 0.0)
        {
            let live = Live { state: &state, tables: &self.tables };
            let said = Said::of(text, &Known { language, live });
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
