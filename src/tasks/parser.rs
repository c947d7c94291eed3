//! The parser task: takes lines, answers them, and hands their commands to the planner.
//!
//! Reads the line pools, fills the slot of `links::commands`, writes the G-code model, the settings and the response;
//! waits for lines, for the planner, and for room to transmit. Control lines are taken at any time. Data lines of the
//! port that feeds the machine are taken only while the planner is free and no built-in job runs, so that a long job
//! never locks the sender out. A line that has to wait for the tables ([`Status::Again`]) stays where it is, and so do
//! the lines behind it. A line keeps its slot until its response has been written. Plain moves are carried out at
//! once, in a [`row`]. In an alarm, lines of G-code are refused.
//!
//! Each port has a [`Session`] of its own, so that no port waits for a line of another. No line is begun before the
//! first part of its response has room in the transmit ring. A response that lacks room stays half written until there
//! is some.

mod answer;
mod block;

use core::future::poll_fn;
use core::task::Poll;

use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::mutex::MutexGuard;

pub use block::end_program;
pub(super) use block::{is_free, run_block};

use super::Never;
use super::lines::{Class, LineId};
use super::links::Links;
use super::planner;
use super::ports::{Chosen, Port, REPORT};
use super::reporter::tell_at_once;
use super::row::{self, Row};
use super::tx::Tx;
use crate::card;
use crate::hal::event::{Event, is_wanted, set_asked, wake_after, wake_after_transmitted};
use crate::hal::serial::{PORTS, USB};
use crate::machine::{self, Alarm, Cycle};
use crate::protocol::{Answers, Notice, Request, Speech, asks_alarm};
use crate::status::Status;
use answer::{Answer, finish, go_on, has_room, leave};
use block::{has_room_for_startup, is_working, job_line, waits_for_jog};

/// How many turns in a row an answer yields to answers on other ports that have had no turn yet.
const PATIENCE: u8 = 8;
/// The value of [`Parser::turns`] for a port on which no answer can go on.
const NONE: u8 = u8::MAX;

/// How many turns in a row are left to a report that ends its line early for an answer.
const LEAVES: u8 = 2;

/// The transmitter of a port, while the parser has it.
pub(super) type Line = MutexGuard<'static, NoopRawMutex, Tx>;

/// What the parser does on a port.
enum Session {
    /// The parser does nothing on the port.
    Idle,
    /// The parser answers a line.
    Answer(Answer),
    /// The line has been answered. The rate changes, or the machine is reset, when the response has left. The number
    /// is the time at which the transmit ring was first seen empty, ms.
    Leave(Line, Option<u16>),
}

/// The result of a turn.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Turn {
    /// Something has been done; there may be more to do.
    More,
    /// Nothing has been done.
    Nothing,
}

/// Whether the feeder's next line of G-code waits for a standstill. The line stays in the pool and is begun again then.
/// Lines that overtake come before it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Deferred {
    /// The line does not wait.
    No,
    /// The line is carried out at the standstill.
    Line,
    /// The line has been carried out, and is answered at the standstill.
    Answer,
}

/// The parser's own state.
// In this order: AVR reaches a field within 63 bytes of the first in one instruction.
#[repr(C)]
struct Parser {
    links: &'static Links,
    planner: &'static planner::Shared,
    /// The ports, as bits, that have something to send and lack room for it.
    lacking: u8,
    /// The port that had the last turn; the other port is next. The first turn of a feeder's line of G-code does not
    /// count.
    last: u8,
    /// The line that was begun last is G-code of the feeder: other lines come before the next one.
    has_fed: bool,
    /// Whether the next line of G-code waits for a standstill.
    deferred: Deferred,
    /// How many turns in a row have been left to others: by a long answer to short ones, or by a line that waits to a
    /// report.
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
            if is_wanted(parser.links.thread) {
                yield_now().await;
            }
            match parser.turn() {
                // Gives the reader a turn, so that it stops the sender in time.
                Turn::More => yield_now().await,
                Turn::Nothing => parser.wait().await,
            }
        }
    }
}

impl Parser {
    /// Does what can be done at once. A [row](row::run) of lines begins only when there is nothing else to do: its
    /// lines come as fast as they are answered, and would keep the other port waiting.
    #[inline(always)]
    fn turn(&mut self) -> Turn {
        let links = self.links;
        let alarmed = machine::is_alarmed();
        let free = is_free(links);
        let runs_job = !links.job.get().is_none();
        let waits = self.deferred != Deferred::No && is_working(links);
        let data = free && !runs_job && !self.is_feeding() && !waits;
        let cycles = matches!(machine::cycle(), Cycle::Check | Cycle::Jog);
        let straight = !alarmed && !cycles && !card::writes();
        // Immediate messages of a port go first, because an acknowledgement must not wait for a move.
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
            None if free && runs_job && !links.job.get().is_over() && !waits_for_jog(links) => {
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

    /// Goes on with the line of the SD card, or begins with the next one. Returns whether there may be more to do at
    /// once.
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

    /// Whether anything is under way, or is to be told on one port alone.
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

    /// Continues answers under way, and sends messages for single ports. Returns whether something has ended.
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

    /// Goes on with one port, while an answer on another is `awaited` or not. Returns whether something has come to
    /// its end.
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
            // The other port has requested the new rate.
            leave(port.tx.try_lock().ok(), session);
        }
        false
    }

    /// Whether the answer on a port leaves its turn to a control line that waits on another port: short answers come
    /// first. This happens [`PATIENCE`] times in a row at most. If the result is false, the port has its turn.
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

