//! The parser task: takes lines, answers them, and hands what they ask for to the planner.
//!
//! Reads the line pools, writes `Links::commands`, the G-code model, the settings and the response;
//! waits for lines, for the planner, and for room to transmit. Control lines are taken at any time,
//! data lines of the port that feeds the machine only while the planner is free and no built-in job runs, so that a long job never locks the sender out. A line
//! that has to wait for the tables ([`Status::Again`]) stays where it is, and so do those behind it. A line
//! keeps its slot until its response has been written. Plain moves are done with at once, in a [`row`]. In an
//! alarm lines of G-code are refused.
//!
//! Each port has a [`Session`] of its own, so that no port waits for the other's line: no line is begun before the first part
//! of its response has room in the transmit ring, and a response that lacks room stays half written until there is some.

use core::future::poll_fn;
use core::task::Poll;

use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::mutex::MutexGuard;
use heapless::Vec;

use super::Never;
use super::alarm;
#[cfg(feature = "dialect-reprap")]
use super::heat;
use super::hold;
use super::lines::{Class, LineId};
use super::links::Links;
use super::planner;
use super::ports::{Chosen, Port, REPORT};
use super::reporter::{tell_at_once, tell_startup};
use super::row::{self, Row};
use super::tx::Tx;
use super::view::View;
use crate::gcode::command::Stop;
use crate::hal::eeprom::Eeprom;
use crate::hal::event::{
    Event, is_unheard, is_wanted, set_asked, wake_after, wake_after_transmitted,
};
use crate::hal::flags;
use crate::hal::serial::{PORTS, USB};
use crate::hal::system;
use crate::hal::time::millis;
use crate::hal::uart;
use crate::jobs::Job;
use crate::machine::alarm::is_program_end;
use crate::machine::{self, Alarm, Cycle};
use crate::protocol::{Answers, Next, Notice, Out, Request, Span, asks_alarm, jog};
use crate::status::Status;

/// Bytes of an echo that are put at once.
const ECHO: usize = 62;
/// Most steps of a response before others have their turn: most answers take six. They have it as well behind each step while the
/// ring of the second port is filling: to read a row of the tables may take 3 ms, and twice that while exec takes most of the CPU.
const STEPS: u8 = 8;
/// Most steps in a turn in which a millisecond has ended.
const STEPS_LATE: u8 = 5;
/// No step is begun when a turn has taken so long, ms.
const TURN_MS: u32 = 4;

/// Turns that an answer leaves in a row to those on other ports that have had none.
const PATIENCE: u8 = 8;
/// What [`Parser::turns`] returns for a port on which no answer can go on.
const NONE: u8 = u8::MAX;

/// How many turns in a row an answer leaves to a report that ends its line for it.
const LEAVES: u8 = 2;

/// A port's transmitter, while it is the parser's.
pub(super) type Line = MutexGuard<'static, NoopRawMutex, Tx>;

/// What the parser is about on a port.
enum Session {
    /// The parser does nothing on the port.
    Idle,
    /// The parser answers a line.
    Answer(Answer),
    /// The line has been answered; it changes the rate, or resets the machine, when the response has left: since when
    /// there is nothing more of that in the ring, ms.
    Leave(Line, Option<u16>),
}

/// A response under way.
struct Answer {
    request: Request,
    id: LineId,
    /// How much of the line has been sent back.
    echoed: u8,
    /// The answer has had a turn.
    has_stepped: bool,
    /// The line is to be sent back.
    echoes: bool,
    /// Tables have to be waited for.
    waits: bool,
    /// From the first byte on: nobody else talks on this port.
    tx: Option<Line>,
}

/// How far it has come.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Progress {
    /// The answer is at its end.
    Done,
    /// The answer goes on later.
    Waits,
}

/// What has been done at once.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Turn {
    /// Something; there may be more.
    More,
    /// Nothing has been done.
    Nothing,
}

