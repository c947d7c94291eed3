//! The overrides in force, shared by all that set or use them.
//!
//! Requests and real-time characters change overrides ([`change`]). So do M48 to M51 and the end of a program, when
//! exec comes to them ([`change_in_stream`]). Exec uses the factors from its next stretch on; stretches that are
//! already queued take 9 ms at most. A higher factor waits for the planner (`motion::replan`), which the control task
//! wakes ([`Event::Realtime`]). Nothing here waits, and nothing can be full.
//!
//! [`tell`] passes the factor of the spindle's speed on to the spindle.

use super::common::{self, Common};
use super::jog;
use super::links::Links;
use super::ports::Port;
use super::spindle;
use crate::gcode::overrides::{Change, FULL, LEAST, Override, Overrides};
use crate::hal::event::Event;
use crate::hal::{Interrupt, Thread, exec, flags, uart};
use crate::motion::factors::Factors;
use crate::motion::queue::{self, BlockSource};
use crate::realtime::{Asked, NO_JOG, TRAVERSE};

/// The least override that characters set in grbl's dialect, thousandths.
const LEAST_IN_ORDER: u16 = 100;

/// Returns the overrides as they are.
#[small]
pub fn now(thread: Thread) -> Overrides {
    common::with(thread, |common| common.overrides)
}

/// Changes the overrides at once.
#[small]
pub fn change(thread: Thread, change: Change) {
    exec::lock(thread, |ceiling| {
        let factors = Common.with(ceiling, |common| {
            common.overrides.change(change);
            factors(&common.overrides)
        });
        queue::store().want(factors, ceiling);
    });
    flags::set(Event::Realtime);
}

/// Fixes feed rates as programmed, whatever the overrides are, or ends that. Planner only.
#[cfg(feature = "drivers")]
pub fn fix_feed(thread: Thread, fixed: bool) {
    exec::lock(thread, |ceiling| {
        let factors = Common.with(ceiling, |common| {
            common.overrides.fix_feed(fixed);
            factors(&common.overrides)
        });
        queue::store().want(factors, ceiling);
    });
    flags::set(Event::Realtime);
}

/// In an image without drivers, nothing fixes feed rates.
#[cfg(not(feature = "drivers"))]
#[inline(always)]
pub fn fix_feed(_thread: Thread, _fixed: bool) {}

/// Makes a change that stands in the stream: the moves before it have been prepared.
#[small]
pub fn change_in_stream(
    _: Interrupt,
    overrides: &mut Overrides,
    change: Change,
    blocks: &mut BlockSource,
) {
    overrides.change(change);
    blocks.want(factors(overrides));
    flags::set(Event::Realtime);
}

/// Carries out override characters at once. Steps are clamped to the range, and further steps start from there. Control
/// only.
#[small]
pub fn serve(links: &Links) {
    for port in &links.ports {
        apply(links, port, uart::take_asked(links.thread, port.number));
    }
}

/// Carries out the override characters of a port. Thread mode.
#[inline(never)]
#[small]
pub fn apply(links: &Links, port: &Port, asked: Asked) {
    if asked == Asked::NOTHING {
        return;
    }
    if asked.fixed & NO_JOG != 0 {
        jog::end(links);
    }
    let least = if port.speech.get().is_in_order() { LEAST_IN_ORDER } else { LEAST };
    for (n, which) in [(0, Override::Feed), (1, Override::Spindle)] {
        step(links.thread, which, asked.percent[n], asked.fixed & 1 << n != 0, least);
    }
    let traverse = match (asked.fixed & TRAVERSE) >> 2 {
        0 => return,
        1 => FULL,
        2 => FULL / 2,
        _ => FULL / 4,
    };
    change(links.thread, Change::to(Override::Traverse, traverse));
}

/// Changes an override by `percent`; from 100 % if `anew`.
#[small]
fn step(thread: Thread, which: Override, percent: i8, anew: bool, least: u16) {
    if percent == 0 && !anew {
        return;
    }
    let before = if anew { FULL } else { now(thread).factor(which) };
    // If it has been set lower, a step down does not raise it.
    let least = least.min(before).cast_signed();
    let factor = (before.cast_signed() + 10 * i16::from(percent)).max(least);
    change(thread, Change::to(which, factor.cast_unsigned().min(which.most())));
}

/// Tells other tasks that overrides may have changed. Control only.
#[small]
pub fn tell(links: &Links) {
    spindle::follow(links.thread, now(links.thread).in_force(Override::Spindle));
    links.wake_planner();
    flags::set(Event::BlockDone);
    links.reporter_wake.signal();
}

/// Returns the factors for motion. A factor of 1 is exact: velocities are then as programmed, to the bit.
#[inline(never)]
#[small]
fn factors(overrides: &Overrides) -> Factors {
    let factor = |which| f32::from(overrides.in_force(which)) * 0.001;
    Factors { feed: factor(Override::Feed), traverse: factor(Override::Traverse) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_overridden_is_as_programmed() {
        assert!(factors(&Overrides::NONE).same(&Factors::ONE));
    }
}
