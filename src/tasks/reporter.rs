//! The reporter task: the greeting, then status and queue reports, and exceptions.
//!
//! Reads everything through [`View`], writes to the port that gets reports. Messages for one port alone are sent by the
//! parser ([`tell_at_once`]). Waits for something to report, and polls every [`POLL_MS`] while the machine moves. While
//! it polls it is not woken as well, unless queue reports are requested. A change of the machine's state is reported at
//! once, other values every `si` milliseconds. The dialect formats the report ([`Telling`]). While the sender is slow
//! the reporter waits, and then reports the present values; it never delays anything else.

use embassy_futures::select::select;
use embassy_futures::yield_now;
use kerf_macros::small;

use super::alarm;
use super::health;
#[cfg(feature = "dialect-reprap")]
use super::heat;
use super::links::Links;
use super::ports::{
    COURTESY, GREETING, GREETS, HOMING, INTERRUPTED, OPENED, OTHERS, Port, greets_anew,
};
use super::turning;
use super::tx::Tx;
use super::view::{View, moves, queue_free};
use crate::hal::after_ms;
use crate::hal::eeprom::Eeprom;
use crate::hal::event::Event;
use crate::hal::flags;
use crate::hal::serial::is_shared;
use crate::hal::time::millis;
use crate::hal::uart;
use crate::jobs::Job;
use crate::machine::{self, Doing};
use crate::motion::snapshot::Program;
use crate::protocol::{Hold, Machine, Notice, Occasion, Speech, Telling, Tells};
use crate::status::Status;

/// Polling period while the machine moves, ms.
const POLL_MS: u64 = 10;
/// Polling period at a standstill for a printing host, ms.
const LOOK_MS: u64 = 100;
/// Number of attempts to get room on another port than the usual one.
const PATIENCE: u8 = 20;
/// How many times a report ends its line early for an answer. Each line of a report costs the serial line some time
/// for its frame.
const SPLITS: u8 = 2;

/// The values reported last.
struct Told {
    state: State,
    blocks_free: usize,
    at: u32,
    starved: bool,
}

