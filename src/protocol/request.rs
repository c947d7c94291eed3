//! A line on its way through the protocol.
//!
//! The parser task holds the line and calls [`Request::step`] until [`Next::Done`], handing the line
//! in anew each time. Every line but an empty one gets exactly one response. No response is begun
//! before its G-code has run, so a wait for the planner never holds up the transmitter.
//!
//! ```text
//!   line --{--> check --bad--> Echo ------------------------------> Warning -> Footer
//!                 | ok                                                 ^
//!                 v   group GET                                        | end, or error
//!               Pair <--------> List <- Select                         |
//!                | ^ \--------> Member                                 |
//!      gc        v |                                                   |
//!   G-code ---> Gcode -> Block -> Message -> Number -------------------+
//!                  \  text mode
//!   ? -> Listing ---+-> Prompt -> (Failure -> Complaint) -> Message
//!   $ -> Command -> Listing or Help -> Prompt
//!   defa: Pair -> Greeting -> Pair       prog: Pair -> Program -> Pair, Command -> Program -> Prompt
//! ```

use super::block::byte_of;
use super::json::{self, Span};
use super::machine::{Machine, Warning};
use super::token::Group;
use super::write::{Format, Out, Writer};
use super::{Mode, help, value::Value};
use crate::status::Status;
use crate::text;

/// What the caller does next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Next {
    /// Step again.
    More,
    /// Run this part of the line as G-code, call [`Request::ran`], and step again.
    Gcode {
        /// Its first byte.
        start: u8,
        /// The byte behind it.
        end: u8,
    },
    /// What is to be changed is still on its way to memory: step again later.
    Wait,
    /// The response is complete.
    Done(Status),
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub(super) enum Phase {
    /// Of a malformed line: give it back.
    Echo,
    EchoText,
    /// At a pair of the line's object.
    Pair,
    /// At a pair of a group's object.
    Member,
    /// Listing the members of a group.
    List,
    /// At a pair of a new status report.
    Select,
    /// The caller is to run the block.
    Gcode,
    /// The block, its message, its line number.
    Block,
    BlockText,
    Message,
    MessageText,
    Number,
    Warning,
    Footer,
    /// A line that begins with `$`.
    Command,
    /// Groups in text.
    Listing,
    /// Help in text.
    Help,
    /// The program that is kept.
    Program,
    /// The defaults have been restored: tell who we are.
    Greeting,
    /// The prompt, a status, the line that caused it.
    Prompt,
    Failure,
    Complaint,
    Done,
}

/// A line being answered.
pub struct Request {
    pub(super) phase: Phase,
    pub(super) status: Status,
    pub(super) format: Format,
    /// Of the response, fixed when it begins.
    pub(super) verbosity: u8,
    /// The group whose object is open.
    pub(super) group: Option<Group>,
    /// The G-code in the line.
    pub(super) block: Span,
    /// Where to read on in the line.
    pub(super) at: u8,
    /// Where a phase that takes several steps has got to.
    pub(super) item: u8,
    /// The response has begun.
    pub(super) begun: bool,
    /// The line is JSON.
    pub(super) is_json: bool,
    /// The block is answered with a prompt.
    is_text: bool,
    /// The block may have a comment, and that a message.
    pub(super) commented: bool,
    /// The message that is due.
    pub(super) warning: Warning,
    /// Of the phase `Select`: something has been selected.
    pub(super) selected: bool,
    /// What the last step was to do has to wait.
    pub(super) waits: bool,
}

/// What a step works with.
pub(super) struct Context<'a, M, O> {
    pub line: &'a [u8],
    pub machine: &'a mut M,
    pub out: &'a mut O,
}

impl Request {
    /// Begins with a line, without its terminator; `None` if there is nothing to answer. The line
    /// decides the `mode` from now on.
    ///
    /// A JSON line is checked as a whole here: up to 20,000 cycles on AVR.
    pub fn begin(line: &[u8], mode: &mut Mode) -> Option<Request> {
        if line.len() > usize::from(u8::MAX) {
            return Some(Request::refused(Status::InputTooLong, *mode));
        }
        let mut request = Request::new();
        let start = json::skip_blanks(line);
        let end = line.len() as u8;
        match line.get(usize::from(start)) {
            None if *mode == Mode::Json => return None,
            None => request.phase = Phase::Prompt,
            Some(b'{') => {
                *mode = Mode::Json;
                request.is_json = true;
                request.at = start + 1;
                request.phase = if json::check(line) { Phase::Pair } else { Phase::Echo };
            }
            Some(b'?') => {
                *mode = Mode::Text;
                request.enlist(Some(Group::Report), None);
            }
            Some(b'$') => {
                *mode = Mode::Text;
                request.at = start + 1;
                request.phase = Phase::Command;
            }
            Some(b'h' | b'H') if help::asks_help(line) => {
                *mode = Mode::Text;
                request.help(help::GENERAL);
            }
            Some(_) => {
                request.block = Span { start, end };
                request.is_text = *mode == Mode::Text;
            }
        }
        Some(request)
    }

