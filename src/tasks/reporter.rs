//! The reporter task: the greeting, then status and queue reports, exceptions, and the answer to ENQ.
//!
//! Reads everything through [`View`], writes to the sender; waits for something to report, and polls
//! every [`POLL_MS`] while the machine is busy; it is not woken besides then, unless queue reports are
//! wanted. A change of `stat` is told at once, anything else every
//! `si` milliseconds. While the sender is slow it waits, and then reports what is so by then: it never
//! holds up anything else.

use embassy_futures::select::select;
use embassy_time::Timer;

use super::links::Links;
use super::tx::Tx;
use super::view::{RUN, View, queue_free};
use crate::hal::imp::time::millis;
use crate::protocol::notice::{Banner, Exception};
use crate::protocol::{Machine, Out, Report, Value, queue_report};
use crate::status::Status;
use crate::text;

/// How often a busy machine is looked at, ms.
const POLL_MS: u64 = 10;

/// What was told last.
struct Told {
    state: i32,
    blocks_free: usize,
    at: u32,
}

/// The task.
pub async fn run(links: &'static Links) -> ! {
    greet(links).await;
    let mut told = Told { state: 0, blocks_free: queue_free(), at: millis() };
    let mut due = true;
    loop {
        if links.enquiry.take() {
            acknowledge(links).await;
        }
        let state = View::of(links).state();
        if let Some(status) = links.exception.take() {
            report_exception(links, status).await;
        }
        if queue_free() != told.blocks_free && reports_queue(links) {
            told.blocks_free = report_queue(links).await;
        }
        let elapsed = millis().wrapping_sub(told.at);
        let interval = u32::from(View::of(links).settings().status_interval_ms());
        due |= state == RUN;
        if state != told.state || (due && elapsed >= interval) {
            told.state = state;
            told.at = millis();
            due = false;
            report_status(links).await;
        }
        links.reporter_wake.set_polling(state == RUN && !reports_queue(links));
        if due || state == RUN {
            let pause = Timer::after_ticks(POLL_MS);
            select(pause, links.reporter_wake.wait()).await;
        } else {
            links.reporter_wake.wait().await;
            due = true;
        }
    }
}

/// Whether the sender wants to know of each block that comes or goes.
fn reports_queue(links: &Links) -> bool {
    links.settings.borrow().queue_verbosity() != 0
}

/// Sends something that is put in steps: `step` says whether there is more.
async fn send(links: &Links, tx: &mut Tx, mut step: impl FnMut(&mut View, &mut Tx) -> bool) {
    loop {
        tx.room().await;
        let more = step(&mut View::of(links), tx);
        tx.flush();
        if !more {
            break;
        }
    }
}

async fn greet(links: &Links) {
    let mut tx = links.tx.lock().await;
    let mut banner = Banner::begin(&View::of(links));
    send(links, &mut tx, |view, tx| banner.step(view, tx)).await;
}

async fn acknowledge(links: &Links) {
    let mut tx = links.tx.lock().await;
    tx.room().await;
    tx.put_text(text!("{\"ack\":true}\n"));
    tx.flush();
}

async fn report_status(links: &Links) {
    let mut tx = links.tx.lock().await;
    let report = Report::begin(links.mode.get(), &mut View::of(links));
    if let Some(mut report) = report {
        send(links, &mut tx, |view, tx| report.step(view, tx)).await;
    }
}

async fn report_exception(links: &Links, status: Status) {
    let mut tx = links.tx.lock().await;
    let mut exception = Exception::begin(status, &View::of(links));
    send(links, &mut tx, |view, tx| exception.step(view, tx)).await;
}

/// Returns the number of free blocks as it was told, which may have changed during the wait for the
/// transmitter.
async fn report_queue(links: &Links) -> usize {
    let mut tx = links.tx.lock().await;
    let mut told = 0;
    send(links, &mut tx, |view, tx| {
        told = view.value(Value::QueueFree) as usize;
        queue_report(links.mode.get(), view, tx);
        false
    })
    .await;
    told
}