/// The task. `occasion` says how the machine has started.
pub async fn run(links: &'static Links, occasion: Occasion) -> ! {
    greet_undecided(links);
    let mut greeting = Some(occasion);
    while let Some(occasion) = greeting {
        let notice = Notice::Greeting(occasion);
        tell(links, links.told(), notice).await;
        tell_others(links, notice).await;
        greeting = (occasion != Occasion::Ready).then_some(Occasion::Ready);
    }
    // The other ports have been greeted as well.
    if machine::is_alarmed()
        && let Some(reason) = links.notices.exception.get()
    {
        alarm::announce(links, reason, alarm::NO_PORT);
    }
    start_up(links);
    let mut told =
        Told { state: State::FIRST, blocks_free: queue_free(), at: millis(), starved: false };
    let mut due = true;
    let mut clock = Clock::new();
    loop {
        // Only the first one is reported; `stv` counts all.
        let exception = &links.notices.exception;
        if !told.starved && health::starvations() > 0 && exception.get().is_none() {
            told.starved = true;
            exception.set(Some(Status::StepsLate));
        }
        if View::of(links, links.told()).has_done_job() {
            let is_startup = links.job.get().startup().is_some();
            links.job.set(Job::default());
            if !is_startup {
                links.except(Status::EndOfFile);
            }
            links.parser_wake.signal();
        }
        // All of them in one turn: a probing is reported after the alarm that it has raised. Before greetings, behind
        // which another port may get the reports.
        while let Some(status) = links.notices.exception.take() {
            let notice = Notice::Exception(status);
            tell(links, links.told(), notice).await;
            // The program may be resumed on any port.
            if status == Status::ProgramStopped {
                tell_others(links, notice).await;
            }
            if !Speech::HAS_QUESTION {
                break;
            }
        }
        while let Some((number, notice)) = asked(links) {
            let port = links.port(number);
            let opened = uart::sees_opening() && port.take_asked(OPENED);
            tell(links, port, notice).await;
            // In one turn: no line comes between the greeting and the start-up lines.
            if greets_anew() && port.take_asked(GREETS) && !opened {
                // If it may feed the machine, start-up lines are reported there.
                links.may_feed(port);
                start_up(links);
            }
        }
        if links.probe.take_news() {
            // The planner waits for this.
            flags::set(Event::BlockDone);
            tell(links, links.told(), Notice::Probing).await;
            // An answer may wait for this; its task has been woken.
            links.probe.has_been_told();
        }
        if turning::take_news(links.thread) && links.settings.borrow().reports_each_turn() {
            tell(links, links.told(), Notice::SyncError).await;
        }
        if Speech::HAS_PLAIN
            && let Some(notice) = clock.due(links)
        {
            tell(links, links.told(), notice).await;
        }
        let state = State::now(links);
        let (jogged, flushed) = (links.notices.jogged.take(), links.notices.flushed.take());
        if jogged || flushed {
            tell(links, links.told(), Notice::End { jogged, flushed }).await;
        }
        if queue_free() != told.blocks_free && reports_queue(links) {
            told.blocks_free = tell(links, links.told(), Notice::Queue).await;
        }
        let elapsed = millis().wrapping_sub(told.at);
        let interval = u32::from(links.settings.borrow().status_interval_ms());
        let moves = moves(state.doing, state.hold);
        due |= moves;
        if state != told.state || (due && elapsed >= interval) {
            told.state = state;
            told.at = millis();
            due = false;
            tell(links, links.told(), Notice::Status).await;
        }
        links.reporter_wake.set_polling(moves && !reports_queue(links));
        if due || moves {
            let pause = after_ms(POLL_MS);
            select(pause, links.reporter_wake.wait()).await;
        } else if Speech::HAS_PLAIN && links.told().is_plain() {
            let pause = after_ms(LOOK_MS);
            select(pause, links.reporter_wake.wait()).await;
            due = true;
        } else {
            links.reporter_wake.wait().await;
            due = true;
        }
    }
}

/// Periodic messages to a printing host.
#[cfg(feature = "dialect-reprap")]
struct Clock {
    /// Since when no further line has been begun, ms; in `lines`, how many had been.
    since: u32,
    lines: u8,
    /// When temperatures were told last.
    told: u32,
}

#[cfg(feature = "dialect-reprap")]
impl Clock {
    fn new() -> Self {
        Self { since: millis(), lines: 0, told: millis() }
    }

    /// Returns the message that is due: temperatures, if the host has requested them, or busy.
    #[inline(never)]
    #[small]
    fn due(&mut self, links: &Links) -> Option<Notice> {
        let (port, now) = (links.told(), millis());
        let speech = port.speech.get();
        let lines = speech.activity()?;
        if heat::takes_news(&links.heat) {
            return Some(Notice::Tuning);
        }
        let intervals = speech.intervals(&links.report.borrow());
        let is_due = |since, seconds: u8| {
            seconds != 0 && now.wrapping_sub(since) >= u32::from(seconds) * 1_000
        };
        if is_due(self.told, intervals.temperatures_s) {
            self.told = now;
            return Some(Notice::Temperatures);
        }
        if lines != self.lines || !port.lines.borrow().has_data() {
            (self.lines, self.since) = (lines, now);
        }
        if !is_due(self.since, intervals.busy_s) {
            return None;
        }
        self.since = now;
        Some(Notice::Busy)
    }
}

/// Without a dialect of printing hosts there are no periodic messages.
#[cfg(not(feature = "dialect-reprap"))]
struct Clock;

#[cfg(not(feature = "dialect-reprap"))]
impl Clock {
    fn new() -> Self {
        Self
    }

    fn due(&mut self, _links: &Links) -> Option<Notice> {
        None
    }
}

/// The state that is reported at once when it changes.
#[derive(Clone, Copy, PartialEq)]
struct State {
    doing: Doing,
    hold: Hold,
    /// The state of the program, while the machine stands still.
    rest: Program,
}

