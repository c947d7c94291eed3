//! One word for what the machine is doing: the three parts of its [`State`](super::State) together, the one that matters most first.
//!
//! Dialects spell it: `stat` is it in TinyG's numbers.

use super::{Alarm, Cycle};
use crate::machine;

/// What the machine is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doing {
    /// The machine rests: nothing is queued, or it waits at a program stop.
    Rests,
    /// The machine carries lines out.
    Runs,
    /// The machine probes.
    Probes,
    /// The machine homes.
    Homes,
    /// The machine is jogged.
    Jogs,
    /// The machine is held, or what is queued is being dropped.
    Holds,
    /// The machine is held, or what is queued is being dropped, and the door is open.
    Door,
    /// An alarm is on.
    Alarm(Alarm),
}

/// What the machine is doing; whether anything is queued or runs is asked by `works`, as late as may be. Thread mode.
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

/// Whether a hold is on that anybody is to see: not that of a kill at rest, which lasts until what waits is dropped. Thread mode.
#[inline(always)]
pub fn shows_hold(works: impl Fn() -> bool) -> bool {
    let rests = || !works() || machine::is_stopped();
    machine::is_held() && !(machine::is_killing() && rests())
}
