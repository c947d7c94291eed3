//! Moves that end at a switch: what homing and probing are made of.
//!
//! The machine stands still. [`Planner::seek`] arms switches and queues the move, [`Planner::sought`] waits for what
//! comes of it: the end of the move, or a switch. At the switch exec comes to rest within the limits, as in a
//! feedhold; the rest of the move is dropped, the planner goes on from where the motors are, and the contact is
//! known to the step ([`contact`]). A feedhold on the way holds the move; a queue flush ends it.
//!
//! One line at a time: what comes behind it waits in the pool, and none is lost.

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
use crate::motion::snapshot::Snapshot;
use crate::tasks::common;
use crate::tasks::links::Changes;
use crate::tasks::setup::counted;
use crate::units::{FIRST_ROTARY, Length, PerAxis};

/// What has come of a move that is to end at a switch.
pub(super) enum Sought {
    /// The motors were there when the switch said so. They have come to rest further on.
    Contact([i32; MOTORS]),
    /// The move is at its end, and no switch has said so.
    End,
    /// What is queued is to be dropped.
    Flushed,
}

/// Has exec drop its blocks, as soon as it is at rest.
pub(super) fn drop_blocks(thread: Thread) -> impl Future<Output = ()> {
    machine::drop_blocks();
    wait(thread, Event::BlockDone, || machine::has_dropped_blocks().then_some(()))
}

impl Planner {
    /// Waits until everything queued is done and the steppers stand still. False if that is to be dropped.
    pub(super) async fn standstill(&mut self) -> bool {
        self.room().await;
        // Exec does not release it before.
        self.pause(QueuedAction::Outputs(self.outputs));
        wait(self.links.thread, Event::BlockDone, || {
            (queue::used() == 0 || self.is_flushed()).then_some(())
        })
        .await;
        !self.is_flushed()
    }

    /// Begins a move that ends at the first of the inputs `armed` (bits) that comes to be as in `awaited`. Nothing
    /// is queued. [`Planner::sought`] is next.
    pub(super) fn seek(&mut self, target: &PerAxis<Length>, feed: Feed, armed: u16, awaited: u16) {
        contact::clear();
        inputs::arm(armed, awaited);
        self.straight(target, Some(feed));
    }

    /// Waits for what comes of it. The switches are not armed any more.
    pub(super) async fn sought(&mut self) -> Sought {
        while self.has_begun() && !self.is_over() {
            self.seek_room().await;
            // Others have their turn: a long way is many blocks, and there may be room for all of them.
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
        inputs::arm(0, 0);
        self.begun = Begun::Nothing;
        if !contact::is_noted() || self.is_flushed() {
            contact::clear();
            return if self.is_flushed() { Sought::Flushed } else { Sought::End };
        }
        drop_blocks(self.links.thread).await;
        let motion = common::snapshot(self.links.thread);
        let steps = contact::take(&motion.target);
        self.relocate(&motion);
        steps.map_or(Sought::End, Sought::Contact)
    }

    /// Whether nothing more of the move is to be queued.
    fn is_over(&self) -> bool {
        contact::is_noted() || self.is_flushed()
    }

    fn seek_room(&self) -> impl Future<Output = ()> {
        wait(self.links.thread, Event::BlockDone, || {
            (self.queue.free() > 0 || self.is_over()).then_some(())
        })
    }

    /// Exec has dropped its blocks: the planner starts from where the motors are.
    #[inline(never)]
    #[small]
    pub(super) fn relocate(&mut self, motion: &Snapshot) {
        // Until steps have been counted anew they mean what they meant before; nothing has moved since.
        if !self.links.changes.has(Changes::STEPS) {
            self.position = self.located(&motion.target);
        }
        self.builder.place(&motion.target);
        self.queue.restart();
        (self.walk, self.begun) = (Ongoing::None, Begun::Nothing);
        self.outputs = Outputs { on: motion.outputs, speed: motion.speed };
        self.links.set_position(&self.position);
    }

    /// The position of every axis that a motor moves, unless the step is that at which it was to end.
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

    /// Takes the jerk of homing and probing for the axes that have both, until the line is done.
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
        self.links.changes.note(Changes::SETTINGS);
    }
}
