//! G33: a pass in step with the spindle ([`crate::motion::thread`]).
//!
//! The machine stands still. [`Planner::thread`] waits until the encoder tells how fast the spindle turns, sees that no axis would have to go faster
//! than it may, and queues the pass: what exec is to follow, the line, and its end. Nothing has moved before, and when something is not
//! as it should be, nothing does: an alarm says what it is. In the pass the planner waits. If exec loses the spindle, the axes come to rest, and an alarm
//! says so; the position is known to the step. A feedhold waits for the end of the pass, an alarm does not.
//!
//! **Limits.** The pass has the axes' acceleration limits and no jerk limit, for it has to follow. An axis with a jerk limit J has
//! at most the acceleration `sqrt(J v) / 2`, with v its speed in the thread: that of a ramp under the limit, in the mean.
//!
//! One line at a time: what comes behind it waits in the pool.

use embassy_futures::yield_now;
use kerf_macros::small;

use super::Planner;
use crate::encoder::COUNTS_PER_S;
use crate::gcode::command::{Feed, Motion};
use crate::hal::event::{Event, wait};
use crate::hal::time::millis;
use crate::machine::Alarm;
use crate::math::sqrt;
use crate::motion::block::{Action, Block};
use crate::motion::dynamics::{Machine, PER_SECOND_CUBED, PER_SECOND_SQUARED};
use crate::motion::queue;
use crate::status::Status;
use crate::tasks::links::Changes;
use crate::tasks::{alarm, common};
use crate::units::{AXES, FIRST_ROTARY};

/// How long a pulse may take to come, ms.
const PATIENCE_MS: u32 = 6_000;

/// Index pulses that tell how fast the spindle turns.
const ENOUGH: u8 = 3;

/// Faster than any axis, mm/min.
const ANY_FEED: f32 = 1e6;

impl Planner {
    /// Cuts the thread of the line, or says why not.
    pub(super) async fn thread(&mut self) {
        if !self.standstill().await {
            return;
        }
        let turn = match self.spindle_turns().await {
            Ok(Some(turn)) => turn,
            Ok(None) => return,
            Err(status) => return self.refuse(status),
        };
        match self.begin_pass(turn) {
            Ok(true) => {}
            Ok(false) => return,
            Err(status) => return self.refuse(status),
        }
        self.room().await;
        self.queue_pass();
        while self.has_begun() && !self.is_flushed() {
            self.room().await;
            yield_now().await;
            if !self.is_flushed() {
                let _: super::Turn = self.turn();
            }
        }
        self.room().await;
        if !self.is_flushed() {
            self.pause(Action::Thread(0.0));
        }
        let lost = wait(self.links.thread, Event::BlockDone, || {
            let lost = common::with(self.links.thread, |common| common.encoder.lost);
            (lost || queue::used() == 0 || self.is_flushed()).then_some(lost)
        })
        .await;
        if lost && !self.is_flushed() {
            alarm::raise_for(self.links, Alarm::Alarm, Status::SpindleLost);
        }
    }

    /// Waits until the encoder tells how long a turn takes, in counts. `None` if what is queued is to be dropped.
    async fn spindle_turns(&self) -> Result<Option<u32>, Status> {
        let (mut since, mut last) = (millis(), 0);
        // The power task looks at the encoder, and says so.
        wait(self.links.thread, Event::BlockDone, || {
            if self.is_flushed() {
                return Some(Ok(None));
            }
            let (seen, synced, turn) = common::with(self.links.thread, |common| {
                let (seen, synced) = common.encoder.seen();
                (seen, synced, common.encoder.turn())
            });
            if seen >= ENOUGH && synced && turn != 0 {
                return Some(Ok(Some(turn)));
            }
            if seen != last {
                last = seen;
                if seen < ENOUGH {
                    since = millis();
                }
            }
            let late = millis().wrapping_sub(since) > PATIENCE_MS;
            late.then_some(Err(if seen < ENOUGH { Status::NoIndex } else { Status::NoSync }))
        })
        .await
    }

    /// Tells exec of the pass, with so many counts a turn, and puts its limits into force. False if the line goes nowhere.
    #[inline(never)]
    #[small]
    fn begin_pass(&mut self, turn: u32) -> Result<bool, Status> {
        let links = self.links;
        let commands = links.commands.borrow();
        let Motion::Thread { target, lead } = &commands.motion else { return Ok(false) };
        let mut ways = [0.0; AXES];
        let (mut most, mut square) = (0.0f32, 0.0);
        for ((way, to), from) in ways.iter_mut().zip(target).zip(&self.position) {
            let size = (to.0 as f32 - from.0 as f32) * 1e-4;
            let size = if size < 0.0 { -size } else { size };
            *way = size;
            square += size * size;
            if size > most {
                most = size;
            }
        }
        if most == 0.0 {
            return Ok(false);
        }
        let lead = lead.0 as f32 * 1e-4;
        let turns_per_s = COUNTS_PER_S as f32 / turn as f32;
        let settings = links.settings.borrow();
        for (n, (axis, way)) in
            self.dynamics.axes.iter_mut().zip(ways).enumerate().take(FIRST_ROTARY)
        {
            let speed = lead * turns_per_s * way / most;
            if speed > axis.feed {
                return Err(Status::VelocityExceeded);
            }
            let jerk = Machine::jerk_max(&*settings, n) * PER_SECOND_CUBED;
            let mut accel = Machine::accel_max(&*settings, n) * PER_SECOND_SQUARED;
            if jerk > 0.0 && way > 0.0 {
                let mean = 0.5 * sqrt(jerk * speed);
                accel = if accel > 0.0 && accel < mean { accel } else { mean };
            }
            axis.limit_change(accel, 0.0);
        }
        // They are the settings' again for the next line.
        links.changes.note(Changes::SETTINGS);
        common::with(links.thread, |common| common.encoder.lost = false);
        let lead = lead * sqrt(square) / most;
        self.push(Block::action(Action::Thread(lead), self.line));
        Ok(true)
    }

    /// Queues the line, or begins with its parts.
    #[inline(never)]
    #[small]
    fn queue_pass(&mut self) {
        let links = self.links;
        let commands = links.commands.borrow();
        if let Motion::Thread { target, .. } = &commands.motion {
            self.straight(target, Some(Feed::PerMinute(ANY_FEED)));
        }
    }

    /// Nothing has moved, and nothing will.
    #[inline(never)]
    #[small]
    fn refuse(&mut self, status: Status) {
        // The line says that the machine is at its end.
        self.links.model.borrow_mut().set_position(&self.position);
        alarm::raise_for(self.links, Alarm::Alarm, status);
    }
}