/// Whether the next line of G-code of the feeder, which has its place in the order again when it is begun anew, waits for rest. Lines that overtake come before it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Deferred {
    /// It does not.
    No,
    /// It is carried out at rest.
    Line,
    /// It has been carried out, and is answered at rest.
    Answer,
}

/// The parser's own state.
// In this order: AVR reaches a field within 63 bytes of the first in one instruction.
#[repr(C)]
struct Parser {
    links: &'static Links,
    planner: &'static planner::Shared,
    /// The ports, as bits, that have something to say and lack room.
    lacking: u8,
    /// The port whose line had its turn last, the first turn of G-code of the feeder aside: it is the other one's turn.
    last: u8,
    /// A line of G-code was begun last: others come before the next one.
    has_fed: bool,
    /// The next line of G-code waits for rest.
    deferred: Deferred,
    /// How many turns in a row have been left to others: by a long answer to short ones, by a line that waits to a report.
    waited: u8,
    sessions: [Session; PORTS],
    /// The line of a file on the SD card.
    #[cfg(feature = "sd")]
    feed: super::card::Feed,
}

/// The task.
pub fn run(
    links: &'static Links,
    planner: &'static planner::Shared,
) -> impl Future<Output = Never> {
    let mut parser = Parser {
        links,
        planner,
        sessions: [const { Session::Idle }; PORTS],
        lacking: 0,
        last: USB,
        has_fed: false,
        deferred: Deferred::No,
        waited: 0,
        #[cfg(feature = "sd")]
        feed: super::card::Feed::new(),
    };
    async move {
        loop {
            if is_wanted() {
                yield_now().await;
            }
            match parser.turn() {
                // The reader has its turn, and stops the sender in time.
                Turn::More => yield_now().await,
                Turn::Nothing => parser.wait().await,
            }
        }
    }
}

impl Parser {
    /// Does what can be done at once. A [row](row::run) of lines begins when nothing else is to be done: they come as fast as
    /// they are answered, and would keep the other port waiting.
    #[inline(always)]
    fn turn(&mut self) -> Turn {
        let links = self.links;
        let alarmed = machine::is_alarmed();
        let free = is_free(links);
        let runs_job = !links.job.get().is_none();
        let waits = self.deferred != Deferred::No && is_working(links);
        let data = free && !runs_job && !self.is_feeding() && !waits;
        let straight = !alarmed && !matches!(machine::cycle(), Cycle::Check | Cycle::Jog);
        // What a port is told at once goes first: an acknowledgement is not to wait for a move.
        let declined = if data && straight && self.is_idle() && !self.has_more() {
            match row::run(links, self.planner) {
                Row::Over => false,
                Row::Declined => true,
                Row::Handed if !self.has_more() => return Turn::Nothing,
                Row::Full | Row::Handed => return Turn::More,
            }
        } else {
            false
        };
        self.lacking = 0;
        if self.has_work() && self.go_on() {
            return Turn::More;
        }
        if self.leaves_to_report() {
            return Turn::More;
        }
        match self.next_line(data) {
            Some(chosen) => self.take(chosen, declined),
            None if free && runs_job && !links.job.get().is_over() => {
                if !has_room_for_startup(links) {
                    self.lacking |= 1 << links.told().number;
                    return Turn::Nothing;
                }
                job_line(links);
            }
            None if self.feed() => {}
            None => return Turn::Nothing,
        }
        Turn::More
    }

    /// Whether a line of the SD card is under way.
    #[cfg(feature = "sd")]
    #[inline(always)]
    fn is_feeding(&self) -> bool {
        self.feed.is_busy()
    }

    /// Goes on with the line of the SD card, or begins with the next one. Whether there may be more to do at once.
    #[cfg(feature = "sd")]
    fn feed(&mut self) -> bool {
        let more = self.is_quiet() && self.deferred == Deferred::No && self.feed.turn(self.links);
        if self.feed.take_move() {
            row::hand_over(self.links, self.planner.try_lock().ok().as_deref_mut());
        }
        more
    }

