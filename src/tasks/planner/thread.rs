//! G33, and each pass of G76: a pass in step with the spindle ([`crate::motion::thread`]).
//!
//! A pass begins at a standstill. [`Planner::thread`] waits until the encoder gives the speed of the spindle, and
//! checks that no axis would have to go faster than it may. Then it queues the pass: its start, its lines, and its end.
//! A pass of G76 has a line for each taper, and exec is told the lead of each line. If something is wrong, an alarm
//! reports it before anything moves. During the pass the planner waits. If exec loses the spindle, the axes stop and an
//! alarm reports it; the position is known to the step. In a feedhold X leaves the cut if the settings give a distance;
//! otherwise the hold waits for the end of the pass. An alarm does not wait.
//!
//! **Limits.** A pass has the acceleration limits of the axes and no jerk limit, because the axes have to follow the
//! spindle. An axis with a jerk limit J has at most the acceleration `sqrt(J v) / 2`, where v is its speed in the
//! thread: this is the mean acceleration of a ramp under the jerk limit.
//!
//! Only one line is carried out at a time: later lines wait in the pool.

use embassy_futures::yield_now;
use kerf_macros::small;

use super::Planner;
use super::parts::Ongoing;
use super::seek::drop_blocks;
use crate::boards::{MOTORS, outputs};
use crate::config::groups::spindle;
use crate::config::{Owner, Setting};
use crate::encoder::COUNTS_PER_S;
use crate::gcode::command::{Feed, Motion};
use crate::gcode::setup::Setup;
use crate::hal::event::{Event, wait};
use crate::hal::time::millis;
use crate::machine::{self, Alarm};
use crate::math::sqrt;
use crate::motion::block::{Block, Pass, QueuedAction};
use crate::motion::dynamics::{MachineLimits, PER_SECOND_CUBED, PER_SECOND_SQUARED};
use crate::motion::float::{greater, some};
use crate::motion::queue;
use crate::motion::retract::Retract;
use crate::motion::short::Short;
use crate::status::Status;
use crate::tasks::links::Changes;
use crate::tasks::setup::moved_by;
use crate::tasks::{alarm, common};
use crate::units::{FIRST_ROTARY, Length, PerAxis};

/// How long an index pulse may take to come, ms.
const PATIENCE_MS: u32 = 6_000;

/// The least mean time between two pulses of sync in a pass, counts: 6,000 pulses a second. With more of them there is too
/// little time for answers.
const PULSE_LEAST: u32 = COUNTS_PER_S / 6_000;

/// A feed that is faster than any axis, mm/min.
const ANY_FEED: f32 = 1e6;

/// A junction acceleration at which corners of any angle are taken at speed, mm/s^2.
const ANY_CORNER: f32 = 1e7;

/// The most steps by which X leaves the cut.
const WAY_MAX: i32 = i16::MAX as i32;

/// A line of a pass.
pub(super) struct Piece {
    pub target: PerAxis<Length>,
    /// The distances of the axes; in `length`, the distance along the path, mm.
    ways: [f32; FIRST_ROTARY],
    pub length: f32,
    /// The lead along the path, mm a turn.
    pub lead: f32,
}

/// Parts of the way back to the start of a pass: `0..BACK_IN` after a feedhold has left the cut, `BACK_IN..BACK_OUT`
/// in G33.1.
const BACK_IN: u8 = 3;
const BACK_OUT: u8 = 5;

/// The end of the lines of a pass.
#[derive(Clone, Copy, PartialEq)]
enum End {
    /// The lines are done, or the queue is dropped.
    Done,
    /// A feedhold has left the cut.
    Left,
    /// G33.1: the spindle has reversed.
    Turned,
}

/// The number of the X axis.
const X: u8 = 0;

/// Returns the acceleration limit of an axis that has no jerk limit in a pass. It is at most the mean acceleration of
/// a ramp to `speed` under the usual jerk limit.
#[inline(never)]
#[small]
fn mean_accel(accel: f32, jerk: f32, speed: f32) -> f32 {
    if jerk > 0.0 && some(speed) {
        let mean = 0.5 * sqrt(jerk * speed);
        return if accel > 0.0 && accel < mean { accel } else { mean };
    }
    accel
}

