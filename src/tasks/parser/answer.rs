//! The answer to a line. It continues as far as there is room to transmit it, and yields to other tasks after each
//! step.

use super::block::{is_free, run_block};
use super::{Line, Session};
use crate::hal::Thread;
use crate::hal::event::{Event, is_unheard};
use crate::hal::flags;
use crate::hal::serial::USB;
use crate::hal::system;
use crate::hal::time::millis;
use crate::hal::uart;
use crate::machine;
use crate::protocol::{Answers, Next, Out, Request, Span, Speech};
use crate::status::Status;
use crate::tasks::hold;
use crate::tasks::lines::{Class, LineId};
use crate::tasks::links::Links;
use crate::tasks::ports::{Port, REPORT};
use crate::tasks::tx::Tx;
use crate::tasks::view::View;

/// Bytes of an echo that are put in one step.
const ECHO: usize = 62;
/// The most steps of a response in one turn; most answers take six. While the ring of the second port is filling, other
/// tasks get a turn after each step: reading a row of the tables may take 3 ms, and twice that while exec takes most of
/// the CPU.
const STEPS: u8 = 8;
/// The most steps in a turn in which a millisecond has ended.
const STEPS_LATE: u8 = 5;
/// When a turn has taken this long, no further step is begun, ms.
const TURN_MS: u32 = 4;

/// A response under way.
pub(super) struct Answer {
    pub request: Request,
    pub id: LineId,
    /// How much of the line has been sent back.
    pub echoed: u8,
    /// The answer has had a turn.
    pub has_stepped: bool,
    /// The line is to be sent back.
    pub echoes: bool,
    /// The answer waits for the tables.
    pub waits: bool,
    /// The transmitter, held from the first byte of the answer on.
    pub tx: Option<Line>,
}

/// How far an answer has come.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Progress {
    /// The answer is at its end.
    Done,
    /// The answer continues later.
    Waits,
}

/// Goes on with what is under way on a port, step by step while another answer is `awaited`. Returns whether the
/// session has come to its end.
#[inline(never)]
pub(super) fn go_on(
    links: &'static Links,
    port: &'static Port,
    session: &mut Session,
    awaited: bool,
) -> bool {
    match session {
        Session::Idle => return false,
        Session::Leave(tx, since) => {
            if !has_left(links, tx, since) {
                return false;
            }
        }
        Session::Answer(answer) => match answer.step(links, port, awaited) {
            Progress::Waits => return false,
            Progress::Done => {
                finish(links, port, answer.id);
                let changes_rate = links.rate.get().is_some() && port.number == USB;
                if links.restart.get().is_some() || changes_rate {
                    leave(answer.tx.take(), session);
                    return true;
                }
            }
        },
    }
    *session = Session::Idle;
    true
}

/// Makes a session wait until the transmit ring has been sent, before anything else is sent.
#[inline(never)]
#[small]
pub(super) fn leave(tx: Option<Line>, session: &mut Session) {
    if let Some(tx) = tx {
        *session = Session::Leave(tx, None);
    }
}

/// Resets the machine or changes the rate, when the response has left: 1 to 4 ms after its last byte. Returns whether
/// it has left.
#[inline(never)]
#[small]
fn has_left(links: &Links, tx: &mut Tx, since: &mut Option<u16>) -> bool {
    if !tx.is_empty() {
        *since = None;
        return false;
    }
    let now = millis() as u16;
    if now.wrapping_sub(*since.get_or_insert(now)) < tx.last_ms() {
        return false;
    }
    if let Some(boot) = links.restart.take() {
        if boot {
            system::boot(links.thread)
        } else {
            system::reset(links.thread)
        };
    }
    if let Some(rate) = links.rate.take() {
        tx.set_rate(rate);
    }
    true
}

impl Answer {
    /// Returns whether there is room for the next part of the answer; `None` if the answer does not wait for room. A
    /// list continues only while few bytes wait to be sent, because a `?` is answered after them.
    #[inline(never)]
    #[small]
    pub(super) fn may_go_on(&self, port: &Port) -> Option<bool> {
        match &self.tx {
            _ if self.waits => None,
            Some(tx) if self.request.is_list() => Some(tx.is_low()),
            Some(tx) => Some(tx.has_room()),
            None => has_room(port),
        }
    }

    /// Continues as far as there is room.
    #[inline(never)]
    fn step(&mut self, links: &'static Links, port: &'static Port, awaited: bool) -> Progress {
        // The answer to a `?` never counts as one that has had a turn, so that it comes first.
        self.has_stepped = self.id != LineId::NONE;
        if self.waits && links.storage.is_awaited() && !port.asks_report() {
            return Progress::Waits;
        }
        let begun = self.tx.is_some();
        let Some(mut tx) = self.tx.take().or_else(|| port.tx.try_lock().ok()) else {
            return Progress::Waits;
        };
        self.waits = false;
        let (progress, talks) = self.steps(links, port, &mut tx, begun, awaited);
        if talks {
            self.tx = Some(tx);
        }
        progress
    }

