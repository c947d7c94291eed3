//! Lines that follow the spindle: in step with its angle, at a feed per turn, and the retreat out of the cut.

use super::{Exec, PAUSE, PAUSE_S, SEGMENT_S, Step};
use crate::boards::outputs;
use crate::capability::Capability;
use crate::dda::Segment;
use crate::motion::block::{Block, Body, QueuedAction};
use crate::motion::float::{least, some};
use crate::motion::queue::BlockSource;
use crate::motion::retract::Retreat;
use crate::motion::snapshot::Snapshot;
use crate::motion::thread::Thread;
use crate::status::Status;

/// The least change of the spindle's share of its planned speed that has an effect.
const CHANGE: f32 = 0.005;

/// How long a feed waits for a spindle that stands still, s.
const PATIENCE_S: f32 = 6.0;

/// How lines follow the spindle.
#[derive(Debug, Default)]
pub(super) enum Follows {
    /// Lines do not depend on the spindle.
    #[default]
    Nothing,
    /// G95: feeds follow the measured speed of the spindle. The value is this speed as a share of the speed that
    /// feeds were planned for. If the spindle stands still, the value is 0 or less: minus the seconds for which a
    /// feed has waited.
    Speed(f32),
    /// G33, G33.1, or a pass of G76: lines follow the angle of the spindle.
    Angle(Thread),
    /// A pass of G33 or G76 has ended early: X leaves the cut while the axes decelerate to a standstill. Then the queue
    /// waits to be dropped.
    Retreats(Retreat),
}

impl Exec {
    /// Ends a G33.1 pass whose way back was still to come, because its blocks have been dropped. No line follows the
    /// spindle then.
    pub fn end_pass(&mut self) {
        if let Follows::Angle(thread) = &self.follows
            && thread.waits()
        {
            self.follows = Follows::Nothing;
        }
    }

    /// Ends the pass if nothing of it is left to do. A hold does not keep the pass: the spindle may pause then.
    #[small]
    pub(super) fn ends_pass(&mut self, blocks: &mut BlockSource) -> bool {
        let is_end =
            |block: &Block| matches!(block.body, Body::QueuedAction(QueuedAction::EndThread));
        let ends = Capability::Lathe.is_built_in()
            && matches!(self.follows, Follows::Angle(_))
            && !self.running.active
            && blocks.look(is_end) == Some(true);
        if ends {
            blocks.enter();
            blocks.release();
            self.follows = Follows::Nothing;
        }
        ends
    }

    /// Whether axes follow the spindle in a pass, so that the spindle must not pause.
    #[small]
    pub fn needs_spindle(&self) -> bool {
        match &self.follows {
            Follows::Angle(thread) if Capability::Lathe.is_built_in() => thread.has_begun(),
            _ => false,
        }
    }

    /// The pass in step with the spindle, if there is one.
    #[inline(always)]
    pub fn thread(&mut self) -> Option<&mut Thread> {
        match &mut self.follows {
            Follows::Angle(thread) if Capability::Lathe.is_built_in() => Some(thread),
            _ => None,
        }
    }

    /// Whether the spindle has reversed in a G33.1 pass and the axes stand still there. The remainder of the line is
    /// then to be dropped.
    pub fn has_turned(&self) -> bool {
        match &self.follows {
            Follows::Angle(thread) => thread.has_turned() && self.governor.is_at_rest(),
            _ => false,
        }
    }

    /// Returns why a pass has been left before its end, or `None` if none has. Until the remainder of the pass has been
    /// dropped, exec stays in a hold.
    #[inline(always)]
    pub fn has_left(&self) -> Option<Status> {
        match &self.follows {
            Follows::Retreats(retreat) if Capability::Lathe.is_built_in() => Some(retreat.why),
            _ => None,
        }
    }

    /// Whether feeds go by the measured speed of the spindle (G95).
    #[inline(always)]
    pub fn is_per_turn(&self) -> bool {
        Capability::Lathe.is_built_in() && matches!(self.follows, Follows::Speed(_))
    }

    /// Switches G95 on or off for the lines from here on.
    pub(super) fn go_by_speed(&mut self, on: bool) {
        self.follows = if on { Follows::Speed(1.0) } else { Follows::Nothing };
    }

