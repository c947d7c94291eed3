//! A summary of what the machine is doing. It combines the three parts of its [`State`](super::State), of which the
//! alarm takes precedence, then the hold, then the cycle.
//!
//! Each dialect has its own names for the values of [`Doing`]. TinyG's numbers for them are `stat`.

use super::{Alarm, Cycle};
use crate::machine;

/// What the machine is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doing {
    /// The machine is at rest: nothing is queued, it waits at a program stop, or it is in check mode.
    Rests,
    /// The machine carries lines out.
    Runs,
    /// The machine probes.
    Probes,
    /// The machine homes.
    Homes,
    /// The machine is jogged.
    Jogs,
    /// The machine is held, or the queue is being dropped.
    Holds,
    /// The machine is held, or the queue is being dropped, and the door is open.
    Door,
    /// An alarm is on.
    Alarm(Alarm),
}

/// Returns what the machine is doing. `works` says whether anything is queued or runs. It is called only if its answer
/// matters. Any level.
#[inline(always)]
pub fn doing(works: impl Fn() -> bool) -> Doing {
    if machine::is_alarmed() {
        return Doing::Alarm(machine::alarm());
    }
    if shows_hold(&works) {
        return if machine::has_open_door() { Doing::Door } else { Doing::Holds };
    }
    match machine::cycle() {
        Cycle::Probe => Doing::Probes,
        Cycle::Homing => Doing::Homes,
        Cycle::Jog => Doing::Jogs,
        Cycle::Lines if works() => Doing::Runs,
        Cycle::Lines | Cycle::Stopped | Cycle::Check => Doing::Rests,
    }
}

/// Whether senders are shown a hold. The short hold of a kill at standstill, which lasts until the waiting lines are
/// dropped, is not shown. Any level.
#[inline(always)]
pub fn shows_hold(works: impl Fn() -> bool) -> bool {
    let rests = || !works() || machine::is_stopped();
    machine::is_held() && !(machine::is_killing() && rests())
}