    #[cfg(not(feature = "sd"))]
    #[inline(always)]
    fn is_feeding(&self) -> bool {
        false
    }

    #[cfg(not(feature = "sd"))]
    #[inline(always)]
    fn feed(&mut self) -> bool {
        false
    }

    /// Whether no line of the port that feeds the machine is being answered.
    #[inline(always)]
    fn is_idle(&self) -> bool {
        let feeder = self.sessions.get(usize::from(self.links.feeder.get()));
        matches!(feeder, Some(Session::Idle))
    }

    /// Whether nothing is under way.
    #[inline(always)]
    fn is_quiet(&self) -> bool {
        self.sessions.iter().all(|session| matches!(session, Session::Idle))
    }

    /// Whether anything is under way, or to be told on a port alone.
    #[inline(always)]
    fn has_work(&self) -> bool {
        !self.is_quiet()
            || self.links.ports.iter().any(Port::tells)
            || self.links.rate.get().is_some()
    }

    /// Whether there is anything to do besides lines of the fast path.
    #[inline(never)]
    fn has_more(&self) -> bool {
        let feeder = self.links.feeder.get();
        let has_lines = |port: &Port| {
            let lines = port.lines.borrow();
            lines.has_controls() || (port.number != feeder && lines.has_data())
        };
        self.has_work() || self.links.ports.iter().any(has_lines)
    }

    /// Goes on with what is under way, and tells what a port alone is told. Whether something has come to its end.
    #[inline(never)]
    fn go_on(&mut self) -> bool {
        let (mut ended, after) = (false, self.last + 1);
        for n in 0..PORTS as u8 {
            let number = (after + n) % PORTS as u8;
            if !self.leaves_its_turn(number) {
                let awaited = self.is_awaited(number);
                ended |= self.go_on_at(number, awaited);
            }
        }
        ended
    }

    /// Goes on on one port, while another is `awaited` or not.
    #[inline(never)]
    fn go_on_at(&mut self, number: u8, awaited: bool) -> bool {
        let links = self.links;
        let at = usize::from(number);
        let Some((port, session)) = links.ports.get(at).zip(self.sessions.get_mut(at)) else {
            return false;
        };
        if !matches!(session, Session::Idle) {
            return go_on(links, port, session, awaited);
        }
        if port.asks_report() {
            if begin_report(port, session) {
                return go_on(links, port, session, false);
            }
            self.lacking |= 1 << port.number;
            return false;
        }
        if port.tells() {
            let told = tell(links, port);
            self.lacking |= u8::from(!told) << port.number;
            return told;
        }
        if port.number == USB && links.rate.get().is_some() {
            // The other port has asked for it.
            leave(port.tx.try_lock().ok(), session);
        }
        false
    }

    /// Whether the answer on a port leaves its turn to a control line that waits on another, [`PATIENCE`] times in a row at most: short
    /// answers come first. If not, the port has its turn.
    #[inline(never)]
    fn leaves_its_turn(&mut self, number: u8) -> bool {
        let leaves = self.is_awaited(number);
        if leaves && self.waited < PATIENCE {
            self.waited += 1;
            return true;
        }
        if !matches!(self.sessions.get(usize::from(number)), Some(Session::Idle)) {
            self.waited = 0;
            self.last = number;
        }
        false
    }

    /// Whether an answer is under way on a port, and one on another has had no turn yet.
    #[inline(never)]
    fn is_awaited(&self, number: u8) -> bool {
        let turns = self.turns(number);
        turns != NONE && (0..PORTS as u8).any(|other| other != number && self.turns(other) < turns)
    }