impl Planner {
    /// Waits until the encoder gives the speed of the spindle. Then makes the pass of the line if it `cuts`, or begins
    /// an alarm that says why it cannot be made. A pass that a feedhold has left is made once more from its beginning
    /// when the hold is over.
    pub(super) async fn thread(&mut self, cuts: bool) {
        loop {
            self.walk = Ongoing::None;
            if !self.standstill().await {
                return;
            }
            let turn = match self.spindle_turns().await {
                Ok(Some(turn)) => turn,
                Ok(None) => return,
                Err(status) => return self.refuse(status),
            };
            if !cuts {
                return match self.check_cycle(turn) {
                    Ok(()) => {}
                    Err(status) => self.refuse(status),
                };
            }
            match self.begin_pass(turn) {
                Ok(true) => {}
                Ok(false) => return,
                Err(status) => return self.refuse(status),
            }
            let mut back = false;
            let end = loop {
                let mut line = 0;
                self.pass_room().await;
                while self.queue_line(line, turn, back) {
                    self.finish_parts().await;
                    line += 1;
                    self.pass_room().await;
                    if self.queue_lead(line) {
                        self.pass_room().await;
                    }
                }
                self.queue_end();
                wait(self.links.thread, Event::BlockDone, || {
                    (queue::used() == 0 || self.is_cut_short()).then_some(())
                })
                .await;
                let end = self.end();
                if matches!(end, End::Left | End::Turned) {
                    drop_blocks(self.links.thread).await;
                    self.relocate_within();
                }
                if end != End::Turned || back {
                    break end;
                }
                back = true;
                self.set_pass(Status::Ok);
                self.queue_return();
            };
            let parts = match end {
                End::Done => break,
                End::Left => 0..BACK_IN,
                End::Turned => BACK_IN..BACK_OUT,
            };
            for part in parts {
                self.room().await;
                self.go_back(part);
                self.finish_parts().await;
            }
            if end == End::Turned {
                break;
            }
        }
        // The other moves of G76 have their usual limits.
        self.walk = Ongoing::None;
        self.take_up_changes();
    }

    /// Returns how the queued lines have ended. Begins an alarm if the pass has failed.
    #[inline(never)]
    #[small]
    fn end(&mut self) -> End {
        let pass = self.pass();
        let returns = self.returns();
        if !(returns && pass == Status::Noop) {
            self.set_pass(Status::Again);
        }
        match pass {
            _ if self.is_flushed() => return End::Done,
            Status::Noop => return End::Turned,
            Status::Terminated => return End::Left,
            Status::Ok if !returns => return End::Done,
            Status::Ok => alarm::raise_for(self.links, Alarm::Alarm, Status::NotReversed),
            why => alarm::raise_for(self.links, Alarm::Alarm, why),
        }
        End::Done
    }

    /// Queues the end of a pass, unless it returns or is cut short. There is room.
    #[small]
    fn queue_end(&mut self) {
        if !self.returns() && !self.is_cut_short() {
            self.pause(QueuedAction::EndThread);
        }
    }

    /// Queues the remainder of a line that takes several blocks.
    pub(super) async fn finish_parts(&mut self) {
        while self.has_begun() && !self.is_flushed() {
            self.pass_room().await;
            yield_now().await;
            if !self.is_flushed() {
                let _: super::Turn = self.turn();
            }
        }
    }

    /// Returns the status of the pass.
    #[small]
    pub(super) fn pass(&self) -> Status {
        common::with(self.links.thread, |common| common.encoder.pass)
    }

    /// Whether no further part of the pass is to be queued.
    #[small]
    pub(super) fn is_cut_short(&self) -> bool {
        self.is_flushed() || !matches!(self.pass(), Status::Ok | Status::Again)
    }

    fn pass_room(&mut self) -> impl Future<Output = ()> {
        wait(self.links.thread, Event::BlockDone, || {
            (self.queue.free() > 0 || self.is_cut_short()).then_some(())
        })
    }

