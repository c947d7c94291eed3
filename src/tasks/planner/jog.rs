//! Jogging, `{jogx:..}`: moves one axis by hand, as fast as its traverse limit lets it, under its jerk limit.
//!
//! A jog begins at a standstill ([`View`](crate::tasks::view)). At its end, whether the target is reached or not, the
//! reporter says `{"jog":0}`. A sender ends a jog when a button is let go ([`jog`](crate::tasks::jog)). An exclamation
//! mark holds the jog, and a `%` after the exclamation mark ends it.

use kerf_macros::small;

use super::Planner;
use crate::gcode::command::Motion;
use crate::machine::Event;

impl Planner {
    /// Carries the jog out.
    pub(super) async fn jog(&mut self) {
        self.enter(Event::Jog);
        if self.standstill().await {
            self.begin_jog();
            self.sought().await;
        }
        self.end_jog();
    }

    #[inline(never)]
    #[small]
    fn begin_jog(&mut self) {
        let links = self.links;
        if let Motion::Jog { target } = &links.command_receiver().commands().motion {
            self.straight(target, None);
        }
    }

    #[small]
    fn end_jog(&mut self) {
        // In a flush, the jog ends with the flush, when the position is known.
        if !self.is_flushed() {
            self.links.set_position(&self.position);
            self.links.notices.jogged.set(true);
            self.enter(Event::Done);
        }
    }
}