    /// Carries the response on while there is room, for a bounded number of steps. Returns how far it has come, and
    /// whether the transmitter is still needed.
    #[inline(never)]
    #[small]
    fn steps(
        &mut self,
        links: &Links,
        port: &Port,
        tx: &mut Tx,
        begun: bool,
        awaited: bool,
    ) -> (Progress, bool) {
        if Speech::HAS_QUESTION {
            match port.lines.borrow().class(self.id) {
                // The sender does not expect the answer any more.
                Class::Gone if !begun => return (Progress::Done, false),
                Class::Fault(_) => self.request.dropped(),
                _ => {}
            }
        }
        let (mut begun, since) = (begun, millis());
        // A `?` is answered in one turn, if its answer is short enough.
        let asks = self.id == LineId::NONE;
        for done in 0..if asks { 2 * STEPS } else { STEPS } {
            // A list takes 50 ms and more, so a report may be put into it.
            if port.asks_report() && self.request.interject() {
                port.take_asked(REPORT);
            }
            if !tx.has_room()
                || (begun && self.request.is_list() && !tx.is_low())
                || (done > 0
                    && (awaited || gives_way(links.thread, if asks { 1 } else { done }, since)))
            {
                break;
            }
            if self.echoes {
                self.echoes = echo(links, port, self.id, &mut self.echoed, tx);
                begun = true;
                continue;
            }
            match step(links, port, self.id, &mut self.request, tx) {
                Next::More => begun = true,
                // Keeps the transmitter if the response has begun: its rest is due.
                Next::Wait => {
                    self.waits = true;
                    return (Progress::Waits, self.request.has_begun());
                }
                Next::Gcode { start, end } => {
                    if !ran(links, port, self.id, Span { start, end }, &mut self.request) {
                        // Nothing of the response has been put yet.
                        self.waits = true;
                        return (Progress::Waits, false);
                    }
                }
                Next::Done(_) => return (Progress::Done, true),
            }
        }
        (Progress::Waits, begun)
    }
}

/// Whether other tasks get a turn before a response continues. The turn has made `done` steps and began at `since`, ms.
#[inline(never)]
#[small]
fn gives_way(thread: Thread, done: u8, since: u32) -> bool {
    let late = || done >= STEPS_LATE && flags::has(Event::Tick);
    uart::presses(thread) || is_unheard() || late() || millis().wrapping_sub(since) >= TURN_MS
}

/// Whether there is room for the first part of an answer. `None` while another task has the transmitter; the parser is
/// woken when it is free.
#[inline(never)]
#[small]
pub(super) fn has_room(port: &Port) -> Option<bool> {
    port.tx.try_lock().ok().map(|tx| tx.has_room())
}

/// Sends a part of the line back, from `at` on. Returns whether there is more. Lines are echoed whole, not byte by
/// byte, so that an echo never stands in the middle of a response or a report, and never loses anything.
#[inline(never)]
#[small]
fn echo(links: &Links, port: &Port, id: LineId, at: &mut u8, tx: &mut Tx) -> bool {
    let lines = port.lines.borrow();
    let rest = lines.text(id).get(usize::from(*at)..).unwrap_or(&[]);
    let part = rest.get(..ECHO).unwrap_or(rest);
    tx.put_all(part.iter().copied());
    *at += part.len() as u8;
    let more = part.len() == ECHO;
    if !more {
        port.speech.get().put_line_end(&links.settings.borrow(), tx);
    }
    tx.flush();
    more
}

/// Carries out the block of a request, or drops it in a queue flush. Returns false if the block has to wait.
#[inline(never)]
fn ran(links: &Links, port: &Port, id: LineId, block: Span, request: &mut Request) -> bool {
    if machine::is_flushing() {
        request.ran(hold::dropped(), false);
        return true;
    }
    let lines = port.lines.borrow();
    let class = lines.class(id);
    if let Class::Fault(status) = class {
        // The line has been dropped since its answer was begun.
        request.ran(status, false);
        return true;
    }
    if links.may_feed(port) && !is_free(links) {
        return false;
    }
    let late = class == Class::Late;
    let (status, commented) = run_block(links, port, block.of(lines.text(id)), false, late);
    if status == Status::Again {
        return false;
    }
    request.ran(status, commented);
    true
}

/// Frees the slot of a line that has been answered.
#[inline(never)]
pub(super) fn finish(links: &Links, port: &Port, id: LineId) {
    port.lines.borrow_mut().remove(id);
    links.pool_space.signal();
    links.reporter_wake.signal();
}

#[inline(never)]
#[small]
fn step(links: &Links, port: &Port, id: LineId, request: &mut Request, tx: &mut Tx) -> Next {
    let lines = port.lines.borrow();
    let next = request.step(lines.text(id), &mut View::of(links, port), tx);
    tx.flush();
    next
}
