//! The answer to a line, which goes on as far as there is room to transmit it, and gives way to others behind each step.

use super::block::{is_free, run_block};
use super::{Line, Session};
use crate::hal::event::{Event, is_unheard};
use crate::hal::flags;
use crate::hal::serial::USB;
use crate::hal::system;
use crate::hal::time::millis;
use crate::hal::uart;
use crate::machine;
use crate::protocol::{Answers, Next, Out, Request, Span};
use crate::status::Status;
use crate::tasks::hold;
use crate::tasks::lines::{Class, LineId};
use crate::tasks::links::Links;
use crate::tasks::ports::{Port, REPORT};
use crate::tasks::tx::Tx;
use crate::tasks::view::View;

/// Bytes of an echo that are put at once.
const ECHO: usize = 62;
/// Most steps of a response before others have their turn: most answers take six. They have it as well behind each step while the
/// ring of the second port is filling: to read a row of the tables may take 3 ms, and twice that while exec takes most of the CPU.
const STEPS: u8 = 8;
/// Most steps in a turn in which a millisecond has ended.
const STEPS_LATE: u8 = 5;
/// No step is begun when a turn has taken so long, ms.
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
    /// Tables have to be waited for.
    pub waits: bool,
    /// From the first byte on: nobody else talks on this port.
    pub tx: Option<Line>,
}

/// How far it has come.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Progress {
    /// The answer is at its end.
    Done,
    /// The answer goes on later.
    Waits,
}

/// Goes on with what is under way on a port, step by step while another is `awaited`. Whether it has come to its end.
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

/// What is in the ring has to leave before anything else is said.
#[inline(never)]
#[small]
pub(super) fn leave(tx: Option<Line>, session: &mut Session) {
    if let Some(tx) = tx {
        *session = Session::Leave(tx, None);
    }
}

/// Does what a response has been waited for if that has left: 1 to 4 ms after its last byte. Whether it has.
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
            system::boot()
        } else {
            system::reset()
        };
    }
    if let Some(rate) = links.rate.take() {
        tx.set_rate(rate);
    }
    true
}

impl Answer {
    /// Whether there is room for the next part of it, of a list only little ahead of what has left: a `?` is answered behind that. `None` if
    /// it does not wait for room.
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

    /// Goes on as far as there is room.
    #[inline(never)]
    fn step(&mut self, links: &'static Links, port: &'static Port, awaited: bool) -> Progress {
        // A `?` is answered first.
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

    /// Carries the response on while there is room, a bounded number of steps. Says how far it has come, and whether the
    /// transmitter is still needed.
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
        if port.drops_unanswered() && !begun && self.id != LineId::NONE {
            // Nobody waits for it.
            return (Progress::Done, false);
        }
        let (mut begun, since) = (begun, millis());
        // A `?` is answered in one turn, if that is short enough.
        let asks = self.id == LineId::NONE;
        for done in 0..if asks { 2 * STEPS } else { STEPS } {
            // A list takes 50 ms and more.
            if port.asks_report() && self.request.interject() {
                port.take_asked(REPORT);
            }
            if !tx.has_room()
                || (begun && self.request.is_list() && !tx.is_low())
                || (done > 0 && (awaited || gives_way(if asks { 1 } else { done }, since)))
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
                // Of a response that has begun the rest is due.
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

/// Whether others have their turn before a response goes on that has come so many steps on in this turn, which began then.
#[inline(never)]
#[small]
fn gives_way(done: u8, since: u32) -> bool {
    let late = || done >= STEPS_LATE && flags::has(Event::Tick);
    uart::presses() || is_unheard() || late() || millis().wrapping_sub(since) >= TURN_MS
}

/// Whether there is room for the first part of an answer; `None` while somebody else talks on the port, whose end wakes the parser.
#[inline(never)]
#[small]
pub(super) fn has_room(port: &Port) -> Option<bool> {
    port.tx.try_lock().ok().map(|tx| tx.has_room())
}

/// Sends a part of the line back, from `at` on. Whether there is more. It is done by the line, not by the byte, so
/// that it never stands in the midst of a response or a report, and never loses anything.
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

/// Carries out the block of a request, if that can be done now; or drops it in a queue flush.
#[inline(never)]
fn ran(links: &Links, port: &Port, id: LineId, block: Span, request: &mut Request) -> bool {
    if machine::is_flushing() {
        request.ran(hold::dropped(), false);
        return true;
    }
    let lines = port.lines.borrow();
    if let Class::Fault(status) = lines.class(id) {
        // It has been dropped since it was begun.
        request.ran(status, false);
        return true;
    }
    if links.may_feed(port) && !is_free(links) {
        return false;
    }
    let (status, commented) = run_block(links, port, block.of(lines.text(id)), false);
    if status == Status::Again {
        return false;
    }
    request.ran(status, commented);
    true
}

/// The line's slot is free again.
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