    /// Starts from where the motors are, when exec has dropped its blocks within a pass. The end of the line and the
    /// start of the pass stay as they are.
    #[inline(never)]
    #[small]
    pub(super) fn relocate_within(&mut self) {
        let end = *self.links.model.borrow().position();
        let motion = common::snapshot(self.links.thread);
        let start = core::mem::replace(&mut self.walk, Ongoing::None);
        self.relocate(&motion);
        self.walk = start;
        self.links.set_position(&end);
    }

    /// Queues a part of the way back to the start of a pass. After a feedhold: X out of the cut, along the cut, and X
    /// back. In G33.1: the end of the pass, and then one move to the start.
    #[inline(never)]
    #[small]
    fn go_back(&mut self, part: u8) {
        let Ongoing::Pass([x, y, z]) = self.walk else { return };
        if self.is_flushed() {
            return;
        }
        let mut target = self.position;
        let beside = self.beside(x);
        let [to_x, to_y, to_z, ..] = &mut target;
        match part {
            BACK_IN => {
                self.set_pass(Status::Again);
                self.pause(QueuedAction::EndThread);
                self.take_up_changes();
                return;
            }
            part if part > BACK_IN => (*to_x, *to_y, *to_z) = (x, y, z),
            0 => {
                self.take_up_changes();
                *to_x = if beside < x { beside.min(*to_x) } else { beside.max(*to_x) };
            }
            1 => (*to_y, *to_z) = (y, z),
            _ => *to_x = x,
        }
        self.straight(&target, None);
    }

    /// Returns by how much X leaves the cut before the end of a pass, from the settings.
    #[small]
    fn retract_length(&self) -> Length {
        let length = self.spindle_setting(spindle::R);
        match &self.links.command_receiver().commands().motion {
            // X leaves towards the drive line.
            Motion::ThreadCycle(cycle) if cycle.peak.0 < 0 => Length(length.abs()),
            Motion::ThreadCycle(_) => Length(-length.abs()),
            _ => Length(length),
        }
    }

    /// Returns where X is when it has left the cut from `x`: within its travel.
    #[inline(never)]
    #[small]
    fn beside(&self, x: Length) -> Length {
        let end = x.saturating_add(self.retract_length());
        match Setup::travel(&*self.links.settings.borrow(), X) {
            Some((low, high)) => end.max(low).min(high),
            None => end,
        }
    }

    /// Returns how X leaves the cut, with the limits of the axis as they are now.
    #[inline(never)]
    #[small]
    fn retract(&self) -> Retract {
        let [x, ..] = self.position;
        let end = self.beside(x).0;
        let settings = self.links.settings.borrow();
        // X stays if it is beyond its travel: it would leave the cut through the work.
        if (end < x.0) != (self.retract_length().0 < 0) {
            return Retract::NONE;
        }
        let mut retract = Retract::NONE;
        let mut whole = 0;
        for motor in (0..MOTORS).filter(|motor| moved_by(&settings, *motor) == X) {
            let ratio = settings.step_ratio(motor);
            let way = ratio.steps(Length(end)).wrapping_sub(ratio.steps(x));
            // All motors of the axis must make equal steps, or the axis stays.
            if way == 0 || retract.is_some() && whole != way {
                return Retract::NONE;
            }
            whole = way;
            retract.way = way.clamp(-WAY_MAX, WAY_MAX) as i16;
            retract.motors |= 1 << motor;
        }
        let per_mm = whole.unsigned_abs() as f32 / (end.abs_diff(x.0) as f32 * 1e-4);
        let velocity = MachineLimits::velocity_max(&*settings, 0) * (1.0 / 60.0);
        let jerk = MachineLimits::jerk_max(&*settings, 0) * PER_SECOND_CUBED;
        let accel = mean_accel(
            MachineLimits::accel_max(&*settings, 0) * PER_SECOND_SQUARED,
            jerk,
            velocity,
        );
        retract.accel = Short::new(accel * per_mm);
        retract.velocity = Short::new(velocity * per_mm);
        retract
    }

