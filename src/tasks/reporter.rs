//! The reporter task: the greeting, then status and queue reports, and exceptions.
//!
//! Reads everything through [`View`], writes to the port that is told; what one port alone is told is the parser's ([`tell_at_once`]). Waits for something to report, and polls
//! every [`POLL_MS`] while the machine moves; it is not woken besides then, unless queue reports are
//! wanted. A change of `stat` or `hold` is told at once, anything else every
//! `si` milliseconds. While the sender is slow it waits, and then reports what is so by then: it never
//! holds up anything else.

use embassy_futures::select::select;
use embassy_futures::yield_now;
use embassy_time::Timer;
use kerf_macros::small;

use super::health;
use super::links::Links;
use super::ports::{COURTESY, Port};
use super::tx::Tx;
use super::view::{View, moves, queue_free};
use crate::hal::event::Event;
use crate::hal::imp::flags;
use crate::hal::imp::time::millis;
use crate::hal::imp::uart;
use crate::hal::serial::is_shared;
use crate::jobs::Job;
use crate::protocol::notice::{Banner, Exception, Occasion, Probing, acknowledge, jog_ended};
use crate::protocol::{
    Machine, Mode, Report, Value, put_ready_prompt, queue_report, receive_report,
};
use crate::status::Status;

/// How often a busy machine is looked at, ms.
const POLL_MS: u64 = 10;
/// How often room is looked for on a port that is greeted besides.
const PATIENCE: u8 = 20;
/// So many turns of [`COURTESY`] it takes to end a line early: more lines would take the line's time.
const SPLIT: u8 = COURTESY / 2;

/// What was told last.
struct Told {
    state: i32,
    hold: i32,
    blocks_free: usize,
    at: u32,
    starved: bool,
}

/// The task; `occasion` is what has come of the start.
pub async fn run(links: &'static Links, occasion: Occasion) -> ! {
    let mut greeting = Some(occasion);
    while let Some(occasion) = greeting {
        greet(links, occasion).await;
        greeting = (occasion != Occasion::Ready).then_some(Occasion::Ready);
    }
    let mut told =
        Told { state: 0, hold: 0, blocks_free: queue_free(), at: millis(), starved: false };
    let mut due = true;
    loop {
        // Once: `stv` counts the others.
        let exception = &links.notices.exception;
        if !told.starved && health::starvations() > 0 && exception.get().is_none() {
            told.starved = true;
            exception.set(Some(Status::StepsLate));
        }
        if View::of(links, links.told()).has_done_job() {
            links.job.set(Job::default());
            links.except(Status::EndOfFile);
            links.parser_wake.signal();
        }
        if let Some(status) = links.notices.exception.take() {
            tell(links, links.told(), What::Exception(status)).await;
        }
        if links.probe.take_news() {
            // The planner waits for it.
            flags::set(Event::BlockDone);
            tell(links, links.told(), What::Probing).await;
        }
        let (state, hold) = state_of(links);
        let (jogged, flushed) = (links.notices.jogged.take(), links.notices.flushed.take());
        if jogged || flushed {
            tell(links, links.told(), What::End { jogged, flushed }).await;
        }
        if queue_free() != told.blocks_free && reports_queue(links) {
            told.blocks_free = tell(links, links.told(), What::Queue).await;
        }
        let elapsed = millis().wrapping_sub(told.at);
        let interval = u32::from(links.settings.borrow().status_interval_ms());
        let moves = moves(state, hold);
        due |= moves;
        if (state, hold) != (told.state, told.hold) || (due && elapsed >= interval) {
            (told.state, told.hold) = (state, hold);
            told.at = millis();
            due = false;
            tell(links, links.told(), What::Status).await;
        }
        links.reporter_wake.set_polling(moves && !reports_queue(links));
        if due || moves {
            let pause = Timer::after_ticks(POLL_MS);
            select(pause, links.reporter_wake.wait()).await;
        } else {
            links.reporter_wake.wait().await;
            due = true;
        }
    }
}

/// `stat` and `hold`.
fn state_of(links: &Links) -> (i32, i32) {
    let view = View::of(links, links.told());
    (view.state(), view.hold())
}

/// Whether the sender wants to know of each block that comes or goes.
fn reports_queue(links: &Links) -> bool {
    links.settings.borrow().queue_verbosity() != 0
}

/// What can be told.
#[derive(Clone, Copy)]
pub enum What {
    /// Who the machine is; in text mode with the first prompt.
    Greeting(Occasion),
    /// The answer to ENQ.
    Enquiry,
    /// Something has gone wrong.
    Exception(Status),
    /// What probing has found.
    Probing,
    /// A status report.
    Status,
    /// A jog has ended, or the queue has been flushed, or both.
    End {
        /// The first.
        jogged: bool,
        /// The second.
        flushed: bool,
    },
    /// A queue report.
    Queue,
}

