//! G33.1, rigid tapping: into the hole in step with the spindle, and back in step when the spindle has reversed.
//!
//! G33.1 begins as a pass does ([`thread`](super::thread)). The line is extended beyond the bottom of the hole by the
//! travel of [`OVERRUN_S`]. At the bottom, exec commands the spindle to reverse, and follows it until it stops within
//! that overrun. There the axes stand still until the first pulse in reverse. The remainder of the line is dropped, and
//! a line back is queued, which is extended beyond the start by an equal overrun. Exec keeps its phase on the way back.
//! At the start it commands the spindle to turn as before, and follows until the spindle does. A move without the
//! spindle then leads to the start. There is an alarm if the spindle has not reversed by the end of a line, or if no
//! pulse comes for 6 s.
//!
//! A feedhold waits for the end of the cycle.

use kerf_macros::small;

use super::Planner;
use super::parts::Ongoing;
use crate::encoder::COUNTS_PER_S;
use crate::gcode::command::{Feed, Motion};
use crate::motion::block::{Block, QueuedAction};
use crate::units::{FIRST_ROTARY, Length};

/// The time within which the spindle has to reverse, s: the overrun is the travel in this time.
const OVERRUN_S: f32 = 1.0;

/// A feed that is faster than any axis, mm/min.
const ANY_FEED: f32 = 1e6;

impl Planner {
    /// Whether the line is G33.1.
    #[small]
    pub(super) fn returns(&self) -> bool {
        matches!(
            self.links.command_receiver().commands().motion,
            Motion::Thread { returns: true, .. }
        )
    }

    /// Returns how far the axes may follow the spindle beyond an end, mm, with `turn` counts a turn and `lead` along
    /// the path.
    #[small]
    pub(super) fn overrun(turn: u32, lead: f32) -> f32 {
        lead * COUNTS_PER_S as f32 * OVERRUN_S / turn as f32
    }

    /// Makes exec keep its phase on the way back.
    #[small]
    pub(super) fn queue_return(&mut self) {
        if !self.is_flushed() {
            self.push(Block::action(QueuedAction::Return, self.line));
        }
    }

    /// Queues the way into the hole, or `back`, with its overrun. Returns false if it leads nowhere.
    #[inline(never)]
    #[small]
    pub(super) fn queue_leg(&mut self, turn: u32, back: bool) -> bool {
        let Ongoing::Pass(start) = self.walk else { return false };
        let (mut from, mut target) = (self.position, self.position);
        from[..FIRST_ROTARY].copy_from_slice(&start);
        let Some(piece) = self.piece(0, &from) else { return false };
        let beyond = Self::overrun(turn, piece.lead) / piece.length;
        let ends = start.iter().zip(&piece.target);
        for (target, (start, bottom)) in target.iter_mut().zip(ends) {
            let (from, to) = if back { (bottom, start) } else { (start, bottom) };
            let more = to.0.wrapping_sub(from.0) as f32 * beyond;
            *target = to.saturating_add(Length(more as i32));
        }
        self.straight(&target, Some(Feed::PerMinute(ANY_FEED)));
        true
    }
}
