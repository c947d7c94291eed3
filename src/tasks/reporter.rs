//! The reporter task: the greeting, then status and queue reports, exceptions, and the answer to ENQ.
//!
//! Reads everything through [`View`], writes to the port that is told, and answers ENQ and losses on their own; waits for something to report, and polls
//! every [`POLL_MS`] while the machine moves; it is not woken besides then, unless queue reports are
//! wanted. A change of `stat` or `hold` is told at once, anything else every
//! `si` milliseconds. While the sender is slow it waits, and then reports what is so by then: it never
//! holds up anything else.

use embassy_futures::select::select;
use embassy_time::Timer;

use super::health;
use super::links::Links;
use super::ports::Port;
use super::tx::Tx;
use super::view::{View, moves, queue_free};
use crate::hal::event::Event;
use crate::hal::imp::flags;
use crate::hal::imp::time::millis;
use crate::hal::serial::is_shared;
use crate::protocol::notice::{Banner, Exception, Occasion, Probing, acknowledge, jog_ended};
use crate::protocol::{
    Machine, Mode, Report, Value, put_ready_prompt, queue_report, receive_report,
};
use crate::status::Status;

/// How often a busy machine is looked at, ms.
const POLL_MS: u64 = 10;

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
    if occasion != Occasion::Ready {
        greet(links, occasion).await;
    }
    greet(links, Occasion::Ready).await;
    let mut told =
        Told { state: 0, hold: 0, blocks_free: queue_free(), at: millis(), starved: false };
    let mut due = true;
    loop {
        // Once: `stv` counts the others.
        let exception = &links.told().exception;
        if !told.starved && health::starvations() > 0 && exception.get().is_none() {
            told.starved = true;
            exception.set(Some(Status::StepsLate));
        }
        for port in &links.ports {
            if port.enquiry.take() {
                answer_enquiry(links, port).await;
            }
            if let Some(status) = port.exception.take() {
                report_exception(links, port, status).await;
            }
        }
        if links.probe.take_news() {
            // The planner waits for it.
            flags::set(Event::BlockDone);
            report_probing(links).await;
        }
        let (state, hold) = state_of(links);
        let (jogged, flushed) = (links.jogged.take(), links.flushed.take());
        if jogged || flushed {
            report_end(links, jogged, flushed).await;
        }
        if queue_free() != told.blocks_free && reports_queue(links) {
            told.blocks_free = report_queue(links).await;
        }
        let elapsed = millis().wrapping_sub(told.at);
        let interval = u32::from(links.settings.borrow().status_interval_ms());
        let moves = moves(state, hold);
        due |= moves;
        if (state, hold) != (told.state, told.hold) || (due && elapsed >= interval) {
            (told.state, told.hold) = (state, hold);
            told.at = millis();
            due = false;
            report_status(links).await;
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

/// Sends something that is put in steps: `step` says whether there is more. All of it in one turn, if there is room.
async fn send(
    links: &Links,
    port: &Port,
    tx: &mut Tx,
    mut step: impl FnMut(&mut View, &mut Tx) -> bool,
) {
    loop {
        tx.room().await;
        let more = step(&mut View::of(links, port), tx);
        tx.flush();
        if !more {
            break;
        }
    }
}

/// Says who the machine is; in text mode with the first prompt.
async fn greet(links: &Links, occasion: Occasion) {
    for port in links.ports.iter().filter(|port| !is_shared(port.number)) {
        let mut tx = port.tx.lock().await;
        let mut banner = Banner::begin(occasion, &links.settings.borrow());
        send(links, port, &mut tx, |view, tx| {
            let more = banner.step(view, tx);
            if !more && occasion == Occasion::Ready && port.mode.get() == Mode::Text {
                put_ready_prompt(view, tx);
            }
            more
        })
        .await;
    }
}

async fn answer_enquiry(links: &Links, port: &Port) {
    let mut tx = port.tx.lock().await;
    send(links, port, &mut tx, |view, tx| {
        acknowledge(view.settings(), tx);
        false
    })
    .await;
}

async fn report_status(links: &Links) {
    let port = links.told();
    let mut tx = port.tx.lock().await;
    let report = Report::begin(port.mode.get(), &mut View::of(links, port));
    if let Some(mut report) = report {
        send(links, port, &mut tx, |view, tx| report.step(view, tx)).await;
    }
}

/// A jog has ended, or the queue has been flushed.
async fn report_end(links: &Links, mut jogged: bool, flushed: bool) {
    let port = links.told();
    let mut tx = port.tx.lock().await;
    send(links, port, &mut tx, |view, tx| {
        if core::mem::take(&mut jogged) {
            jog_ended(view.settings(), tx);
            return flushed;
        }
        queue_report(port.mode.get(), view, tx);
        receive_report(port.mode.get(), view, tx);
        false
    })
    .await;
}

async fn report_exception(links: &Links, port: &Port, status: Status) {
    let mut tx = port.tx.lock().await;
    let mut exception = Exception::begin(status, &links.settings.borrow());
    send(links, port, &mut tx, |view, tx| exception.step(view, tx)).await;
}

async fn report_probing(links: &Links) {
    let port = links.told();
    let mut tx = port.tx.lock().await;
    let mut probing = Probing::begin(&links.settings.borrow());
    send(links, port, &mut tx, |view, tx| probing.step(view, tx)).await;
}

/// Returns the number of free blocks as it was told, which may have changed during the wait for the
/// transmitter.
async fn report_queue(links: &Links) -> usize {
    let port = links.told();
    let mut tx = port.tx.lock().await;
    let mut told = 0;
    send(links, port, &mut tx, |view, tx| {
        told = view.value(Value::QueueFree) as usize;
        queue_report(port.mode.get(), view, tx);
        false
    })
    .await;
    told
}