    /// How many turns the answer on a port has had. 0: a control line waits for its first, or a `?` is being answered. 1: another answer is
    /// under way. [`NONE`]: nothing of that waits there, or the port has no room for an answer.
    #[inline(never)]
    fn turns(&self, number: u8) -> u8 {
        let at = usize::from(number);
        match self.links.ports.get(at).zip(self.sessions.get(at)) {
            Some((_, Session::Answer(answer))) => {
                let lacks_room = answer.tx.as_ref().is_some_and(|tx| !tx.has_room());
                (answer.has_stepped || lacks_room).into()
            }
            Some((port, Session::Idle))
                if port.asks_report() || port.lines.borrow().has_controls() =>
            {
                // A report that is being told there ends its line soon.
                if has_room(port) == Some(false) { NONE } else { 0 }
            }
            _ => NONE,
        }
    }

    /// Whether the report on the port whose turn it is gets a turn first: it ends its line for the answer that waits.
    #[inline(never)]
    fn leaves_to_report(&mut self) -> bool {
        let at = usize::from((self.last + 1) % PORTS as u8);
        let is_idle = matches!(self.sessions.get(at), Some(Session::Idle));
        let reports = is_idle
            && self.links.ports.get(at).is_some_and(|port| {
                port.tx.try_lock().is_err() && port.lines.borrow().has_controls()
            });
        let leaves = reports && self.waited < LEAVES;
        if leaves {
            self.waited += 1;
        } else if self.is_quiet() {
            self.waited = 0;
        }
        leaves
    }

    /// The line to begin with. Ports have their turn one after the other, and G-code has its own between two other lines.
    #[inline(never)]
    fn next_line(&mut self, data: bool) -> Option<Chosen> {
        let first = if self.has_fed { self.in_turn(false) } else { None };
        let chosen = first.or_else(|| self.in_turn(data))?;
        self.has_fed =
            chosen.class != Class::Control && chosen.port.number == self.links.feeder.get();
        if !self.has_fed {
            self.last = chosen.port.number;
        }
        Some(chosen)
    }

    /// The next line of the first port that has one, beginning behind the one that was last.
    #[inline(never)]
    fn in_turn(&mut self, data: bool) -> Option<Chosen> {
        let after = usize::from(self.last) + 1;
        (after..after + PORTS).find_map(|n| self.line_of(n % PORTS, data))
    }

    /// The next line of a port. G-code of the feeder is taken only if `data` is wanted; G-code of another port is taken at any time, and
    /// refused. During a flush only lines that have been dropped are taken, to be refused.
    #[inline(never)]
    fn line_of(&mut self, number: usize, data: bool) -> Option<Chosen> {
        let links = self.links;
        let (port, session) = (links.ports.get(number)?, self.sessions.get(number)?);
        let flushes = machine::is_flushing();
        let any = data || flushes || port.number != links.feeder.get();
        let (id, class) = port.lines.borrow().next(any)?;
        // What follows a reset waits for the greeting.
        let waits = (flushes && class == Class::Data)
            || (port.is_resetting() && !matches!(class, Class::Fault(_)));
        if !matches!(session, Session::Idle) || waits {
            return None;
        }
        let has_room = has_room(port) == Some(true);
        self.lacking |= u8::from(!has_room) << port.number;
        has_room.then_some(Chosen { port, id, class })
    }

    /// Takes a line: most are answered to the end at once.
    #[inline(never)]
    fn take(&mut self, chosen: Chosen, declined: bool) {
        let (links, awaited) = (self.links, self.is_awaited(chosen.port.number));
        let Some(session) = self.sessions.get_mut(usize::from(chosen.port.number)) else { return };
        match begin(links, &chosen, declined, session, &mut self.deferred) {
            Begun::Answer => {
                go_on(links, chosen.port, session, awaited);
            }
            Begun::Silent => finish(links, chosen.port, chosen.id),
            Begun::Again => {}
        }
    }