    /// Sets the share of the planned speed at which the spindle turns; shares above 1 count as 1. A change of less than
    /// 0.5 % is ignored, because each change makes new ramps necessary.
    #[inline(never)]
    #[small]
    pub fn set_share(&mut self, share: f32) {
        let Follows::Speed(before) = &mut self.follows else { return };
        let share = least(share, 1.0);
        let off = share - *before;
        let (stands, stood) = (!some(share), *before <= 0.0);
        if stands != stood || !stands && !(-CHANGE..=CHANGE).contains(&off) {
            *before = share;
            self.governor.change_feed();
        }
    }

    /// Whether a feed has waited too long for the spindle. Returning true resets the time of the wait to 0.
    #[small]
    pub fn takes_too_long(&mut self) -> bool {
        match &mut self.follows {
            Follows::Speed(share) if *share < -PATIENCE_S => {
                *share = 0.0;
                true
            }
            _ => false,
        }
    }

    /// Sets whether a pass in step with the spindle is to end at once, within the cut: after an alarm, or when the
    /// program is killed.
    #[inline(always)]
    pub fn break_off(&mut self, at_once: bool) {
        self.breaks_off = at_once;
    }

    /// Prepares the next stretch of a line that follows the spindle. A feedhold leaves the cut if there is a retract;
    /// otherwise the hold waits for the end of the pass. Overrides have no effect.
    #[inline(never)]
    #[small]
    pub(super) fn follow(
        &mut self,
        blocks: &mut BlockSource,
        out: &mut Snapshot,
        segment: &mut Segment,
    ) -> Step {
        self.take_limits(blocks);
        let velocity = self.governor.velocity();
        let (kept, accel) = (self.prep.kept(), self.governor.accel());
        let brakes = self.brakes_for_end(velocity, accel);
        let at_rest = self.governor.is_at_rest();
        let Follows::Angle(thread) = &mut self.follows else { return Step::Again };
        let wanted = thread.velocity(kept, velocity, accel, brakes);
        if thread.is_to_turn(self.running.left) {
            // The exec task switches the spindle.
            out.outputs ^= outputs::COUNTERCLOCKWISE;
        }
        let breaks_off = self.breaks_off || thread.fault().is_some() || thread.rests();
        if at_rest && (breaks_off || !some(wanted)) {
            return self.await_spindle(out, segment);
        }
        let retract = thread.retract();
        // Whether the axes stop within this line.
        let fits = velocity * velocity < 2.0 * accel * self.running.left;
        let leaves = (breaks_off || self.hold) && retract.is_some() && fits;
        let stands =
            |block: &Block| matches!(&block.body, Body::Line(line) if line.keeps(retract.motors));
        if leaves && blocks.look(stands) == Some(true) {
            let why = thread.fault().unwrap_or(Status::Terminated);
            let retreat = Retreat::new(retract, why, self.prep.debt_of(retract.motors));
            self.prep.join(retract.motors, retreat.is_backwards());
            self.follows = Follows::Retreats(retreat);
            return Step::Leaves;
        }
        let (left, headroom) = (self.running.left, self.running.headroom);
        let cruise = least(wanted, self.running.cruise);
        self.governor.take(SEGMENT_S);
        let stretch = if breaks_off {
            self.governor.halt(left, headroom)
        } else {
            self.governor.stretch(left, cruise, headroom)
        };
        let before = self.running.left;
        let step = self.hand_out_coarsely(&stretch, blocks, out, segment);
        let left = if self.running.done { 0.0 } else { self.running.left };
        if let Follows::Angle(thread) = &mut self.follows {
            thread.handed(before - left);
        }
        step
    }

    /// Returns the velocity limit of the running line, mm/s, and whether the machine is to come to a standstill. Fails
    /// with the spindle's share of its planned speed if the line waits for a spindle that stands still.
    #[inline(always)]
    pub(super) fn limit(&mut self, blocks: &mut BlockSource) -> Result<(f32, bool), f32> {
        self.running.look_ahead(blocks, &mut self.governor);
        let (cruise, holds) = (self.running.cruise, self.hold);
        let Follows::Speed(share) = self.follows else { return Ok((cruise, holds)) };
        if !Capability::Lathe.is_built_in() || blocks.is_traverse() {
            return Ok((cruise, holds));
        }
        match share > 0.0 {
            true => Ok((cruise * share, holds)),
            false if self.governor.is_at_rest() && !holds => Err(share),
            false => Ok((cruise, true)),
        }
    }