    /// Whether an answer is under way on a port while one on another port has had no turn yet.
    #[inline(never)]
    fn is_awaited(&self, number: u8) -> bool {
        let turns = self.turns(number);
        turns != NONE && (0..PORTS as u8).any(|other| other != number && self.turns(other) < turns)
    }

    /// Returns how many turns the answer on a port has had. 0: a control line or a `?` waits for its first turn, or a
    /// `?` is being answered. 1: another answer is under way, or the answer lacks room. [`NONE`]: there is nothing to
    /// answer, or the port has no room to begin an answer.
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
                // A report that is being sent there does not count as a lack of room: it ends its line soon.
                if has_room(port) == Some(false) { NONE } else { 0 }
            }
            _ => NONE,
        }
    }

    /// Whether a report on the port whose turn it is continues first. It ends its line early for the control line that
    /// waits there.
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

    /// Returns the line to begin with. Ports take turns, and between two lines of the feeder's G-code another line has
    /// its turn.
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

    /// Returns the next line of the first port that has one. The search starts behind the port that was last.
    #[inline(never)]
    fn in_turn(&mut self, data: bool) -> Option<Chosen> {
        let after = usize::from(self.last) + 1;
        (after..after + PORTS).find_map(|n| self.line_of(n % PORTS, data))
    }

    /// Returns the next line of a port. G-code of the feeder is taken only if `data` is wanted. G-code of another port
    /// is taken at any time, and refused. During a flush, only control lines and lines that have been dropped are
    /// taken.
    #[inline(never)]
    fn line_of(&mut self, number: usize, data: bool) -> Option<Chosen> {
        let links = self.links;
        let (port, session) = (links.ports.get(number)?, self.sessions.get(number)?);
        let flushes = machine::is_flushing();
        let any = data || flushes || port.number != links.feeder.get();
        let (id, class) = port.lines.borrow().next(any)?;
        // A line that follows a reset waits for the greeting, and then for the start-up lines that are reported there.
        let starts = || {
            port.speech.get().is_in_order()
                && links.job.get().starts_up()
                && links.told().number == port.number
        };
        let waits = (flushes && class.is_whole())
            || (class != Class::Gone && (port.awaits_greeting() || starts()))
            || port.news.get().is_some();
        if !matches!(session, Session::Idle) || waits {
            return None;
        }
        let has_room = has_room(port) == Some(true);
        self.lacking |= u8::from(!has_room) << port.number;
        has_room.then_some(Chosen { port, id, class })
    }

    /// Begins with a line. Most lines are answered to the end in this turn.
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

    /// Waits until something can continue.
    fn wait(&self) -> impl Future<Output = ()> + '_ {
        let links = self.links;
        // An answer that is still due does not wait for the CPU.
        set_asked(links.thread, false);
        // Bit 0: this has been polled before. Bit 1: a line of a job waits for the end of a jog, as of now.
        let mut state = u8::from(waits_for_jog(links)) << 1;
        poll_fn(move |cx| {
            let (waited, jogs) = (state & 1 != 0, state & 2 != 0);
            state |= 1;
            let woken = links.parser_wake.poll(cx);
            let mut ready = woken.is_ready();
            if self.deferred != Deferred::No || jogs {
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
                    // News need all of the ring.
                    _ if port.news.get().is_some() => {
                        port.tx.try_lock().ok().map(|tx| tx.is_empty())
                    }
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
                // Other tasks have their turn first.
                cx.waker().wake_by_ref();
                return Poll::Pending;
            }
            if ready { Poll::Ready(()) } else { Poll::Pending }
        })
    }
}

/// Answers an enquiry (ENQ), or reports the port's news. Returns false if that has to wait.
#[inline(never)]
#[small]
fn tell(links: &Links, port: &Port) -> bool {
    let news = port.news.get();
    let told = tell_at_once(links, port, news.map_or(Notice::Enquiry, Notice::Exception));
    if told && news.is_none() {
        port.enquiry.set(false);
    } else if told {
        port.news.set(None);
    }
    told
}

/// The result of beginning a line.
enum Begun {
    /// The line is being answered.
    Answer,
    /// The line gets no answer.
    Silent,
    /// The line has to wait.
    Again,
}

/// Begins with a line. Its G-code has run when the answer begins, because data lines are taken only while the planner
/// is free.
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
    if port.may_decide(line.first()) || links.may_change_dialect(port, line) {
        links.decide_by(port, line);
    }
    if Speech::HAS_QUESTION && class == Class::Gone {
        *deferred = Deferred::No;
        return Begun::Silent;
    }
    let before = port.speech.get();
    let mut speech = before;
    let settings = links.settings.borrow();
    // The file that is being written would lack the line.
    #[cfg(feature = "card-write")]
    if let Class::Fault(status) = class
        && !port.is_plain()
        && port.number == links.feeder.get()
    {
        links.card.borrow_mut().spoil(status);
    }
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
    // A line that a reset has dropped may have waited for the end of an alarm.
    port.clears.set(Alarm::None);
    let gcode = request.gcode();
    if let Some(block) = gcode {
        let (status, commented) = match *deferred {
            Deferred::Answer if port.number == links.feeder.get() => (Status::Ok, false),
            _ => run_block(links, port, block.of(line), declined, class == Class::Late),
        };
        if status == Status::Again {
            // The line number counts only when the line is begun for good.
            port.speech.set(before);
            if machine::cycle() == Cycle::Jog {
                *deferred = Deferred::Line;
            }
            return Begun::Again;
        }
        request.ran(status, commented);
    }
    let feeds = port.number == links.feeder.get();
    if request.awaits_rest(line) && feeds && is_working(links) {
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

/// Begins to answer a `?`, which is no line, if there is room. Returns whether the answer has begun.
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