    /// Waits until something may go on.
    fn wait(&self) -> impl Future<Output = ()> + '_ {
        let links = self.links;
        // Whoever still waits does not wait for the CPU.
        set_asked(false);
        let mut asked = false;
        poll_fn(move |cx| {
            let waited = core::mem::replace(&mut asked, true);
            let woken = links.parser_wake.poll(cx);
            let mut ready = woken.is_ready();
            if self.deferred != Deferred::No {
                ready |= waited;
                wake_after(links.thread, Event::Tick, cx.waker());
            }
            #[cfg(feature = "sd")]
            if self.feed.waits() {
                ready |= waited;
                wake_after(links.thread, Event::Tick, cx.waker());
            }
            if self.lacking == 0 && self.is_quiet() {
                return if ready { Poll::Ready(()) } else { woken };
            }
            for (port, session) in links.ports.iter().zip(&self.sessions) {
                let ticks = match session {
                    Session::Leave(..) => true,
                    Session::Answer(answer) => answer.waits && !links.storage.is_awaited(),
                    Session::Idle => false,
                };
                if ticks {
                    ready |= waited;
                    wake_after(links.thread, Event::Tick, cx.waker());
                }
                let has_room = match session {
                    Session::Answer(answer) => answer.may_go_on(port),
                    _ if self.lacking & 1 << port.number != 0 => has_room(port),
                    _ => None,
                };
                match has_room {
                    Some(true) => ready = true,
                    Some(false) => wake_after_transmitted(links.thread, port.number, cx.waker()),
                    None => {}
                }
            }
            if ready && !waited {
                // Others have their turn first.
                cx.waker().wake_by_ref();
                return Poll::Pending;
            }
            if ready { Poll::Ready(()) } else { Poll::Pending }
        })
    }
}

/// Answers who asks whether anybody is there, or tells of bytes that were lost. False if that has to wait.
#[inline(never)]
#[small]
fn tell(links: &Links, port: &Port) -> bool {
    let asked = port.enquiry.get();
    let what = if asked { Notice::Enquiry } else { Notice::Exception(Status::BufferFull) };
    let told = tell_at_once(links, port, what);
    if told {
        if asked { &port.enquiry } else { &port.lost }.set(false);
    }
    told
}

