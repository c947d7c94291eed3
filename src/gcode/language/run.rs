//! Runs lines in the order that their O words demand.

use core::borrow::BorrowMut;

use super::super::command::Commands;
use super::super::comment;
use super::super::interpreter::{Info, Interpreter};
use super::super::setup::Setup;
use super::super::tables::Tables;
use super::Language;
use super::expression::value;
use super::flow::{Block, Kind, Skip};
use super::line::Known;
use super::live::Live;
use super::oword::{self, Head, Keyword, Label};
use super::parameters::ARGUMENTS;
use super::record::LONGEST;
use super::text::Text;
use crate::status::Status;
use heapless::Vec;

/// The most lines of a replay without commands that run before other tasks have their turn.
const TURN: u8 = 16;

impl<T: Tables, L: BorrowMut<Language>> Interpreter<T, L> {
    /// Whether the line that has been interpreted last has begun a replay that is not over: its answer has to wait, and
    /// [`Interpreter::slow_path`] has to be called again when the commands have been taken, with any line.
    #[inline(always)]
    pub fn is_replay(&self) -> bool {
        self.language.borrow().flow.is_replay()
    }

    /// Whether the last line of a replay tells something, and the replay goes on.
    #[inline(always)]
    pub fn is_telling(&self) -> bool {
        self.is_replay() && !self.said().is_empty()
    }

    /// Ends what O words have begun, and forgets subroutines: what has been received has been dropped, or an alarm has
    /// come.
    pub fn end_flow(&mut self) {
        self.language.borrow_mut().clear_flow();
    }

