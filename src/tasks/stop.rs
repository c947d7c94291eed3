//! Lines that begin an alarm: they act when they arrive, and are answered in their turn.
//!
//! Lines of one port are answered in their order, and the answers before one may take a second. So the reader looks at each short
//! control line that completes in the pool ([`LinePool::take_stop`]), and at those that wait
//! in a receive ring behind a full pool ([`Scan`](super::overtake::Scan)), and raises the alarm at once. When the parser comes to
//! the line it begins the alarm again if a line before it has ended it, but not if the other port has
//! ([`Port::has_stopped`](super::ports::Port::has_stopped), [`Links::cleared_by`]).
//!
//! Which lines these are is said by [`asks_alarm`](crate::protocol::asks_alarm). Thread mode.

use kerf_macros::small;

use super::alarm;
use super::lines::LinePool;
use super::links::Links;
use crate::machine::Alarm;

/// Begins the alarm that lines ask for which have come into a pool, unless it has `begun` when they were in the ring.
#[inline(never)]
#[small]
pub fn serve(links: &Links, pool: &mut LinePool, begun: bool) {
    let stop = pool.take_stop();
    if stop != Alarm::None && !begun {
        alarm::raise(links, stop);
    }
}