/// Goes on with what is under way on a port, step by step while another is `awaited`. Whether it has come to its end.
#[inline(never)]
fn go_on(links: &'static Links, port: &'static Port, session: &mut Session, awaited: bool) -> bool {
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
fn leave(tx: Option<Line>, session: &mut Session) {
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
    fn may_go_on(&self, port: &Port) -> Option<bool> {
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

/// Whether a block can be carried out now, or refused: neither has the planner to be waited for, nor the
/// tables, and nothing is being dropped.
pub(super) fn is_free(links: &Links) -> bool {
    let waits = links.commands_taken.get() || links.storage.is_awaited();
    !waits && !machine::is_flushing()
}

/// Whether what becomes of the job's next line can be told, if it is told.
#[inline(never)]
#[small]
fn has_room_for_startup(links: &Links) -> bool {
    let tells = links.job.get().startup().is_some();
    !tells || has_room(links.told()) == Some(true)
}

/// Carries out the next line of a built-in job. A line that is refused is told by an exception report. The end is told by
/// the reporter, when everything is done.
#[inline(never)]
#[small]
fn job_line(links: &Links) {
    let mut job = links.job.get();
    let mut line = Vec::new();
    let startup = job.startup();
    if !job.next_line(&Eeprom::take(), &mut line) {
        job.end();
    } else {
        match interpret(links, &line, false).0 {
            Status::Again => return,
            status if startup.is_some() => {
                if !line.is_empty() {
                    tell_startup(links, startup.unwrap_or(0), status);
                }
            }
            Status::Ok if links.commands.borrow().stop == Stop::End => job.end(),
            Status::Ok | Status::Noop => {}
            status => {
                job = Job::default();
                links.except(status);
            }
        }
    }
    links.job.set(job);
    links.reporter_wake.signal();
}

/// How it goes on with a line.
enum Begun {
    /// The line is being answered.
    Answer,
    /// The line gets no answer.
    Silent,
    /// The line has to wait.
    Again,
}

/// Begins with a line. One of G-code has run after that, for data lines are taken only while the
/// planner is free.
#[inline(never)]
fn begin(
    links: &Links,
    chosen: &Chosen,
    declined: bool,
    session: &mut Session,
    deferred: &mut Deferred,
) -> Begun {
    let Chosen { port, id, class } = *chosen;
    let lines = port.lines.borrow();
    let (line, length) = (lines.text(id), lines.length(id));
    if port.is_undecided() {
        links.decide_by(port, line);
    }
    if port.drops_unanswered() && matches!(class, Class::Fault(_)) {
        return Begun::Silent;
    }
    let before = port.speech.get();
    let mut speech = before;
    let settings = links.settings.borrow();
    let mut request = match class {
        Class::Fault(status) => Request::refused(status, line, length, &mut speech, &settings),
        _ => match Request::begin(line, length, &mut speech, &settings) {
            Some(request) => request,
            None => return Begun::Silent,
        },
    };
    drop(settings);
    port.speech.set(speech);
    port.has_stopped.set(class == Class::Control && asks_alarm(line, port.is_plain()).is_some());
    let gcode = request.gcode();
    if let Some(block) = gcode {
        let (status, commented) = match *deferred {
            Deferred::Answer if port.number == links.feeder.get() => (Status::Ok, false),
            _ => run_block(links, port, block.of(line), declined),
        };
        if status == Status::Again {
            // Its number counts when it is begun for good.
            port.speech.set(before);
            if machine::cycle() == Cycle::Jog {
                *deferred = Deferred::Line;
            }
            return Begun::Again;
        }
        request.ran(status, commented);
    }
    let feeds = port.number == links.feeder.get();
    if request.awaits_rest() && feeds && is_working(links) {
        port.speech.set(before);
        *deferred = if gcode.is_some() { Deferred::Answer } else { Deferred::Line };
        return Begun::Again;
    }
    if class != Class::Control && feeds {
        *deferred = Deferred::No;
    }
    let echoes = links.settings.borrow().echo();
    *session = Session::Answer(Answer {
        request,
        id,
        echoed: 0,
        has_stepped: false,
        echoes,
        waits: false,
        tx: None,
    });
    Begun::Answer
}

/// Begins to answer a `?`, which is no line, if there is room for that.
#[inline(never)]
#[small]
fn begin_report(port: &Port, session: &mut Session) -> bool {
    if has_room(port) != Some(true) {
        return false;
    }
    port.take_asked(REPORT);
    let Some(request) = Request::question(port.speech.get()) else { return false };
    *session = Session::Answer(Answer {
        request,
        id: LineId::NONE,
        echoed: 0,
        has_stepped: false,
        echoes: false,
        waits: false,
        tx: None,
    });
    true
}

/// Whether there is room for the first part of an answer; `None` while somebody else talks on the port, whose end wakes the parser.
#[inline(never)]
#[small]
fn has_room(port: &Port) -> Option<bool> {
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
fn finish(links: &Links, port: &Port, id: LineId) {
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

/// Interprets a block of a port's, if that feeds the machine.
#[inline(never)]
pub(super) fn run_block(
    links: &Links,
    port: &Port,
    block: &[u8],
    declined: bool,
) -> (Status, bool) {
    match links.may_feed(port) {
        #[cfg(feature = "dialect-reprap")]
        true if port.is_plain() => interpret_rewritten(links, port, block),
        true => interpret(links, block, declined),
        false => (Status::Muted, true),
    }
}

/// Interprets a block of a printing host.
#[cfg(feature = "dialect-reprap")]
#[inline(never)]
#[small]
fn interpret_rewritten(links: &Links, port: &Port, block: &[u8]) -> (Status, bool) {
    let mut text = crate::protocol::Rewritten::new();
    let mut model = links.model.borrow_mut();
    model.begin_printing();
    heat::has_extruder(&mut links.settings.borrow_mut());
    if model.is_far() && !machine::is_alarmed() && !machine::is_checking() {
        drop(model);
        return (move_back(links), true);
    }
    drop(model);
    let done = match port.speech.get().rewrite(block, &mut text) {
        Ok(block) => interpret(links, block, false),
        Err(status) => (status, true),
    };
    if done.0 != Status::Again {
        links.model.borrow_mut().leave_out(false);
    }
    done
}

/// Of a printer the extruder goes on and on: before it gets too far from the origin the place where it is gets a nearer one's name. [`Status::Again`]: the line is
/// carried out then.
#[cfg(feature = "dialect-reprap")]
#[inline(never)]
#[small]
fn move_back(links: &Links) -> Status {
    let mut commands = links.commands.borrow_mut();
    links.model.borrow_mut().move_back(&mut commands);
    links.commands_taken.set(true);
    links.planner_wake.signal();
    Status::Again
}

/// Ends the program, as M2 does, for one that has been killed, or reset. The planner is free.
pub fn end_program(links: &Links, resets: bool) {
    // It is never refused, not in an alarm either, and changes no table.
    let _ = carry_out(links, b"M2", false);
    if resets {
        links.model.borrow_mut().reset();
    }
}

/// Refuses a block in an alarm, unless it ends that, and else carries it out.
fn interpret(links: &Links, block: &[u8], declined: bool) -> (Status, bool) {
    let alarm = machine::alarm();
    if alarm != Alarm::None {
        if !(alarm.ends_with_program() && is_program_end(block)) {
            return (alarm.status(), true);
        }
        // The queue has been dropped, so that nothing is waited for.
        let _ = alarm::clear(links, &links.settings.borrow());
    }
    let done = carry_out(links, block, declined);
    if machine::is_checking() && links.commands.borrow().stop == Stop::End {
        links.except(Status::ProgramChecked);
    }
    done
}

/// Whether moves are under way or queued.
#[cold]
#[inline(never)]
#[small]
fn is_working(links: &Links) -> bool {
    View::of(links, links.feeder()).has_work()
}

/// A jog of G-code begins, or G-code comes behind one.
#[cold]
#[inline(never)]
fn enter(jogs: bool) {
    machine::carry_out(if jogs { machine::Event::Jog } else { machine::Event::Done });
}

/// Interprets a block and hands its commands to the planner, but in check mode. Returns also whether it may have a
/// comment. [`Status::Again`] while a jog is under way, unless it is another one.
#[inline(never)]
fn carry_out(links: &Links, block: &[u8], declined: bool) -> (Status, bool) {
    let words = jog(block);
    let jogs = machine::cycle() == Cycle::Jog;
    if words.is_some() && (machine::is_held() || (!jogs && is_working(links))) {
        // It waits for nothing but other jogs.
        return (Status::NotAccepted, true);
    }
    if jogs && words.is_none() && !block.is_empty() && is_working(links) {
        // The end of a jog drops what is queued: nothing that has been answered is to be behind it.
        return (Status::Again, true);
    }
    let mut commands = links.commands.borrow_mut();
    let settings = links.settings.borrow();
    let mut model = links.model.borrow_mut();
    let done = match (words, declined) {
        (Some(words), _) => model.jog(words, &*settings, &mut commands),
        // No need to look twice.
        (None, true) => model.slow_path(block, &*settings, &mut commands),
        _ => model.interpret(block, &*settings, &mut commands),
    };
    match done {
        Ok(info) if info.deleted => (Status::Noop, true),
        Ok(info) => {
            if !commands.is_empty() && !machine::is_checking() {
                if words.is_some() != jogs {
                    enter(words.is_some());
                }
                links.commands_taken.set(true);
                links.planner_wake.signal();
            }
            if model.take_lack() {
                links.except(Status::NoToolLength);
            }
            (Status::Ok, info.commented)
        }
        Err(status) => {
            if status.names_axis() {
                links.except(status);
            }
            (status, true)
        }
    }
}
