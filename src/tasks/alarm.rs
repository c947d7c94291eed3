//! The begin and the end of an alarm. The effects of each alarm are in [`machine::alarm`](mod@crate::machine::alarm).
//!
//! ```text
//!  raise   steps stop at once if the alarm is sudden (the interrupt of a limit has stopped them already); outputs off;
//!          Event::Cut: a hold, and data lines wait
//!  planner drop_blocks   exec, at rest or stopped, drops its blocks and counts what has been made, to the step
//!          restart       planner and model start from there; data lines are refused from now on
//!  clear   steps may be made again
//! ```
//!
//! Thread mode raises and clears alarms; any level may read the state. Nothing here waits, and nothing can be full.

use kerf_macros::small;

use super::heat;
use super::hold;
use super::links::Links;
use super::spindle;
use super::switches;
use crate::config::Settings;
use crate::hal::serial::is_shared;
use crate::hal::stepper;
use crate::machine::{self, Alarm};
use crate::status::Status;

/// Begins an alarm, unless one of equal or higher severity is on.
#[small]
pub fn raise(links: &Links, alarm: Alarm) {
    raise_for(links, alarm, alarm.status());
}

/// Begins an alarm, unless one of equal or higher severity is on, and reports it with `reason` as its status.
#[small]
pub fn raise_for(links: &Links, alarm: Alarm, reason: Status) {
    raise_by(links, alarm, reason, NO_PORT);
}

/// Begins an alarm as [`raise_for`] does. It is not reported on the port `by`, whose sender hears of it in an answer.
#[inline(never)]
#[small]
pub fn raise_by(links: &Links, alarm: Alarm, reason: Status, by: u8) {
    let stop = || {
        if alarm.is_sudden() {
            stepper::stop();
            links.model.borrow_mut().forget_homes();
        }
    };
    if !machine::raise(links.thread, alarm, stop) {
        return;
    }
    hold::abandon(links);
    spindle::stop(links.thread);
    heat::stop(links);
    announce(links, reason, by);
}

/// The number of no port.
pub const NO_PORT: u8 = u8::MAX;

/// Reports the reason of an alarm on all ports but that with the number `by`. The reporter tells the port that gets
/// reports. The parser tells the others, so that none of them waits for a sender that takes nothing.
#[inline(never)]
#[small]
pub fn announce(links: &Links, reason: Status, by: u8) {
    let told = links.told().number;
    for port in &links.ports {
        if port.number == told && told != by {
            links.except_at_once(reason);
        } else if port.number != by && !is_shared(port.number) {
            port.news.set(Some(reason));
        }
    }
    links.parser_wake.signal();
}

/// Starts the machine in an alarm and reports `reason`, so that the operator looks at it first: after an unexpected
/// reset, or without its settings, when limits and emergency stop may be off. Called before anything runs.
#[inline(never)]
#[small]
pub fn wake_up_in(links: &Links, reason: Status) {
    machine::start_alarmed(links.thread);
    // The reporter checks this before it waits.
    links.notices.exception.set(Some(reason));
}

/// Ends the alarm. Returns [`Status::Again`] while the machine is still slowing down, and the status of an alarm that
/// cannot end.
#[inline(never)]
#[small]
pub fn clear(links: &Links, settings: &Settings) -> Status {
    let alarm = machine::alarm();
    match alarm {
        Alarm::None => return Status::Ok,
        Alarm::Shutdown if switches::is_stopped(links.thread, settings) => return alarm.status(),
        _ => {}
    }
    if !machine::clear(links.thread) {
        return if alarm == Alarm::Panic { alarm.status() } else { Status::Again };
    }
    links.notices.limits_hit.set(0);
    hold::refuse_others(links);
    // A limit that was hit meanwhile has stopped steps while nothing moved.
    stepper::release(links.thread);
    links.reporter_wake.notify_now();
    Status::Ok
}
