//! The overrides in force: one state for all who change it, and all who go by it.
//!
//! Changed by requests and real-time characters ([`change`]), and by M48 to M51 and the end of a
//! program when exec comes to them ([`change_in_stream`]). Exec goes by the factors from its next stretch on: what is
//! queued takes 9 ms at most. A factor that rises waits for the planner (`motion::replan`), which the
//! control task wakes: [`Event::Realtime`]. Nothing here waits, and nothing can be full.
//!
//! [`tell`] passes the factor of the spindle's speed on to those who drive it.

use super::common::{self, Common};
use super::jog;
use super::links::Links;
use super::ports::Port;
use super::spindle;
use crate::gcode::overrides::{Change, FULL, LEAST, Override, Overrides};
use crate::hal::Thread;
use crate::hal::event::Event;
use crate::hal::{exec, flags, uart};
use crate::motion::factors::Factors;
use crate::motion::queue::{self, BlockSource};
use crate::realtime::{Asked, NO_JOG, TRAVERSE};

/// The least that characters ask for in grbl's dialect.
const LEAST_IN_ORDER: u16 = 100;

/// The overrides as they are.
#[small]
pub fn now(thread: Thread) -> Overrides {
    common::with(thread, |common| common.overrides)
}

/// Changes them at once.
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

/// Has feed rates be as programmed whatever overrides are, or not any more. Planner only.
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

/// Nothing fixes them.
#[cfg(not(feature = "drivers"))]
#[inline(always)]
pub fn fix_feed(_thread: Thread, _fixed: bool) {}

/// The moves behind which the change stands have been prepared. Exec only.
#[small]
pub fn change_in_stream(overrides: &mut Overrides, change: Change, blocks: &mut BlockSource) {
    overrides.change(change);
    blocks.want(factors(overrides));
    flags::set(Event::Realtime);
}

/// Does what real-time characters ask for. A step that would go too far goes as far as may be; whatever they ask for
/// counts from then on. Control only.
#[small]
pub fn serve(links: &Links) {
    for port in &links.ports {
        apply(links, port, uart::take_asked(port.number));
    }
}

/// Does what characters on a port ask for. Thread mode.
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
    // One that has been set lower is not raised by asking for less.
    let least = least.min(before).cast_signed();
    let factor = (before.cast_signed() + 10 * i16::from(percent)).max(least);
    change(thread, Change::to(which, factor.cast_unsigned().min(which.most())));
}

/// Tells the others that they may have changed. Control only.
#[small]
pub fn tell(links: &Links) {
    spindle::follow(links.thread, now(links.thread).in_force(Override::Spindle));
    links.planner_wake.signal();
    flags::set(Event::BlockDone);
    links.reporter_wake.signal();
}

/// What motion goes by. 1 is exact: velocities are as programmed, to the bit.
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