    /// Waits until the encoder gives the time of a turn, in counts. Returns `None` if the queue is to be dropped, and
    /// an error if the spindle gives no pulses that fit for too long, or more of them than there is time for.
    async fn spindle_turns(&self) -> Result<Option<u32>, Status> {
        let (mut since, mut most) = (millis(), 0);
        // The power task reads the encoder, and then raises this event.
        wait(self.links.thread, Event::BlockDone, || {
            if self.is_flushed() {
                return Some(Ok(None));
            }
            let (seen, synced, is_sure, turn, least) = common::with(self.links.thread, |common| {
                let encoder = &common.encoder;
                let (seen, synced) = encoder.seen();
                let least = u32::from(encoder.per_turn()) * PULSE_LEAST;
                (seen, synced, encoder.is_sure(), encoder.turn(), least)
            });
            if is_sure && synced && turn != 0 {
                let is_fast = turn < least;
                return Some(if is_fast { Err(Status::VelocityExceeded) } else { Ok(Some(turn)) });
            }
            // A spindle that is slower than the encoder can measure never gets beyond a pulse or two. In a hold the spindle
            // may stand still.
            if seen > most || machine::is_held() {
                most = seen;
                if !is_sure {
                    since = millis();
                }
            }
            let late = millis().wrapping_sub(since) > PATIENCE_MS;
            late.then_some(Err(if synced || turn == 0 { Status::NoIndex } else { Status::NoSync }))
        })
        .await
    }

    /// Checks whether the passes of G76 can be made, with `turn` counts a turn, before X goes to the first one. The
    /// speed of X in a taper is checked when its pass begins.
    #[inline(never)]
    #[small]
    fn check_cycle(&self, turn: u32) -> Result<(), Status> {
        let commands = self.links.command_receiver().commands();
        let Motion::ThreadCycle(cycle) = &commands.motion else { return Ok(()) };
        if !self.turns_as_told() {
            return Err(Status::WrongWay);
        }
        let [_, _, z, ..] = &self.dynamics.axes;
        let turns_per_s = COUNTS_PER_S as f32 / turn as f32;
        let is_fast = cycle.lead.0 as f32 * 1e-4 * turns_per_s > z.feed;
        if is_fast { Err(Status::VelocityExceeded) } else { Ok(()) }
    }

    /// Tells exec of the pass, with `turn` counts a turn, and puts the limits of the pass into force. Returns false if
    /// the pass goes nowhere.
    #[inline(never)]
    #[small]
    fn begin_pass(&mut self, turn: u32) -> Result<bool, Status> {
        let links = self.links;
        let turns_per_s = COUNTS_PER_S as f32 / turn as f32;
        let mut speeds = [0.0f32; FIRST_ROTARY];
        let (mut place, mut line) = (self.position, 0);
        while let Some(piece) = self.piece(line, &place) {
            for (most, way) in speeds.iter_mut().zip(piece.ways) {
                *most = greater(*most, piece.lead * turns_per_s * way / piece.length);
            }
            (place, line) = (piece.target, line + 1);
        }
        if speeds.iter().all(|speed| !some(*speed)) {
            return Ok(false);
        }
        if !self.turns_as_told() {
            return Err(Status::WrongWay);
        }
        let settings = links.settings.borrow();
        for (axis, speed) in self.dynamics.axes.iter().zip(speeds) {
            if speed > axis.feed {
                return Err(Status::VelocityExceeded);
            }
        }
        for (n, (axis, speed)) in self.dynamics.axes.iter_mut().zip(speeds).enumerate() {
            let jerk = MachineLimits::jerk_max(&*settings, n) * PER_SECOND_CUBED;
            let accel = MachineLimits::accel_max(&*settings, n) * PER_SECOND_SQUARED;
            let accel = mean_accel(accel, jerk, speed);
            axis.limit_change(accel, 0.0);
        }
        // The corner at a taper must not slow the path down: an axis that gets slower would not be in step.
        self.dynamics.junction = ANY_CORNER;
        self.dynamics.rounds = false;
        // The limits of the settings are in force again for the next line.
        links.changes.note(Changes::SETTINGS);
        self.set_pass(Status::Ok);
        let [x, y, z, ..] = self.position;
        self.walk = Ongoing::Pass([x, y, z]);
        if let Some(piece) = self.piece(0, &self.position) {
            let turn_at = if self.returns() { Self::overrun(turn, piece.lead) } else { 0.0 };
            let (limit, retract) = (self.error_limit(), self.retract());
            let pass = Pass { lead: piece.lead, limit, retract, turn_at };
            self.push(Block::action(QueuedAction::Thread(pass), self.line));
        }
        Ok(true)
    }

