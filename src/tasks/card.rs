//! Lines of a file on the SD card, within the turns of the parser task.
//!
//! A line is taken when the planner is free and no answer is under way, after the lines that hosts have sent. While a
//! line is under way, only G-code of hosts waits. A line is carried out as if the host that has chosen the file had
//! sent it, but without its `ok`, and whatever its number is; messages of the line go to that host. If a line cannot be
//! carried out, the host is told, and the next line is taken. An alarm or a flush ends the print; the file stays chosen.
//!
//! Senders of the other dialects count answers, so their files have no answers at all: each line is a block of G-code.
//! Behind M2 or M30 the file ends. A line that is refused ends it, too, because the next one may rely on it; the sender
//! is told the number of the line.
//!
//! Cost: that of a line of the host, and 3,000 cycles for each 40 bytes. Each 512 bytes cost 25,000 more, of thread
//! mode alone.

use heapless::Vec;

use super::links::Links;
use super::parser::{Line as Sender, is_free, run_block};
use super::reporter::tell_at_once;
use super::row;
use super::view::View;
use crate::card::{self, LINE_MAX, Line};
use crate::machine;
use crate::protocol::{Answers, Machine, Next, Notice, Request, Value};
use crate::status::Status;

/// The most steps of an answer in a turn.
const STEPS: u8 = 4;
/// The most pieces of a line in a turn.
const PIECES: u8 = 3;

/// What a piece of the file has brought.
#[derive(Clone, Copy, PartialEq)]
enum Read {
    /// A line, which has been begun.
    Line,
    /// There is more to read.
    More,
    /// There is nothing for now.
    Nothing,
}

/// The line that is being read or carried out.
pub struct Feed {
    line: Vec<u8, LINE_MAX>,
    request: Option<Request>,
    /// The transmitter, while the line is telling something.
    tx: Option<Sender>,
    waits: bool,
    /// A line of the fast path has been interpreted: its move is to be handed to the planner.
    moves: bool,
    /// The line is a block of G-code that has not run yet.
    is_block: bool,
    /// Why a line was refused, which has not been told yet.
    refused: Option<Status>,
}

impl Default for Feed {
    fn default() -> Self {
        Self::new()
    }
}

#[small]
impl Feed {
    /// Returns a feed on which nothing is under way.
    pub const fn new() -> Self {
        Self {
            line: Vec::new(),
            request: None,
            tx: None,
            waits: false,
            moves: false,
            is_block: false,
            refused: None,
        }
    }

    /// Whether a line is under way.
    pub fn is_busy(&self) -> bool {
        self.request.is_some() || self.is_block
    }

    /// Whether the feed needs a turn each millisecond.
    pub fn waits(&self) -> bool {
        self.waits
    }

    /// Whether a move is to be handed over. Returns true once for each move.
    pub fn take_move(&mut self) -> bool {
        core::mem::take(&mut self.moves)
    }

    /// Takes a turn. Returns whether there may be more to do at once.
    #[inline(never)]
    pub fn turn(&mut self, links: &'static Links) -> bool {
        self.waits = false;
        if self.request.is_some() {
            return self.go_on(links);
        }
        if let Some(status) = self.refused {
            return self.refuse(links, status);
        }
        #[cfg(feature = "card-write")]
        links.card.borrow_mut().leave();
        // The part of a line that has been read is kept, because M24 continues after it.
        if !card::prints() {
            // The line of a run that an alarm has ended.
            if core::mem::take(&mut self.is_block) {
                self.line.clear();
            }
            return false;
        }
        if machine::is_alarmed() {
            let _ = links.card.borrow_mut().print(false);
            return false;
        }
        if !is_free(links) {
            return false;
        }
        if self.is_block {
            return self.run(links);
        }
        let mut read = Read::More;
        for _ in 0..PIECES {
            read = self.read(links);
            if read != Read::More {
                break;
            }
        }
        match read {
            Read::More => true,
            Read::Nothing => false,
            Read::Line if self.is_block => self.run(links),
            Read::Line => self.request.is_none() || self.go_on(links),
        }
    }