/// How far it has been told.
enum Telling {
    Greeting(Banner, Occasion),
    Enquiry,
    Exception(Exception),
    Probing(Probing),
    Status(Option<Report>),
    End {
        jogged: bool,
        flushed: bool,
    },
    /// How many blocks are free, as it was told.
    Queue(usize),
}

#[small]
impl Telling {
    /// Begins. What is told is what is so by now.
    #[inline(never)]
    fn begin(what: What, links: &Links, port: &Port) -> Self {
        let settings = links.settings.borrow();
        match what {
            What::Greeting(occasion) => {
                Self::Greeting(Banner::begin(occasion, &settings), occasion)
            }
            What::Enquiry => Self::Enquiry,
            What::Exception(status) => Self::Exception(Exception::begin(status, &settings)),
            What::Probing => Self::Probing(Probing::begin(&settings)),
            What::Status => {
                drop(settings);
                Self::Status(Report::begin(port.mode.get(), &mut View::of(links, port)))
            }
            What::End { jogged, flushed } => Self::End { jogged, flushed },
            What::Queue => Self::Queue(0),
        }
    }

    /// Puts the next part. Whether there is more.
    #[inline(never)]
    fn step(&mut self, links: &Links, port: &Port, tx: &mut Tx) -> bool {
        let view = &mut View::of(links, port);
        let mode = port.mode.get();
        let more = match self {
            Self::Greeting(banner, occasion) => {
                let more = banner.step(view, tx);
                if !more && *occasion == Occasion::Ready && mode == Mode::Text {
                    put_ready_prompt(view, tx);
                }
                more
            }
            Self::Enquiry => {
                acknowledge(view.settings(), tx);
                false
            }
            Self::Exception(exception) => exception.step(view, tx),
            Self::Probing(probing) => probing.step(view, tx),
            Self::Status(report) => report.as_mut().is_some_and(|report| report.step(view, tx)),
            Self::End { jogged, flushed } => {
                if core::mem::take(jogged) {
                    jog_ended(view.settings(), tx);
                    *flushed
                } else {
                    queue_report(mode, view, tx);
                    receive_report(mode, view, tx);
                    false
                }
            }
            Self::Queue(free) => {
                *free = view.value(Value::QueueFree) as usize;
                queue_report(mode, view, tx);
                false
            }
        };
        tx.flush();
        more
    }

    /// Ends the line early, for an answer to come before the rest. False if this can't be done.
    #[inline(never)]
    fn split(&mut self, tx: &mut Tx) -> bool {
        let Self::Status(Some(report)) = self else { return false };
        let split = report.split(tx);
        tx.flush();
        split
    }
}

/// Tells it on a port, a part at a time: for a millisecond in one turn, if there is room. Of a queue
/// report returns how many blocks are free in it, which may have changed during the wait for the
/// transmitter.
async fn tell(links: &Links, port: &Port, what: What) -> usize {
    let mut tx = match what {
        What::Status | What::Exception(_) => port.tx_behind_answers().await,
        _ => port.tx.lock().await,
    };
    let mut telling = Telling::begin(what, links, port);
    // For all of it: while it is being told, the port is not answered.
    let mut turns = COURTESY;
    loop {
        tx.room().await;
        let waits = || port.lines.borrow().has_controls();
        if turns >= SPLIT && waits() && telling.split(&mut tx) {
            turns -= SPLIT;
            drop(tx);
            links.parser_wake.signal();
            tx = port.tx_behind_answers().await;
            continue;
        }
        if !telling.step(links, port, &mut tx) {
            break;
        }
        // A status report takes 4 ms, and the ring of a second port may be full in 5.
        if uart::presses() || (turns > 0 && flags::has(Event::Tick)) {
            turns = turns.saturating_sub(1);
            yield_now().await;
        }
    }
    drop(tx);
    // A line may wait for the transmitter.
    links.parser_wake.signal();
    if let Telling::Queue(free) = telling { free } else { 0 }
}

/// Tells something short on a port, if nobody else talks there and there is room for it: at most 64 bytes, or all of an
/// empty ring for a greeting. Else returns false.
#[inline(never)]
#[small]
pub fn tell_at_once(links: &Links, port: &Port, what: What) -> bool {
    let Ok(mut tx) = port.tx.try_lock() else { return false };
    let fits = if matches!(what, What::Greeting(_)) { tx.is_empty() } else { tx.has_room() };
    if fits {
        let mut telling = Telling::begin(what, links, port);
        while telling.step(links, port, &mut tx) {}
    }
    fits
}

/// Says who the machine is. The other port gets no greeting if it cannot talk for long: its sender may hold it back.
async fn greet(links: &Links, occasion: Occasion) {
    let told = links.told();
    tell(links, told, What::Greeting(occasion)).await;
    let others = links.ports.iter().filter(|port| port.number != told.number);
    for port in others.filter(|port| !is_shared(port.number)) {
        for _ in 0..PATIENCE {
            if tell_at_once(links, port, What::Greeting(occasion)) {
                break;
            }
            Timer::after_ticks(POLL_MS).await;
        }
    }
}
