//! A line on its way through the protocol.
//!
//! The parser task holds the line and calls [`Request::step`] until [`Next::Done`], handing the line
//! in anew each time. Every line but an empty one gets exactly one response. No response is begun
//! before its G-code has run, so a wait for the planner never holds up the transmitter.
//!
//! ```text
//!   line --{--> check --bad--> Echo ------------------------------> Warning -> Advice -> Footer
//!                 | ok                                                 ^
//!                 v   group GET                                        | end, or error
//!               Pair <--------> List <- Select                         |
//!                | ^ \--------> Member, Amend                          |
//!      gc        v |                                                   |
//!   G-code ---> Gcode -> Block -> Message -> Number -------------------+
//!                  \  text mode
//!   ? -> Listing ---+-> Prompt -> (Failure -> Complaint) -> Message
//!   $ -> Command -> Listing, One or Help -> Prompt
//!   defa: Pair -> Greeting -> Pair      er: Pair -> Raise -> Warning      msg: Pair -> Quote -> Pair
//!   prog: Pair -> Program -> Pair, Command -> Program -> Prompt
//!   txt: Pair -> as ? and $ -> Prompt -> Pair, or Pair -> Gcode
//! ```

use super::json;
use super::remark::Remark;
use super::token::Group;
use super::write::Writer;
use super::{Format, Mode, help};
use crate::config::Settings;
use crate::protocol::{Answers, Machine, Next, Out, Span};
use crate::status::Status;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub(super) enum Phase {
    /// A malformed line is given back.
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
    /// At a pair of what the status report gains and loses.
    Amend,
    /// The caller is to run the block.
    Gcode,
    /// The block, its message, its line number.
    Block,
    BlockText,
    Message,
    MessageText,
    Number,
    /// All is carried out, or something has failed: what has to be told yet.
    Warning,
    Advice,
    Footer,
    /// A line of text mode that is answered in a string.
    Wrap,
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
    /// An exception report that was asked for.
    Raise,
    /// Giving a string back.
    Quote,
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
    /// The verbosity of the response, fixed when it begins.
    pub(super) verbosity: u8,
    /// The group whose object is open.
    pub(super) group: Option<Group>,
    /// The G-code in the line.
    pub(super) block: Span,
    /// The length of the line with its end, as its sender counts it.
    pub(super) length: u16,
    /// In a `txt`: where to read on behind it. Else 0.
    pub(super) resume: u8,
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
    pub(super) remark: Remark,
    /// Something has been selected in the phase `Select`.
    pub(super) selected: bool,
    /// What the last step was to do has to wait.
    pub(super) waits: bool,
    /// The line has a `tid`, which is told at the end.
    pub(super) identified: bool,
}

/// What a step works with.
pub(super) struct Context<'a, M, O> {
    pub line: &'a [u8],
    pub machine: &'a mut M,
    pub out: &'a mut O,
}

