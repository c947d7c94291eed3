//! Answers a line, as a state machine.
//!
//! The parser task holds the line and calls [`Request::step`] until [`Next::Done`]. It passes the line anew each
//! time. Every line except an empty one gets exactly one response. No response starts before its G-code has run, so a
//! wait for the planner never blocks the transmitter.
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
//!   sdl: Pair -> Files -> Pair, Command -> Files -> Prompt
//!   prog: Pair -> Program -> Pair, Command -> Program -> Prompt
//!   txt: Pair -> as ? and $ -> Prompt -> Pair, or Pair -> Gcode
//! ```

use super::json;
use super::remark::Remark;
use super::token::Group;
use super::write::Writer;
use super::{Format, Mode, help};
use crate::capability::Capability;
use crate::config::Settings;
use crate::protocol::{Answers, Machine, Next, Out, Span};
use crate::status::Status;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub(super) enum Phase {
    /// Sends a malformed line back.
    Echo,
    EchoText,
    /// At a pair of the line's outer object.
    Pair,
    /// At a pair of a group's object.
    Member,
    /// Listing the members of a group.
    List,
    /// At a pair of an object that defines a new status report.
    Select,
    /// At a pair of an object that changes the status report.
    Amend,
    /// The caller has to run the block.
    Gcode,
    /// Reports the block, its message, its line number.
    Block,
    BlockText,
    Message,
    MessageText,
    /// Writes what the block tells.
    #[cfg(feature = "language")]
    Said,
    Number,
    /// All pairs are done, or one has failed: what remains to be reported.
    Warning,
    Advice,
    Footer,
    /// A line of text mode whose output goes into a JSON string.
    Wrap,
    /// A line that begins with `$`.
    Command,
    /// Lists groups in text.
    Listing,
    /// Writes a help screen.
    Help,
    /// Shows the stored program.
    Program,
    /// Lists the files of the SD card.
    #[cfg(feature = "sd")]
    Files,
    /// The defaults have been restored: reports what the firmware is.
    Greeting,
    /// Sends an exception report that was asked for.
    Raise,
    /// Sends a string back.
    Quote,
    /// Writes the prompt, then the status and the line that caused it.
    Prompt,
    Failure,
    Complaint,
    Done,
}

impl Phase {
    /// Whether only text mode has this phase.
    fn is_text(self) -> bool {
        matches!(
            self,
            Self::Wrap
                | Self::Command
                | Self::Listing
                | Self::Help
                | Self::Prompt
                | Self::Failure
                | Self::Complaint
        )
    }
}

/// A line that is being answered.
pub struct Request {
    pub(super) phase: Phase,
    pub(super) status: Status,
    pub(super) format: Format,
    /// The verbosity of the response, fixed when the response begins.
    pub(super) verbosity: u8,
    /// The group whose object is open in the response.
    pub(super) group: Option<Group>,
    /// The part of the line that is G-code.
    pub(super) block: Span,
    /// The length of the line with its line end, as the sender counts it.
    pub(super) length: u16,
    /// In a `txt`: the position to read on after it. Otherwise 0.
    pub(super) resume: u8,
    /// The position to read on in the line.
    pub(super) at: u8,
    /// The progress within a phase that takes several steps.
    pub(super) item: u8,
    /// Whether the response has begun.
    pub(super) begun: bool,
    /// Whether the line is JSON.
    pub(super) is_json: bool,
    /// Whether the block is answered with a prompt.
    is_text: bool,
    /// Whether the block may have a comment, which may contain a message.
    pub(super) commented: bool,
    /// The message that is due.
    pub(super) remark: Remark,
    /// In the phase `Select`: whether an entry has been selected.
    pub(super) selected: bool,
    /// Whether the work of the last step has to be repeated later.
    pub(super) waits: bool,
    /// Whether the line has a `tid`, which is reported at the end.
    pub(super) identified: bool,
}

/// What a step works on.
pub(super) struct Context<'a, M, O> {
    pub line: &'a [u8],
    pub machine: &'a mut M,
    pub out: &'a mut O,
}

#[small]
impl Request {
    /// Starts to answer a line, which comes without its line end. The sender counts `length` bytes for it. `None` if
    /// there is nothing to answer. The line sets `mode`, which applies from now on.
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
            None if !mode.is_text() => return None,
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
            Some(b'$' | b'?' | b'h' | b'H')
                if !Capability::Text.is_built_in() && help::is_text_command(line) =>
            {
                request.fail(Status::NotBuiltIn, Mode::Json);
            }
            Some(_) if !mode.is_text() && settings.wraps_text() && help::is_text_command(line) => {
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
                request.is_text = mode.is_text();
            }
        }
        Some(request)
    }

    /// Answers, with a status, a line that could not be stored. `line` is what is left of the line. The mode does not
    /// change.
    pub fn refused(
        status: Status,
        line: &[u8],
        length: u16,
        mode: Mode,
        settings: &Settings,
    ) -> Request {
        let mut request = Request::new(length, settings);
        if !mode.is_text() && line.first() == Some(&b'{') {
            request.give_back(status);
        } else {
            request.fail(status, mode);
        }
        request
    }

    /// Sends the line back, because it cannot be understood.
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
        self.phase = if mode.is_text() { Phase::Prompt } else { Phase::Warning };
    }

    /// Begins the response, unless it has begun already.
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

    /// Not inlined: together with the machine's view the stack frame would exceed 63 bytes, beyond which an access
    /// takes five instructions.
    #[inline(never)]
    fn step(&mut self, line: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Next {
        // Within a `txt` the line ends before the closing quote of that string.
        let end = match self.resume {
            _ if !Capability::Text.is_built_in() => line.len(),
            0 => line.len(),
            resume => usize::from(resume - 1),
        };
        let line = line.get(..end).unwrap_or(&[]);
        let context = &mut Context { line, machine, out };
        if !Capability::Text.is_built_in() && self.phase.is_text() {
            return Next::Done(Status::InternalError);
        }
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
            #[cfg(feature = "language")]
            Phase::Said => self.said(context),
            Phase::Number => self.number(context),
            Phase::Warning => self.warning(context),
            Phase::Advice => self.advice(context),
            Phase::Footer => self.footer(context),
            Phase::Wrap => self.wrap_line(context),
            Phase::Command => self.command(context),
            Phase::Listing => self.listing(context),
            Phase::Program => self.program(context),
            #[cfg(feature = "sd")]
            Phase::Files => self.next_file(context),
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
