//! Answers a line.
//!
//! The output of a code comes before the `ok`, one part per step. Conditions that the code waits for (standstill,
//! homing, memory) are polled each millisecond, at 2,000 cycles. Nothing of the answer has been written by then, so
//! other output may come first.

use super::command;
use super::frame::{Fault, Frame, Session, Sum};
use super::host::{self, Code, Step};
use super::status::{is_passed_over, is_unknown, reason};
use super::translate;
use super::write::{cold, int, line_end, text};
use crate::card;
use crate::progmem::Text;
use crate::protocol::{Answers, Extruder, Machine, Next, Out, Span};
use crate::status::Status;
use crate::{plain, text};

/// A line that is being answered.
pub struct Request {
    what: What,
    /// The progress. Its meaning depends on `what`. For G-code: [`WAITS`], or 0.
    at: u8,
    block: Span,
    begun: bool,
    silent: bool,
}

/// What the next step does.
#[derive(Clone, Copy)]
enum What {
    /// Writes `ok`.
    Nothing,
    /// Runs the line as G-code.
    Gcode,
    /// Reports that filament is too cold to be moved, and runs the line without the extruder.
    Cold,
    /// Runs the line again, after [`What::Cold`].
    Rest,
    /// Performs a code that the interpreter does not run.
    Host(Code),
    /// Asks for the line after this one.
    Resend(Fault, i32),
    /// Reports why the line was refused.
    Refused(Status),
}

/// The most bytes of a line that a step writes.
const PART: usize = 40;
/// The line is answered only when its G-code is done.
const WAITS: u8 = 1;
/// M400.
const FINISHED: Code = (b'M', 400);
/// M105.
const TEMPERATURES: Code = (b'M', 105);
/// M118.
const TEXT: Code = (b'M', 118);

impl Request {
    /// Starts to answer a line.
    #[inline(never)]
    #[small]
    pub(super) fn begin(line: &[u8], session: &mut Session) -> Self {
        let frame = Frame::of(line);
        let block = frame.block.of(line);
        let code = command::code(block);
        let what = match take(&frame, code, line, session) {
            Err(fault) => What::Resend(fault, session.last),
            Ok(()) if block.is_empty() => What::Nothing,
            // The line is run as G-code is, and is written to the file for that.
            Ok(()) if card::writes() && !passes(code, &frame, line) => What::Gcode,
            Ok(()) => of(code, block),
        };
        let silent = session.in_file;
        let at = match what {
            What::Gcode => (command::waits(code) && !card::writes()).into(),
            // Behind the `ok`.
            What::Host(TEMPERATURES) => silent.into(),
            _ => 0,
        };
        Self { what, at, block: frame.text(line), begun: false, silent }
    }

    /// Starts to answer a line that could not be kept, or was dropped.
    #[small]
    pub(super) fn refused(status: Status, line: &[u8], session: &mut Session) -> Self {
        let mut frame = Frame::of(line);
        let is_long = frame.number.is_some();
        let taken = match status {
            // The end of the line, with the checksum, has not been kept.
            Status::InputTooLong | Status::BufferFull if is_long => {
                frame.sum = match session.sums {
                    // The line looks like several.
                    _ if status == Status::BufferFull => Sum::Cut,
                    true => Sum::Right,
                    false => Sum::None,
                };
                session.take(&frame, None, false).map(|()| Status::InputTooLong)
            }
            Status::InputTooLong | Status::BufferFull if session.sums => Err(Fault::Sum),
            Status::InputTooLong | Status::BufferFull => Ok(status),
            _ => take(&frame, command::code(frame.block.of(line)), line, session).map(|()| status),
        };
        let what = match taken {
            Err(fault) => What::Resend(fault, session.last),
            Ok(status) => What::Refused(status),
        };
        Self { what, at: 0, block: frame.block, begun: false, silent: false }
    }
}

/// Whether a line is carried out even while lines are written to a file.
#[small]
fn passes(code: Option<Code>, frame: &Frame, line: &[u8]) -> bool {
    matches!(code, Some((b'M', 28 | 29 | 110 | 999))) || command::overtakes(frame, line)
}

/// Returns how a line is carried out.
#[small]
fn of(code: Option<Code>, block: &[u8]) -> What {
    let own = host::of(code, block);
    match own.or(code.filter(|code| translate::leaves_out(*code))) {
        Some(code) if command::says_more(code, block) => What::Refused(Status::AxisConflict),
        Some(code) if command::has_bad_number(code, block) => What::Refused(Status::OutOfRange),
        _ => own.map_or(What::Gcode, What::Host),
    }
}