    /// Whether the spindle turns in the direction of M3 or M4, as far as the encoder detects it.
    #[inline(never)]
    #[small]
    fn turns_as_told(&self) -> bool {
        common::with(self.links.thread, |common| {
            let outputs = common.motion.outputs;
            let is_on = outputs & outputs::SPINDLE != 0;
            common.encoder.begin(is_on.then_some(outputs & outputs::COUNTERCLOCKWISE != 0))
        })
    }

    /// Returns how far the axes may be off, mm.
    #[small]
    fn error_limit(&self) -> Short {
        Short::new(self.spindle_setting(spindle::L) as f32 * 1e-3)
    }

    #[inline(never)]
    #[small]
    fn spindle_setting(&self, row: u8) -> i32 {
        Setting::of(Owner::Spindle, row).map_or(0, |row| self.links.storage.cold(row))
    }

    /// Returns a line of the pass, counted from 0, that begins at `from`. `None` if there is no such line or it goes
    /// nowhere.
    #[inline(never)]
    #[small]
    pub(super) fn piece(&self, line: u8, from: &PerAxis<Length>) -> Option<Piece> {
        let commands = self.links.command_receiver().commands();
        let (target, lead) = self.steps.pass(&commands.motion, from, line)?;
        let mut ways = [0.0; FIRST_ROTARY];
        let (mut most, mut square) = (0.0f32, 0.0);
        for ((way, to), from) in ways.iter_mut().zip(&target).zip(from) {
            *way = to.0.abs_diff(from.0) as f32 * 1e-4;
            square += *way * *way;
            most = greater(most, *way);
        }
        let length = sqrt(square);
        some(most).then(|| Piece {
            target,
            ways,
            length,
            lead: lead.0 as f32 * 1e-4 * length / most,
        })
    }

    /// Queues a line of the pass, or begins with its parts. Returns false if there is no such line.
    #[inline(never)]
    #[small]
    fn queue_line(&mut self, line: u8, turn: u32, back: bool) -> bool {
        if self.is_cut_short() {
            return false;
        }
        if self.returns() {
            return line == 0 && self.queue_leg(turn, back);
        }
        let Some(Piece { target, .. }) = self.piece(line, &self.position) else { return false };
        self.straight(&target, Some(Feed::PerMinute(ANY_FEED)));
        true
    }

    /// Tells exec the lead of a further line of the pass. Returns whether there is such a line.
    #[inline(never)]
    #[small]
    fn queue_lead(&mut self, line: u8) -> bool {
        if self.is_cut_short() {
            return false;
        }
        let Some(Piece { lead, .. }) = self.piece(line, &self.position) else { return false };
        let _ = self.queue.push_aside(Block::action(QueuedAction::Lead(lead), self.line));
        self.announce();
        true
    }

    /// Sets the status of the pass.
    #[small]
    pub(super) fn set_pass(&self, status: Status) {
        common::with(self.links.thread, |common| common.encoder.pass = status);
    }

    /// Begins an alarm with `status`. Nothing has moved, and nothing will.
    #[inline(never)]
    #[small]
    fn refuse(&mut self, status: Status) {
        // The model is at the end of the line, but the machine is not.
        self.links.set_position(&self.position);
        self.set_pass(status);
        alarm::raise_for(self.links, Alarm::Alarm, status);
    }
}