    /// Answers a line that could not be kept with a status.
    pub fn refused(status: Status, mode: Mode) -> Request {
        let mut request = Request::new();
        request.fail(status, mode);
        request
    }

    fn new() -> Request {
        Request {
            phase: Phase::Gcode,
            status: Status::Ok,
            format: Format::plain(),
            verbosity: 0,
            group: None,
            block: Span::default(),
            at: 0,
            item: 0,
            begun: false,
            is_json: false,
            is_text: false,
            commented: true,
            warning: Warning::None,
            selected: false,
            waits: false,
        }
    }

    pub(super) fn fail(&mut self, status: Status, mode: Mode) {
        self.status = status;
        self.phase = if mode == Mode::Text { Phase::Prompt } else { Phase::Warning };
    }

    /// The G-code that the next step would ask for with [`Next::Gcode`], if that is so already.
    pub fn gcode(&self) -> Option<Span> {
        (self.phase == Phase::Gcode).then_some(self.block)
    }

    /// The G-code that [`Next::Gcode`] named has run, with this status; whether it had a comment.
    pub fn ran(&mut self, status: Status, commented: bool) {
        if self.phase == Phase::Gcode {
            self.status = status;
            self.commented = commented;
            self.phase = if self.is_text { Phase::Prompt } else { Phase::Block };
        }
    }

    /// Does the next bit of work and puts at most [`CHUNK`](super::CHUNK) bytes.
    pub fn step(&mut self, line: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Next {
        let context = &mut Context { line, machine, out };
        match self.phase {
            Phase::Echo => self.echo(context),
            Phase::EchoText => self.echo_text(context),
            Phase::Pair => self.pair(context),
            Phase::Member => self.member(context),
            Phase::List => self.list(context),
            Phase::Select => self.select(context),
            Phase::Gcode => return Next::Gcode { start: self.block.start, end: self.block.end },
            Phase::Block => self.block(context),
            Phase::BlockText => self.block_text(context),
            Phase::Message => self.message(context),
            Phase::MessageText => self.message_text(context),
            Phase::Number => self.number(context),
            Phase::Warning => self.warning(context),
            Phase::Footer => self.footer(context),
            Phase::Command => self.command(context),
            Phase::Listing => self.listing(context),
            Phase::Program => self.program(context),
            Phase::Help => self.help_line(context),
            Phase::Greeting => self.greeting(context),
            Phase::Prompt => self.prompt(context),
            Phase::Failure => self.failure(context),
            Phase::Complaint => self.complaint(context),
            Phase::Done => return Next::Done(self.status),
        }
        match self.phase {
            _ if core::mem::take(&mut self.waits) => Next::Wait,
            Phase::Done => Next::Done(self.status),
            _ => Next::More,
        }
    }

    /// Whether something of the response has been put.
    pub fn has_begun(&self) -> bool {
        self.begun
    }

    /// Begins the response, if it has not begun.
    pub(super) fn open<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        if core::mem::replace(&mut self.begun, true) {
            return;
        }
        let settings = c.machine.settings();
        self.verbosity = settings.json_verbosity();
        self.format = Format::response(settings.json_strict(), self.verbosity);
        let mut writer = Writer::frame(c.out, &mut self.format);
        writer.open();
        writer.key_text(text!("r"));
        writer.open();
    }

    fn warning<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        self.open(c);
        let text = self.warning.text();
        if !text.is_empty() {
            let mut writer = Writer::body(c.out, &mut self.format);
            writer.key_text(text!("msg"));
            writer.string(text);
        }
        self.phase = Phase::Footer;
    }

    fn footer<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let free = c.machine.value(Value::SlotsFree);
        let mut writer = Writer::frame(c.out, &mut self.format);
        writer.close();
        writer.footer(self.status as u8, free);
        self.phase = Phase::Done;
    }

    fn echo<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        self.status = Status::JsonSyntax;
        self.open(c);
        let mut writer = Writer::body(c.out, &mut self.format);
        writer.key_text(text!("err"));
        writer.byte(b'"');
        self.phase = Phase::EchoText;
    }

    fn echo_text<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let mut writer = Writer::body(c.out, &mut self.format);
        for _ in 0..super::CHUNK / 2 {
            let Some(byte) = byte_of(c.line, self.item, u8::MAX) else {
                writer.byte(b'"');
                self.phase = Phase::Warning;
                return;
            };
            writer.escaped(byte);
            self.item = self.item.saturating_add(1);
        }
    }
}
