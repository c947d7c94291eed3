//! Moves that end at a switch, for homing and probing.
//!
//! A seek begins at a standstill. [`Planner::seek`] arms switches and queues the move. [`Planner::sought`] waits for
//! the end of the move, or for a switch. At the switch exec decelerates within the limits, as in a feedhold. The
//! remainder of the move is dropped, and the planner continues from where the motors are. The contact is known to the
//! step ([`contact`]). A feedhold on the way holds the move; a queue flush ends it.
//!
//! Only one line is carried out at a time: later lines wait in the pool, and none is lost.

use embassy_futures::yield_now;
use kerf_macros::small;

use super::parts::Ongoing;
use super::{Begun, Planner, Turn};
use crate::boards::MOTORS;
use crate::dda::contact;
use crate::gcode::command::Feed;
use crate::hal::Thread;
use crate::hal::event::{Event, wait};
use crate::hal::inputs;
use crate::machine;
use crate::motion::block::{Outputs, QueuedAction};
use crate::motion::dynamics::{MachineLimits, PER_SECOND_CUBED, PER_SECOND_SQUARED};
use crate::motion::queue;
use crate::motion::smooth::Spans;
use crate::motion::snapshot::Snapshot;
use crate::tasks::common;
use crate::tasks::links::Changes;
use crate::tasks::setup::counted;
use crate::units::{FIRST_ROTARY, Length, PerAxis};

/// The end of a move that is to end at a switch.
pub(super) enum Sought {
    /// A switch has ended the move. The motors were at these steps then; they have stopped further on.
    Contact([i32; MOTORS]),
    /// The move has come to its end without a switch.
    End,
    /// The queue is to be dropped.
    Flushed,
}

/// Makes exec drop its blocks as soon as it is at a standstill, and waits for that.
pub(super) fn drop_blocks(thread: Thread) -> impl Future<Output = ()> {
    machine::drop_blocks(thread);
    wait(thread, Event::BlockDone, || machine::has_dropped_blocks().then_some(()))
}

impl Planner {
    /// Waits until everything queued is done and the steppers stand still. Returns false if the queue is to be dropped.
    pub(super) async fn standstill(&mut self) -> bool {
        self.room().await;
        // Exec releases this block only at a standstill.
        self.pause(QueuedAction::Outputs(self.outputs));
        wait(self.links.thread, Event::BlockDone, || {
            (queue::used() == 0 || self.is_flushed()).then_some(())
        })
        .await;
        !self.is_flushed()
    }

    /// Begins a move that ends at the first of the inputs `armed` (bits) that becomes as in `awaited`. Nothing may be
    /// queued yet. [`Planner::sought`] is to be called next.
    pub(super) fn seek(&mut self, target: &PerAxis<Length>, feed: Feed, armed: u16, awaited: u16) {
        contact::clear(self.links.thread);
        inputs::arm(self.links.thread, armed, awaited);
        self.straight(target, Some(feed));
    }

    /// Waits for the end of the move that [`Planner::seek`] has begun, and disarms the switches.
    pub(super) async fn sought(&mut self) -> Sought {
        while self.has_begun() && !self.is_over() {
            self.seek_room().await;
            // Other tasks have their turn: a long move is many blocks, and there may be room for all of them.
            yield_now().await;
            if !self.is_over() {
                let _: Turn = self.turn();
            }
        }
        self.seek_room().await;
        if !self.is_over() {
            self.pause(QueuedAction::Outputs(self.outputs));
        }
        wait(self.links.thread, Event::BlockDone, || {
            (queue::used() == 0 || self.is_over()).then_some(())
        })
        .await;
        inputs::arm(self.links.thread, 0, 0);
        self.begun = Begun::Nothing;
        if !contact::is_noted() || self.is_flushed() {
            contact::clear(self.links.thread);
            return if self.is_flushed() { Sought::Flushed } else { Sought::End };
        }
        drop_blocks(self.links.thread).await;
        let motion = common::snapshot(self.links.thread);
        let steps = contact::take(self.links.thread, &motion.target);
        self.relocate(&motion);
        steps.map_or(Sought::End, Sought::Contact)
    }

    /// Whether no further part of the move is to be queued.
    fn is_over(&self) -> bool {
        contact::is_noted() || self.is_flushed()
    }

    fn seek_room(&self) -> impl Future<Output = ()> {
        wait(self.links.thread, Event::BlockDone, || {
            (self.queue.free() > 0 || self.is_over()).then_some(())
        })
    }

    /// Starts from where the motors are, when exec has dropped its blocks.
    #[inline(never)]
    #[small]
    pub(super) fn relocate(&mut self, motion: &Snapshot) {
        // Until steps have been computed again, they do not fit the settings. The position stays: nothing has moved
        // since.
        if !self.links.changes.has(Changes::STEPS) {
            self.position = self.located(&motion.target);
        }
        self.builder.place(&motion.target);
        self.queue.restart();
        (self.walk, self.begun) = (Ongoing::None, Begun::Nothing);
        self.outputs = Outputs { on: motion.outputs, speed: motion.speed };
        self.links.set_position(&self.position);
    }

    /// Returns the position by the steps of the motors. An axis that no motor moves stays where it is. An axis stays
    /// as well if its motor is at the very step at which it was to end.
    #[small]
    pub(super) fn located(&self, steps: &[i32; MOTORS]) -> PerAxis<Length> {
        let settings = self.links.settings.borrow();
        let mut located = self.position;
        for (axis, place) in located.iter_mut().enumerate() {
            *place = counted(&settings, steps, axis, Some(&self.position)).unwrap_or(*place);
        }
        #[cfg(feature = "bed-plane")]
        self.lower(&settings, steps, &mut located);
        located
    }

    /// Takes the jerk limit of homing and probing, until the line is done, for the axes that have both jerk limits. No
    /// mean rounds corners, because the moves have none. The machine stands still, and nothing is queued.
    #[small]
    pub(super) fn brake_hard(&mut self) {
        let settings = self.links.settings.borrow();
        for (n, axis) in self.dynamics.axes.iter_mut().enumerate().take(FIRST_ROTARY + 1) {
            let hard = settings.jerk_homing(n);
            if hard > 0.0 && axis.jerk.get() > 0.0 {
                let accel = MachineLimits::accel_max(&*settings, n) * PER_SECOND_SQUARED;
                axis.limit_change(accel, hard * PER_SECOND_CUBED);
            }
        }
        drop(settings);
        self.smooth(Spans::alone(self.dynamics.build_up()));
        self.links.changes.note(Changes::SETTINGS);
    }
}