    /// Prepares a pause in which a feed waits for a spindle that stands still, when the means are empty.
    #[inline(never)]
    #[small]
    pub(super) fn await_speed(
        &mut self,
        share: f32,
        out: &mut Snapshot,
        segment: &mut Segment,
    ) -> Step {
        let is_sampled = self.is_sampled();
        if is_sampled && self.empties(out, segment) {
            return Step::Segment;
        }
        self.follows = Follows::Speed(share - PAUSE_S);
        let step = self.await_spindle(out, segment);
        if is_sampled {
            out.left = 0.0;
        }
        step
    }

    /// Prepares a pause of 1 ms, in which the line waits for the spindle.
    #[inline(never)]
    #[small]
    pub(super) fn await_spindle(&mut self, out: &mut Snapshot, segment: &mut Segment) -> Step {
        let (ticks, period) = PAUSE;
        self.prep.pause(ticks, period, segment);
        out.left = self.running.left;
        Step::Segment
    }

    /// Updates the feed and the headroom of a line that follows the spindle, if they have changed.
    fn take_limits(&mut self, blocks: &mut BlockSource) {
        let version = blocks.version();
        let running = &mut self.running;
        if version != running.version {
            running.version = version;
            running.cruise = blocks.feed();
            blocks.take_changed();
            running.headroom = blocks.headroom();
        }
    }

    /// Whether the line has to slow down for its end within the next two stretches.
    fn brakes_for_end(&self, velocity: f32, accel: f32) -> bool {
        let running = &self.running;
        let far = running.left - 2.0 * SEGMENT_S * velocity;
        velocity * velocity - running.headroom > 2.0 * accel * far
    }

    /// Prepares the next stretch of a pass that has ended before its time: its axes slow down, and X leaves the cut.
    #[inline(never)]
    #[small]
    pub(super) fn retreat(
        &mut self,
        blocks: &mut BlockSource,
        out: &mut Snapshot,
        segment: &mut Segment,
    ) -> Step {
        let Follows::Retreats(retreat) = &self.follows else { return Step::Again };
        let (motors, backwards) = (retreat.motors(), retreat.is_backwards());
        if self.running.active && (self.running.done || !self.governor.is_at_rest()) {
            self.take_limits(blocks);
            self.prep.join(motors, backwards);
            let step = if self.running.done {
                self.end(0, false, blocks, segment)
            } else {
                let (left, headroom) = (self.running.left, self.running.headroom);
                self.governor.take(SEGMENT_S);
                let stretch = self.governor.halt(left, headroom);
                self.hand_out_coarsely(&stretch, blocks, out, segment)
            };
            if step != Step::Segment {
                return step;
            }
        } else {
            self.halt(out);
            self.prep.join(motors, backwards);
            self.prep.stand(motors, segment);
        }
        let Follows::Retreats(retreat) = &mut self.follows else { return Step::Segment };
        self.prep.add(retreat, segment, &mut out.target);
        Step::Segment
    }

    /// Moves X in a segment of `ticks` and `period` that is already queued. `write` receives the increment of X, and
    /// returns false if it is too late to change the segment.
    #[inline(always)]
    pub fn lead(
        &mut self,
        (ticks, period): (u16, u16),
        out: &mut Snapshot,
        write: impl FnOnce(u16) -> bool,
    ) {
        let Follows::Retreats(retreat) = &mut self.follows else { return };
        let increment = self.prep.plan_lead(retreat, ticks, period);
        if increment != 0 && write(increment) {
            self.prep.note_lead(retreat, increment, ticks, &mut out.target);
        } else {
            retreat.pause();
        }
    }

    /// Returns the motors of X that leave the cut, as bits, and whether they run backwards.
    #[small]
    pub fn leaving(&self) -> (u8, bool) {
        match &self.follows {
            Follows::Retreats(retreat) => (retreat.motors(), retreat.is_backwards()),
            _ => (0, false),
        }
    }
}
