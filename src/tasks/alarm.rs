//! The alarm that is on: how it begins and how it ends. What each of them does is in [`alarm`](crate::alarm).
//!
//! ```text
//!  raise   steps stop at once if it is sudden (the interrupt of a limit has stopped them already); outputs off;
//!          a hold, and Flush::Rest: data lines wait
//!  planner drop_blocks   exec, at rest or stopped, drops its blocks and counts what has been made, to the step
//!          restart       planner and model start from there; data lines are refused from now on
//!  clear   steps may be made again
//! ```
//!
//! Thread mode raises and clears, any level asks. Nothing here waits, and nothing can be full.

use kerf_macros::small;

use super::hold::{self, Flush};
use super::links::Links;
use super::spindle;
use super::switches;
use crate::alarm::Alarm;
use crate::config::Settings;
use crate::hal::byte::SharedByte;
use crate::hal::imp::stepper;
use crate::status::Status;

machine_static! {
    fn state() -> SharedByte = SharedByte::new(0);
}

/// The alarm that is on.
pub fn now() -> Alarm {
    Alarm::from_bits(state().get())
}

/// Whether there is one.
#[inline(always)]
pub fn is_on() -> bool {
    state().get() != 0
}

/// Begins an alarm, if there is none as bad.
#[small]
pub fn raise(links: &Links, alarm: Alarm) {
    raise_for(links, alarm, alarm.status());
}

/// The same for this reason, which is what it is told as.
#[inline(never)]
#[small]
pub fn raise_for(links: &Links, alarm: Alarm, reason: Status) {
    if alarm <= now() {
        return;
    }
    state().set(alarm as u8);
    if alarm.is_sudden() {
        stepper::stop();
        links.model.borrow_mut().forget_homes();
    }
    hold::abandon(links);
    spindle::stop();
    links.except(reason);
}

/// The machine has started as nobody wanted it to: whoever sends to it is to look first. Before anything runs.
pub fn wake_up_in(links: &Links) {
    state().set(Alarm::Alarm as u8);
    // The reporter looks before it waits.
    links.exception.set(Some(Status::HardReset));
}

/// Ends the alarm. [`Status::Again`] as long as the machine comes to rest.
#[inline(never)]
#[small]
pub fn clear(links: &Links, settings: &Settings) -> Status {
    let alarm = now();
    let stays = match alarm {
        Alarm::None => return Status::Ok,
        Alarm::Panic => true,
        Alarm::Shutdown => switches::is_stopped(settings),
        Alarm::Alarm | Alarm::Limit => false,
    };
    if stays {
        return alarm.status();
    }
    if links.flush.get() != Flush::None {
        return Status::Again;
    }
    links.limits_hit.set(0);
    // One that was hit meanwhile has stopped what stood still.
    stepper::release();
    state().set(0);
    links.reporter_wake.urge();
    Status::Ok
}