    /// Interprets a line, or the next lines of a replay.
    pub(super) fn in_order(
        &mut self,
        line: &[u8],
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<Info, Status> {
        if self.is_replay() {
            return self.replay(setup, out);
        }
        let Some(text) = behind_start(line, setup.deletes_blocks()) else {
            return Ok(Info { deleted: true, ..Info::default() });
        };
        let takes_all = self.language.borrow().flow.takes_all();
        if !takes_all && !oword::is_next(Text::new(text)) {
            return self.without_oword(line, setup, out);
        }
        self.streamed(text, setup, out)
    }

    /// Interprets lines of a replay, up to one that commands or tells something.
    fn replay(&mut self, setup: &impl Setup, out: &mut Commands) -> Result<Info, Status> {
        let (mut buffer, mut info) = ([0; LONGEST], Info::default());
        for _ in 0..TURN {
            let flow = &mut self.language.borrow_mut().flow;
            let Some(at) = flow.next() else { break };
            let Some((next, length)) = flow.record.line(at, &mut buffer) else {
                flow.stop();
                return Err(Status::InternalError);
            };
            flow.go_to(Some(next));
            let text = buffer.get(..length).unwrap_or_default();
            let done = self.step(text, at, setup, out);
            let language: &mut Language = self.language.borrow_mut();
            info = match done {
                Err(Status::Again) => {
                    language.flow.go_to(Some(at));
                    return Err(Status::Again);
                }
                Err(status) => {
                    language.stop_flow();
                    return Err(status);
                }
                Ok(info) => info,
            };
            language.flow.settle();
            if !out.is_empty() || !language.said.text().is_empty() {
                break;
            }
        }
        // Places in the text are those of a line that the sender does not see.
        Ok(Info { message: None, deleted: false, ..info })
    }

    /// Takes a line from the sender that is a part of a block or a subroutine, or begins one.
    fn streamed(
        &mut self,
        text: &[u8],
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<Info, Status> {
        let head = self.head(text);
        let flow = &mut self.language.borrow_mut().flow;
        if flow.is_broken() {
            return self.refuse(text, head.ok().flatten(), setup, out);
        }
        if let Some(label) = flow.defines {
            return self.define(label, text, head.ok().flatten());
        }
        let begins = !flow.records && flow.skip == Skip::Nothing && self.begins_loop(&head);
        let flow = &mut self.language.borrow_mut().flow;
        let before = flow.record.end();
        let mut at = before;
        if flow.records || begins {
            let added = flow.record.add(text);
            if added.is_err() {
                let begun = head.ok().flatten().filter(|_| begins);
                flow.break_off(begun.map(|head| head.label));
            }
            at = added?;
        }
        let recorded = flow.records;
        flow.records |= begins;
        let done = self.step(text, at, setup, out);
        let language: &mut Language = self.language.borrow_mut();
        if let Err(status) = done {
            language.flow.records = recorded;
            language.flow.record.cut(before);
            if status != Status::Again && recorded {
                language.flow.break_off(None);
            }
        }
        language.flow.settle();
        done
    }

    /// Whether a line begins a loop.
    fn begins_loop(&self, head: &Result<Option<Head>, Status>) -> bool {
        let Ok(Some(head)) = head else { return false };
        match head.keyword {
            Keyword::While => self.language.borrow().flow.top(head.label).is_none(),
            Keyword::Do | Keyword::Repeat => true,
            _ => false,
        }
    }

    /// Refuses a line of a block of which another line has been refused, up to its end. A line that ends the program is
    /// carried out.
    fn refuse(
        &mut self,
        text: &[u8],
        head: Option<Head>,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<Info, Status> {
        if is_program_end(text) {
            self.end_flow();
            return self.without_oword(text, setup, out);
        }
        let language: &mut Language = self.language.borrow_mut();
        if let Some(Head { label, keyword, .. }) = head
            && language.flow.is_broken_by(label)
            && matches!(
                keyword,
                Keyword::Endsub | Keyword::Endwhile | Keyword::Endrepeat | Keyword::While
            )
        {
            language.stop_flow();
        }
        Err(Status::FlowBroken)
    }

    /// Records a line of a subroutine.
    fn define(&mut self, label: Label, text: &[u8], head: Option<Head>) -> Result<Info, Status> {
        let flow = &mut self.language.borrow_mut().flow;
        let keyword = head.map(|head| (head.label, head.keyword));
        let is_nested = matches!(keyword, Some((_, Keyword::Sub)));
        let done = match is_nested {
            true => Err(Status::OWordInvalid),
            false => flow.record.add(text).map(drop),
        };
        let ends = keyword == Some((label, Keyword::Endsub));
        let done = match done {
            Ok(()) if ends => {
                flow.defines = None;
                flow.record.keep(label)
            }
            done => done,
        };
        match done {
            Ok(()) => {}
            Err(_) if ends => flow.stop(),
            Err(_) => {
                flow.break_off(None);
                flow.record.drop_loop();
            }
        }
        done.map(|()| Info::default())
    }

    /// Carries out a line, or skips it. `at` is its place in the record.
    fn step(
        &mut self,
        text: &[u8],
        at: u16,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<Info, Status> {
        out.clear();
        let head = self.head(text);
        let skip = self.language.borrow().flow.skip;
        match (skip, head) {
            (Skip::Nothing, Ok(None)) => self.without_oword(text, setup, out),
            (Skip::Nothing, head) => {
                let Some(head) = head? else { return Ok(Info::default()) };
                self.carry_out(&head, at).map(|()| Info::default())
            }
            (_, Ok(Some(head))) => self.skipped(skip, &head, at).map(|()| Info::default()),
            // What is skipped need not be valid.
            (_, _) => Ok(Info::default()),
        }
    }

    /// Looks at an O word among lines that are skipped.
    fn skipped(&mut self, skip: Skip, head: &Head, at: u16) -> Result<(), Status> {
        let (label, keyword) = (head.label, head.keyword);
        let flow = &mut self.language.borrow_mut().flow;
        let top = flow.top(label).filter(|_| skip == Skip::ToBranch(label));
        match (skip, keyword) {
            (Skip::ToBranch(_), Keyword::Else) if top.is_some() => flow.skip = Skip::Nothing,
            (Skip::ToBranch(_), Keyword::Endif) if top.is_some() => {
                flow.skip = Skip::Nothing;
                flow.close();
            }
            (Skip::ToBranch(_), Keyword::Elseif) if top.is_some() && self.condition(head)? => {
                self.language.borrow_mut().flow.skip = Skip::Nothing;
            }
            (Skip::ToEnd(of), _) if of == label && self.ends(head) => {
                let flow = &mut self.language.borrow_mut().flow;
                flow.skip = Skip::Nothing;
                flow.close();
            }
            (Skip::ToPass(of), _) if of == label && self.ends(head) => {
                self.language.borrow_mut().flow.skip = Skip::Nothing;
                let done = self.carry_out(head, at);
                if done.is_err() {
                    self.language.borrow_mut().flow.skip = skip;
                }
                return done;
            }
            _ => {}
        }
        Ok(())
    }

    /// Whether an O word ends the innermost block.
    fn ends(&self, head: &Head) -> bool {
        let top = self.language.borrow().flow.top(head.label);
        let end = match top.map(|block| block.kind) {
            Some(Kind::If) => Keyword::Endif,
            Some(Kind::While) => Keyword::Endwhile,
            Some(Kind::Do) => Keyword::While,
            Some(Kind::Repeat) => Keyword::Endrepeat,
            None => return false,
        };
        head.keyword == end
    }

    /// Does what an O word says. `at` is the place of its line in the record.
    fn carry_out(&mut self, head: &Head, at: u16) -> Result<(), Status> {
        match head.keyword {
            Keyword::If | Keyword::While | Keyword::Repeat | Keyword::Do => self.begin(head, at),
            Keyword::Call => self.call(head),
            Keyword::Return | Keyword::Endsub => self.leave(head),
            Keyword::Sub => self.sub(head),
            _ => {
                if head.keyword != Keyword::Elseif {
                    ended(head)?;
                }
                self.branch(head)
            }
        }
    }

    /// Begins a condition or a loop, or ends a `do`.
    fn begin(&mut self, head: &Head, at: u16) -> Result<(), Status> {
        let label = head.label;
        let top = self.language.borrow().flow.top(label);
        let amount = match head.keyword {
            Keyword::Do => ended(head).map(|()| 1.0)?,
            _ => self.only_value(head.rest)?,
        };
        let is_true = amount != 0.0;
        let flow = &mut self.language.borrow_mut().flow;
        if let (Keyword::While, Some(Block { kind: Kind::Do, start, .. })) = (head.keyword, top) {
            if is_true {
                flow.go_to(Some(start));
            } else {
                flow.close();
            }
            return Ok(());
        }
        let behind = flow.next().unwrap_or(flow.record.end());
        let (kind, start, count, runs) = match head.keyword {
            Keyword::If => (Kind::If, 0, 0, is_true),
            Keyword::While => (Kind::While, at, 0, is_true),
            Keyword::Do => (Kind::Do, behind, 0, true),
            // Halves go to the even number.
            _ => {
                let count = libm::rint(amount) as i32;
                (Kind::Repeat, behind, count, count > 0)
            }
        };
        flow.open(Block { label, kind, start, count })?;
        if !runs {
            flow.skip = if kind == Kind::If { Skip::ToBranch(label) } else { Skip::ToEnd(label) };
        }
        Ok(())
    }

    /// Ends a branch or a pass.
    fn branch(&mut self, head: &Head) -> Result<(), Status> {
        let label = head.label;
        let ends = self.ends(head);
        let flow = &mut self.language.borrow_mut().flow;
        let top = flow.top(label);
        match (head.keyword, top.map(|block| block.kind)) {
            (Keyword::Elseif | Keyword::Else, Some(Kind::If)) => flow.skip = Skip::ToEnd(label),
            (Keyword::Endwhile, Some(Kind::While)) => {
                flow.close();
                flow.go_to(top.map(|block| block.start));
            }
            (Keyword::Endrepeat, Some(Kind::Repeat)) => {
                if flow.count() {
                    flow.go_to(top.map(|block| block.start));
                } else {
                    flow.close();
                }
            }
            (Keyword::Break, _) if flow.close_to(label) => flow.skip = Skip::ToEnd(label),
            (Keyword::Continue, _) if flow.close_to(label) => flow.skip = Skip::ToPass(label),
            _ if ends => flow.close(),
            _ => return Err(Status::OWordInvalid),
        }
        Ok(())
    }

    /// Begins to record a subroutine.
    fn sub(&mut self, head: &Head) -> Result<(), Status> {
        let flow = &mut self.language.borrow_mut().flow;
        if flow.takes_all() {
            return Err(Status::OWordInvalid);
        }
        flow.record.remove(head.label);
        flow.defines = Some(head.label);
        if flow.record.is_full() {
            flow.break_off(None);
            return Err(Status::RecordFull);
        }
        Ok(())
    }

    /// Calls a subroutine.
    fn call(&mut self, head: &Head) -> Result<(), Status> {
        let start = self.language.borrow().flow.record.sub(head.label);
        let start = start.ok_or(Status::SubUnknown)?;
        let (mut rest, mut arguments) = (head.rest, Vec::<f64, ARGUMENTS>::new());
        while !oword::is_end(rest) {
            let argument = self.with_scope(|scope| bracketed(&mut rest, scope))?;
            arguments.push(argument).map_err(|_| Status::OWordInvalid)?;
        }
        let language: &mut Language = self.language.borrow_mut();
        language.saved.check_room(&language.numbered)?;
        language.flow.call(start)?;
        language.saved.save(&mut language.numbered, language.flow.level());
        for (number, value) in (1..).zip(&arguments) {
            language.numbered.set(number, *value);
        }
        language.named.enter();
        Ok(())
    }

    /// Returns from a subroutine.
    fn leave(&mut self, head: &Head) -> Result<(), Status> {
        let value = match oword::is_end(head.rest) {
            true => None,
            false => Some(self.only_value(head.rest)?),
        };
        let language: &mut Language = self.language.borrow_mut();
        let level = language.flow.level();
        if !language.flow.call_ends() {
            return Err(Status::OWordInvalid);
        }
        language.returned = value;
        language.saved.restore(&mut language.numbered, level);
        language.named.leave();
        Ok(())
    }

    /// Returns whether the condition behind a keyword is true.
    fn condition(&self, head: &Head) -> Result<bool, Status> {
        Ok(self.only_value(head.rest)? != 0.0)
    }

    /// Returns the value in brackets that is all of a text.
    fn only_value(&self, mut rest: Text) -> Result<f64, Status> {
        let value = self.with_scope(|scope| bracketed(&mut rest, scope))?;
        if oword::is_end(rest) { Ok(value) } else { Err(Status::OWordInvalid) }
    }

    fn head<'a>(&self, text: &'a [u8]) -> Result<Option<Head<'a>>, Status> {
        self.with_scope(|scope| oword::head(text, scope))
    }

    fn with_scope<R>(&self, read: impl FnOnce(&Known<T>) -> R) -> R {
        let live = Live { state: &self.state, tables: &self.tables };
        read(&Known { language: self.language.borrow(), live })
    }
}

/// Reads a value in brackets.
fn bracketed<T: Tables>(rest: &mut Text, scope: &Known<T>) -> Result<f64, Status> {
    if rest.peek() != Some(b'[') {
        return Err(Status::OWordInvalid);
    }
    value(rest, scope)
}

/// Checks that nothing but a comment follows a keyword.
fn ended(head: &Head) -> Result<(), Status> {
    if oword::is_end(head.rest) { Ok(()) } else { Err(Status::OWordInvalid) }
}

/// Returns a line without what stands before its words. `None` if a slash deletes it.
fn behind_start(line: &[u8], deletes: bool) -> Option<&[u8]> {
    let mut text = Text::new(line);
    text.peek();
    let mut text = Text::new(comment::skip_mark(text.rest()));
    let deleted = text.eat(b'/') && deletes;
    text.peek();
    (!deleted).then_some(text.rest())
}

/// Whether a line is M2 or M30, and nothing else.
fn is_program_end(text: &[u8]) -> bool {
    let is = |word: &[u8]| {
        let mut text = Text::new(text);
        text.eat_word(word) && oword::is_end(text)
    };
    is(b"M2") || is(b"M02") || is(b"M30")
}