    /// Runs the line as a block of G-code. Returns whether there may be more to do at once.
    #[inline(never)]
    fn run(&mut self, links: &'static Links) -> bool {
        let (status, _) = run_block(links, links.told(), &self.line, false, false);
        if status == Status::Again {
            self.waits = true;
            return false;
        }
        self.is_block = false;
        self.line.clear();
        match status {
            Status::Ok if links.command_sender().ends_program() => {
                links.card.borrow_mut().end();
                true
            }
            Status::Ok | Status::Noop => true,
            status => self.refuse(links, status),
        }
    }

    /// Ends the file, and tells why and at which line, as soon as there is room for that.
    fn refuse(&mut self, links: &'static Links, status: Status) -> bool {
        let _ = links.card.borrow_mut().print(false);
        let line = links.card.borrow().lines();
        let told = tell_at_once(links, links.told(), Notice::FileLine(line, status));
        self.refused = (!told).then_some(status);
        self.waits = !told;
        if told {
            links.card.borrow_mut().close();
        }
        told
    }

    // Not inlined, to keep this apart from carrying out a line, which has the deepest stack.
    #[inline(never)]
    fn read(&mut self, links: &'static Links) -> Read {
        let read = links.card.borrow_mut().line(&mut self.line);
        match read {
            Line::More => return Read::More,
            Line::Later => {
                self.waits = true;
                return Read::Nothing;
            }
            // A percent sign begins and ends many files, and says nothing.
            Line::Whole if !links.told().is_plain() && self.line.trim_ascii() == b"%" => {}
            Line::Whole if !self.line.is_empty() && !links.told().is_plain() => {
                self.is_block = true;
                return Read::Line;
            }
            Line::Whole if !self.line.is_empty() => {
                self.moves = row::interpret(links, &self.line);
                if self.moves {
                    self.line.clear();
                } else {
                    self.begin(links);
                }
                return Read::Line;
            }
            Line::Whole => {}
            Line::Long if !links.told().is_plain() => {
                self.line.clear();
                self.refuse(links, Status::InputTooLong);
                return Read::Nothing;
            }
            Line::Long => links.except(Status::InputTooLong),
            Line::Failed => {
                links.card.borrow_mut().release();
                links.except(Status::CardError);
            }
            // The file ends when all its lines have been carried out.
            Line::End if View::of(links, links.told()).value(Value::Working) != 0 => {
                self.waits = true;
                return Read::Nothing;
            }
            Line::End => {
                links.card.borrow_mut().close();
                links.except(Status::EndOfFile);
            }
        }
        self.line.clear();
        match read {
            Line::End | Line::Failed => Read::Nothing,
            _ => Read::More,
        }
    }

    fn begin(&mut self, links: &Links) {
        let settings = links.settings.borrow();
        let mut speech = links.told().speech.get().in_file(&settings);
        let length = self.line.len() as u16;
        self.request = Request::begin(&self.line, length, &mut speech, &settings);
    }

    fn go_on(&mut self, links: &'static Links) -> bool {
        let port = links.told();
        let Some(request) = &mut self.request else { return true };
        let Some(mut tx) = self.tx.take().or_else(|| port.tx.try_lock().ok()) else {
            self.waits = true;
            return false;
        };
        for _ in 0..STEPS {
            if !tx.has_room() {
                self.waits = true;
                break;
            }
            let next = request.step(&self.line, &mut View::of(links, port), &mut *tx);
            tx.flush();
            match next {
                Next::More => {}
                Next::Wait => {
                    self.waits = true;
                    break;
                }
                Next::Gcode { start, end } => {
                    let block = self.line.get(start.into()..end.into()).unwrap_or(&[]);
                    if !is_free(links) {
                        self.waits = true;
                        break;
                    }
                    match run_block(links, port, block, false, false) {
                        (Status::Again, _) => {
                            self.waits = true;
                            break;
                        }
                        (status, commented) => request.ran(status, commented),
                    }
                }
                Next::Done(_) => {
                    self.request = None;
                    self.line.clear();
                    return true;
                }
            }
        }
        if request.has_begun() {
            self.tx = Some(tx);
        }
        !self.waits
    }
}