impl State {
    /// A state that never occurs, so that the first check finds a change.
    const FIRST: Self = Self { doing: Doing::Rests, hold: Hold::Slows, rest: Program::Ready };

    #[inline(never)]
    #[small]
    fn now(links: &Links) -> Self {
        let mut view = View::of(links, links.told());
        let (doing, hold) = (view.doing(), view.hold());
        let rest = if doing == Doing::Rests { view.rest() } else { Program::Ready };
        Self { doing, hold, rest }
    }
}

/// Whether the sender wants to be told of each block that comes or goes.
fn reports_queue(links: &Links) -> bool {
    links.settings.borrow().queue_verbosity() != 0
}

/// Begins to report `notice` on a port, with the present values.
#[inline(never)]
#[small]
fn begin(notice: Notice, links: &Links, port: &Port) -> Telling {
    // The enquiry exists in one dialect, and does not decide.
    if matches!(notice, Notice::Enquiry) && port.is_undecided() {
        return begin_otherwise(links, port, notice);
    }
    let speech = port.speech.get();
    let greets =
        Speech::IS_CHOSEN && matches!(notice, Notice::Greeting(_)) && !speech.is_in_order();
    // A line may have decided since the greeting before this one was begun.
    let speech =
        if greets { Speech::at_start(&links.settings.borrow(), port.number) } else { speech };
    Telling::begin(notice, speech, &mut View::of(links, port))
}

/// Puts the next part. Returns whether there is more.
#[inline(never)]
#[small]
fn step(telling: &mut Telling, links: &Links, port: &Port, tx: &mut Tx) -> bool {
    let more = telling.step(&mut View::of(links, port), tx);
    tx.flush();
    more
}

/// Ends the line of a report early if an answer waits for it. Returns false if no answer waits, or if the line cannot
/// end here.
fn split(telling: &mut Telling, port: &Port, tx: &mut Tx) -> bool {
    let split = port.lines.borrow().has_controls() && telling.split(tx);
    if split {
        tx.flush();
    }
    split
}

/// Tells `notice` on a port, a part at a time: for a millisecond in one turn, if there is room. For a queue report,
/// returns how many blocks the report says are free; that may have changed while the transmitter was waited for.
async fn tell(links: &Links, port: &Port, notice: Notice) -> usize {
    // Changes in the meantime are checked afterwards, also if the machine has stopped by then.
    links.reporter_wake.set_polling(false);
    let mut tx = match notice {
        Notice::Status | Notice::Exception(_) => port.tx_behind_answers().await,
        _ => port.tx.lock().await,
    };
    let mut twice =
        Speech::IS_CHOSEN && matches!(notice, Notice::Greeting(_)) && port.take_asked(OTHERS);
    let mut telling =
        if twice { begin_otherwise(links, port, notice) } else { begin(notice, links, port) };
    // For the whole notice: while it is sent, the port is not answered.
    let (mut turns, mut splits) = (COURTESY, SPLITS);
    loop {
        tx.room().await;
        if splits > 0 && split(&mut telling, port, &mut tx) {
            splits -= 1;
            drop(tx);
            links.parser_wake.signal();
            tx = port.tx_behind_answers().await;
            continue;
        }
        if !step(&mut telling, links, port, &mut tx) {
            if !core::mem::take(&mut twice) {
                break;
            }
            telling = begin(notice, links, port);
        }
        // A status report takes 4 ms, and the ring of a second port may be full in 5.
        if uart::presses(links.thread) || (turns > 0 && flags::has(Event::Tick)) {
            turns = turns.saturating_sub(1);
            yield_now().await;
        }
    }
    drop(tx);
    // A line may wait for the transmitter.
    links.parser_wake.signal();
    telling.blocks_free()
}

/// Returns the port of a sender that has reset the machine, and the notice for it; `None` if no sender has.
#[inline(never)]
#[small]
fn asked(links: &Links) -> Option<(u8, Notice)> {
    links.ports.iter().find_map(|port| asked_on(port).map(|notice| (port.number, notice)))
}