/// Whether the text of an M118 may not begin like an answer: it gets `echo:` then.
fn is_plain_text(block: &[u8]) -> bool {
    !matches!(command::words(block).first(), Some(b'/' | b'A' | b'E'))
}

/// Checks the line's number and checksum, and counts the line.
#[small]
fn take(
    frame: &Frame,
    code: Option<Code>,
    line: &[u8],
    session: &mut Session,
) -> Result<(), Fault> {
    let block = frame.block.of(line);
    let sets = match code {
        Some((b'M', 110)) if command::has(block, b'N') => command::value(block, b'N', 0),
        Some((b'M', 110)) => frame.number,
        _ => None,
    };
    session.take(frame, sets, command::overtakes(frame, line))
}

#[small]
impl Answers for Request {
    fn gcode(&self) -> Option<Span> {
        matches!(self.what, What::Gcode).then_some(self.block)
    }

    fn ran(&mut self, status: Status, _comment: bool) {
        self.what = match status {
            Status::Ok if self.at == WAITS && !self.silent => What::Host(FINISHED),
            Status::Ok | Status::Noop => What::Nothing,
            Status::TooCold if matches!(self.what, What::Gcode) => What::Cold,
            status => What::Refused(status),
        };
        self.at = 0;
    }

    #[inline(never)]
    fn step(&mut self, line: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Next {
        let block = self.block.of(line);
        match self.what {
            What::Cold => {
                cold(out);
                machine.extruder(Extruder::LeaveOut);
                self.what = What::Rest;
            }
            What::Gcode | What::Rest => {
                let Span { start, end } = self.block;
                return Next::Gcode { start, end };
            }
            What::Nothing => {
                if !self.silent {
                    out.put_plain(plain!("ok\n"));
                }
                return Next::Done(Status::Ok);
            }
            What::Host(TEXT) if self.silent && !self.begun && is_plain_text(block) => {
                text(out, text!("echo:"));
                self.begun = true;
            }
            What::Host(code) => match host::part(code, self.at, block, machine, out) {
                Step::At(at) => (self.at, self.begun) = (at, true),
                Step::Later(at) => {
                    self.at = at;
                    return Next::Wait;
                }
                Step::Done => self.what = What::Nothing,
                Step::Gcode => (self.what, self.at) = (What::Gcode, 0),
                Step::Answered => return Next::Done(Status::Ok),
                Step::Refused(status) => (self.what, self.at) = (What::Refused(status), 0),
            },
            What::Resend(fault, last) => {
                self.begun = true;
                self.resend(fault, last, out);
            }
            What::Refused(status) if is_unknown(status, block) => {
                self.begun = true;
                self.unknown(block, out);
            }
            What::Refused(status) => {
                self.begun = true;
                let goes_on = is_passed_over(status, block);
                text(out, if goes_on { text!("echo:") } else { text!("Error:") });
                text(out, reason(status));
                line_end(out);
                self.what = What::Nothing;
            }
        }
        Next::More
    }

    fn has_begun(&self) -> bool {
        self.begun
    }

    #[inline(never)]
    #[small]
    fn awaits_rest(&self, line: &[u8]) -> bool {
        match self.what {
            What::Host(code) => host::needs_rest(code, self.block.of(line)),
            _ => false,
        }
    }
}

#[small]
impl Request {
    /// Writes `Error:checksum mismatch, Last Line: 3`, then `Resend: 4`. A line of a file does not come again.
    fn resend(&mut self, fault: Fault, last: i32, out: &mut impl Out) {
        if self.at == 0 {
            self.at = 1;
            let why: Text = match fault {
                Fault::Sum => text!("Error:checksum mismatch"),
                Fault::NoSum => text!("Error:checksum missing"),
                Fault::Number => text!("Error:wrong line number"),
            };
            text(out, why);
            if self.silent {
                self.what = What::Nothing;
            } else {
                text(out, text!(", Last Line: "));
                int(out, last);
            }
        } else {
            text(out, text!("Resend: "));
            int(out, last.wrapping_add(1));
            self.what = What::Nothing;
        }
        line_end(out);
    }

    /// Writes `echo:Unknown command: "M777"`.
    fn unknown(&mut self, block: &[u8], out: &mut impl Out) {
        if self.at == 0 {
            text(out, text!("echo:Unknown command: \""));
            self.at = 1;
            return;
        }
        let part = block.get(..PART.min(block.len())).unwrap_or(&[]);
        out.put_all(part.iter().copied());
        out.put(b'"');
        line_end(out);
        self.what = What::Nothing;
    }
}
