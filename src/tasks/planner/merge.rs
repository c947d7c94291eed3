//! Lines that are merged with the next one: less than half a step, and over before exec could prepare them.
//!
//! CAM files are full of such lines. As blocks of their own they would slow the path down to half a step in 0.75 ms each.
//! Only a line behind which others run is merged. The planner stays where the line began, and knows how far it went. The next
//! line begins there. What is not a line, and the last block that runs, have the way made up for first: so positions
//! at stops are exact.

use kerf_macros::small;

use super::Planner;
use crate::hal::event::{Event, wait};
use crate::motion::queue;
use crate::units::{Length, PerAxis};

impl Planner {
    /// Merges the way to `target` with the next line. Each axis goes at most what 16 bits hold.
    #[inline(never)]
    #[small]
    pub(super) fn merge(&mut self, target: &PerAxis<Length>) {
        for ((merged, to), from) in self.merged.iter_mut().zip(target).zip(&self.position) {
            *merged = to.0.wrapping_sub(from.0) as i16;
        }
        self.has_merged = true;
    }

    /// Waits until the last block runs.
    pub(super) fn nothing_follows(&self) -> impl Future<Output = ()> {
        wait(self.links.thread, Event::BlockDone, || self.is_last().then_some(()))
    }

    /// Queues what has been merged if the last block runs.
    pub(super) fn make_up(&mut self) {
        if self.has_merged && self.is_last() {
            self.go_on();
        }
    }

    /// Queues what has been merged. There is room.
    #[inline(never)]
    #[small]
    pub(super) fn go_on(&mut self) {
        let mut target = self.position;
        for (to, &way) in target.iter_mut().zip(&self.merged) {
            *to = Length(to.0.wrapping_add(way.into()));
        }
        self.straight(&target, None);
    }

    /// Whether the last block runs, and steps mean what they did: else a line comes that sees to it.
    fn is_last(&self) -> bool {
        queue::used() <= 1 && self.links.changes.is_empty() && !self.is_flushed()
    }
}