#[inline(never)]
#[small]
fn asked_on(port: &Port) -> Option<Notice> {
    if !is_over(port) {
        return None;
    }
    if port.take_asked(INTERRUPTED) {
        let homed = port.take_asked(HOMING);
        let status = if homed { Status::Terminated } else { Status::HardReset };
        return Some(Notice::Exception(status));
    }
    port.take_asked(GREETING);
    port.ask(GREETS);
    Some(Notice::Greeting(Occasion::Ready))
}

/// Whether a sender's reset is complete: everything received before it has been dropped.
#[inline(never)]
#[small]
fn is_over(port: &Port) -> bool {
    let drops = || !port.cut.get().is_none() || port.lines.borrow().has_gone();
    port.is_resetting() && !machine::is_flushing() && !drops()
}

/// Greets in another dialect as well on ports whose dialect is undecided, so that each sender finds its own greeting.
/// The port's own greeting comes last, because senders that know both take the last one. At the start, when the
/// transmit rings are empty.
#[inline(never)]
#[small]
fn greet_undecided(links: &Links) {
    for port in links.ports.iter().filter(|port| port.is_undecided() && !is_shared(port.number)) {
        let Ok(mut tx) = port.tx.try_lock() else { continue };
        let mut telling = begin_otherwise(links, port, Notice::Greeting(Occasion::Ready));
        while step(&mut telling, links, port, &mut tx) {}
    }
}

/// Begins the job of the start-up lines, which are carried out before any other line, unless there is an alarm. The
/// parser takes them. An image without a dialect that keeps start-up lines has none.
#[inline(never)]
#[small]
fn start_up(links: &Links) {
    let keeps = Speech::of_question(&links.settings.borrow()).is_some();
    if !keeps || machine::is_alarmed() || !links.job.get().is_none() {
        return;
    }
    if let Some(job) = Job::of_startup(&Eeprom::of(links.thread)) {
        links.job.set(job);
        links.parser_wake.signal();
    }
}

/// Reports the status of a start-up line. The parser has made sure that there is room.
#[inline(never)]
#[small]
pub fn tell_startup(links: &Links, line: u8, status: Status) {
    let port = links.told();
    let Ok(mut tx) = port.tx.try_lock() else { return };
    let mut telling = begin(Notice::Startup(line, status), links, port);
    while step(&mut telling, links, port, &mut tx) {}
}

/// Begins a notice in the dialect in which an undecided port greets before its own. A greeting has at most 110 bytes.
#[inline(never)]
#[small]
fn begin_otherwise(links: &Links, port: &Port, notice: Notice) -> Telling {
    let other = Speech::of_other_greeting(&links.settings.borrow());
    Telling::begin(notice, other.unwrap_or(port.speech.get()), &mut View::of(links, port))
}

/// Sends a short message on a port, if its transmitter is free and there is room: at most 64 bytes, or for a greeting
/// and an exception all of an empty ring. Returns false if it cannot be sent now.
#[inline(never)]
#[small]
pub fn tell_at_once(links: &Links, port: &Port, notice: Notice) -> bool {
    let Ok(mut tx) = port.tx.try_lock() else { return false };
    let is_long = match notice {
        Notice::Exception(status) => status != Status::BufferFull,
        #[cfg(feature = "sd")]
        Notice::FileLine(..) => true,
        _ => matches!(notice, Notice::Greeting(_)),
    };
    let fits = if is_long { tx.is_empty() } else { tx.has_room() };
    if fits {
        let mut telling = begin(notice, links, port);
        while step(&mut telling, links, port, &mut tx) {}
    }
    fits
}

/// Sends a message on the ports that do not get all reports. Gives up on a port that stays blocked for long, because
/// its sender may hold it back.
async fn tell_others(links: &Links, notice: Notice) {
    let told = links.told().number;
    let others = links.ports.iter().filter(|port| port.number != told);
    for port in others.filter(|port| !is_shared(port.number)) {
        for _ in 0..PATIENCE {
            if tell_at_once(links, port, notice) {
                break;
            }
            after_ms(POLL_MS).await;
        }
    }
}
