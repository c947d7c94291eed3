//! Heaters and the fan: switched where they stand in the program, by blocks that the machine goes on over; and waits for them.
//!
//! A wait begins when all moves before it have been made. It keeps the lines behind it back, and nothing else: a stop, a flush and questions
//! have their effect at once, and [`Heaters::end_wait`](crate::tasks::heat::Heaters::end_wait) ends it.

use kerf_macros::small;

use super::Planner;
use crate::gcode::command::Motion;
use crate::gcode::heating::{Heat, Wait};
use crate::hal::event::{Event, wait};
use crate::motion::block::{Action, Block};
use crate::motion::queue;

impl Planner {
    /// Queues what a line asks for. Whether motion is to wait for it.
    #[inline(never)]
    #[small]
    pub(super) fn heat(&mut self, heat: &Heat) -> bool {
        if heat.to.is_some() {
            self.heats = *heat != Heat::OFF;
            let _ = self.queue.push_aside(Block::action(Action::Heat(*heat), self.line));
            self.announce();
        }
        heat.wait != Wait::Nothing
    }

    /// Waits until the heaters that the line names are as hot as it asks for, or somebody ends that.
    pub(super) async fn await_heat(&self) {
        let links = self.links;
        wait(links.thread, Event::BlockDone, || {
            (queue::used() == 0 || self.is_flushed()).then_some(())
        })
        .await;
        if let Motion::Heat(heat) = &links.commands.borrow().motion {
            links.heat.begin_wait(*heat);
        }
        wait(links.thread, Event::BlockDone, || {
            (!links.heat.waits() || self.is_flushed()).then_some(())
        })
        .await;
        links.heat.end_wait();
    }
}
