//! G33.1, rigid tapping: into the hole in step with the spindle, and back in step when it has turned round.
//!
//! It begins as a pass does ([`thread`](super::thread)). The line leads beyond the bottom of the hole by what the spindle turns in
//! [`OVERRUN_S`]; at the bottom exec tells it to turn round and follows until it stands, which is somewhere in that way. There the axes rest until the first
//! pulse of the way back. What is left of the line is dropped, and a line back is queued, which leads as far beyond the start: exec goes on with the
//! phase that it has, tells the spindle to turn as before at the start, and follows until it has. A move without the spindle
//! leads to the start. A spindle that has not turned round by the end of a line is an alarm, as is one that gives no pulse for 6 s.
//!
//! A feedhold waits for the end of all that.

use kerf_macros::small;

use super::Planner;
use super::parts::Ongoing;
use crate::encoder::COUNTS_PER_S;
use crate::gcode::command::{Feed, Motion};
use crate::motion::block::{Block, QueuedAction};
use crate::units::{FIRST_ROTARY, Length};

/// The spindle has to turn round within the way that it has in so many seconds at its speed.
const OVERRUN_S: f32 = 1.0;

/// Faster than any axis, mm/min.
const ANY_FEED: f32 = 1e6;

impl Planner {
    /// Whether the line is G33.1.
    #[small]
    pub(super) fn returns(&self) -> bool {
        matches!(self.links.commands.borrow().motion, Motion::Thread { returns: true, .. })
    }

    /// How far the spindle has the axes go beyond an end, with so many counts a turn and such a lead along the path, mm.
    #[small]
    pub(super) fn overrun(turn: u32, lead: f32) -> f32 {
        lead * COUNTS_PER_S as f32 * OVERRUN_S / turn as f32
    }

    /// Has exec go on with its phase, back.
    #[small]
    pub(super) fn queue_return(&mut self) {
        if !self.is_flushed() {
            self.push(Block::action(QueuedAction::Return, self.line));
        }
    }

    /// Queues the way there, or back, and what is beyond. True if it leads anywhere.
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