#[small]
impl Request {
    /// Begins with a line, without its terminator; its sender counts `length` bytes for it. `None` if there is
    /// nothing to answer. The line decides the `mode` from now on.
    ///
    /// A JSON line is checked as a whole here: up to 20,000 cycles on AVR.
    pub fn begin(
        line: &[u8],
        length: u16,
        mode: &mut Mode,
        settings: &Settings,
    ) -> Option<Request> {
        if line.len() > usize::from(u8::MAX) {
            return Some(Request::refused(Status::InputTooLong, &[], length, *mode, settings));
        }
        let mut request = Request::new(length, settings);
        let start = json::skip_blanks(line);
        let end = line.len() as u8;
        match line.get(usize::from(start)) {
            None if *mode == Mode::Json => return None,
            None => request.phase = Phase::Prompt,
            Some(b'{') => {
                *mode = Mode::Json;
                request.at = start + 1;
                match json::check(line) {
                    Ok(()) => {
                        request.is_json = true;
                        request.phase = Phase::Pair;
                    }
                    Err(status) => request.give_back(status),
                }
            }
            Some(_)
                if *mode == Mode::Json && settings.wraps_text() && help::is_text_command(line) =>
            {
                request.block = Span { start, end };
                request.phase = Phase::Wrap;
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

    /// Answers a line that could not be kept with a status; `line` is what is left of it. It leaves the mode as it is.
    pub fn refused(
        status: Status,
        line: &[u8],
        length: u16,
        mode: Mode,
        settings: &Settings,
    ) -> Request {
        let mut request = Request::new(length, settings);
        if mode == Mode::Json && line.first() == Some(&b'{') {
            request.give_back(status);
        } else {
            request.fail(status, mode);
        }
        request
    }

    /// Gives the line back, for it makes no sense.
    fn give_back(&mut self, status: Status) {
        self.status = status;
        self.phase = Phase::Echo;
    }

    fn new(length: u16, settings: &Settings) -> Request {
        Request {
            phase: Phase::Gcode,
            status: Status::Ok,
            format: Format::plain(settings),
            verbosity: 0,
            group: None,
            block: Span::default(),
            length,
            resume: 0,
            at: 0,
            item: 0,
            begun: false,
            is_json: false,
            is_text: false,
            commented: true,
            remark: Remark::None,
            selected: false,
            waits: false,
            identified: false,
        }
    }

    pub(super) fn fail(&mut self, status: Status, mode: Mode) {
        self.status = status;
        self.phase = if mode == Mode::Text { Phase::Prompt } else { Phase::Warning };
    }

    /// Begins the response, if it has not begun.
    pub(super) fn open<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        if core::mem::replace(&mut self.begun, true) {
            return;
        }
        let settings = c.machine.settings();
        self.verbosity = settings.json_verbosity();
        self.format = Format::response(settings);
        Writer::frame(c.out, &mut self.format).begin_response();
    }
}

#[small]
impl Answers for Request {
    fn gcode(&self) -> Option<Span> {
        (self.phase == Phase::Gcode).then_some(self.block)
    }

    fn ran(&mut self, status: Status, commented: bool) {
        if self.phase == Phase::Gcode {
            self.status = status;
            self.commented = commented;
            self.phase = if self.is_text { Phase::Prompt } else { Phase::Block };
        }
    }

    /// Not inlined: with the machine's view in its frame it would reach beyond 63 bytes, at five instructions an access.
    #[inline(never)]
    fn step(&mut self, line: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Next {
        // Within a `txt` the line ends where that does, before its quote.
        let end = match self.resume {
            0 => line.len(),
            resume => usize::from(resume - 1),
        };
        let line = line.get(..end).unwrap_or(&[]);
        let context = &mut Context { line, machine, out };
        match self.phase {
            Phase::Echo => self.echo(context),
            Phase::EchoText => self.echo_text(context),
            Phase::Pair => self.pair(context),
            Phase::Member => self.member(context),
            Phase::List => self.list(context),
            Phase::Select => self.select(context),
            Phase::Amend => self.amend(context),
            Phase::Gcode => return Next::Gcode { start: self.block.start, end: self.block.end },
            Phase::Block => self.block(context),
            Phase::BlockText => self.block_text(context),
            Phase::Message => self.message(context),
            Phase::MessageText => self.message_text(context),
            Phase::Number => self.number(context),
            Phase::Warning => self.warning(context),
            Phase::Advice => self.advice(context),
            Phase::Footer => self.footer(context),
            Phase::Wrap => self.wrap_line(context),
            Phase::Command => self.command(context),
            Phase::Listing => self.listing(context),
            Phase::Program => self.program(context),
            Phase::Help => self.help_line(context),
            Phase::Greeting => self.greeting(context),
            Phase::Raise => self.raise(context),
            Phase::Quote => self.quote(context),
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

    fn has_begun(&self) -> bool {
        self.begun
    }
}
