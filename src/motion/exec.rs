//! Exec: runs blocks, a few milliseconds at a time.
//!
//! Owned by the exec task (level 2), which asks [`Exec::step`] for a segment whenever the segment ring has room for
//! one. The [`Governor`] decides how far the next stretch goes and how long it takes. Times are seconds, distances mm.
//!
//! With [means](super::smooth), which machines with jerk limits have, stretches fill samples of equal length
//! ([`Sampler`]). The distances of each sample go through the means ([`Smooth`]), and [`Prep::slice`] turns them into a
//! segment (`sampled`). So the motors are later than the path by the means, and a line ends, a spindle starts and a hold
//! holds only when the means are empty.
//!
//! Without means, and in a pass in step with the spindle, [`Prep`] turns each stretch into a segment. A stretch then
//! ends where its block ends: a block that takes less than [`SEGMENT_S`] is one segment.
//!
//! No velocity profile is planned ahead. Each stretch follows from the present velocity and from the velocity that is
//! allowed at the end of the block, which the [speed constraints](super::speed_constraints) give. Blocks that are added
//! to the queue take effect at the next stretch.
//!
//! A move without steps (shorter than a step, or of axes without motors) takes its time too. So many of them in a row
//! are no faster than one long move.
//!
//! In a feedhold the governor decelerates to a standstill ([`Governor::halt`]), over any number of lines, and then no
//! line, dwell, output or stop begins. When the hold ends, the line goes on from where it is, and a dwell takes the
//! remainder of its time. Alternatively [`Exec::drop_all`] drops everything that is queued, and the position is that of
//! the last steps made.
//!
//! Cost on AVR: 6,300 cycles for a short block without means, including [`Prep`], the task and its interrupt. A third
//! of them are the governor's floats.

mod sampled;
mod spindle;

use super::backlash::Backlash;
use super::block::{Block, Body, Line, QueuedAction};
use super::float::{below, greater, lesser, scaled, some, whole};
use super::governor::{Governor, Stretch, same};
use super::prep::{CYCLES_MAX, FINE_LOG2, Prep};
use super::queue::BlockSource;
use super::sampler::Sampler;
use super::smooth::{Smooth, Spans};
use super::snapshot::{Program, Snapshot};
use super::thread::Thread;
use crate::capability::Capability;
use crate::dda::Segment;
use crate::gcode::heating::Heat;
use crate::gcode::overrides::Change;
pub use crate::hal::BLOCK_S_MIN;
use crate::hal::TIMER_HZ;
use spindle::Follows;

/// Half CPU cycles in a second.
const HALVES_PER_S: f32 = 2.0 * TIMER_HZ as f32;

/// A pause of 1 ms: the number of its ticks, as few as periods allow, and their period.
const PAUSE: (u16, u16) = pause(TIMER_HZ);

/// Nominal time of a segment: the shortest that leaves two thirds of the CPU to others.
pub const SEGMENT_S: f32 = 0.002;

/// Blocks that take less than 1/32 s are short. This is the exponent of that time, as a power of two.
const SHORT_LOG2: i8 = -5;

/// CPU cycles in [`SEGMENT_S`].
const SEGMENT_CYCLES: u32 = (TIMER_HZ as f32 * SEGMENT_S) as u32;

/// At or above this velocity, mm/s, a line is always followed by another line.
const SLOW: f32 = 5.0;

/// Duration of a pause, s.
const PAUSE_S: f32 = 0.001;

/// Length of the segments of a dwell, ms.
const DWELL_MS: u16 = 2;

/// Returns the number of ticks and their period for [`PAUSE`].
const fn pause(timer_hz: u32) -> (u16, u16) {
    let counts = timer_hz / 1_000;
    let ticks = counts.div_ceil(u16::MAX as u32);
    assert!(
        counts / ticks * ticks * 1_000 == timer_hz,
        "a millisecond is no whole number of such ticks"
    );
    (ticks as u16, (counts / ticks) as u16)
}

/// The result of [`Exec::step`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A segment to queue.
    Segment,
    /// Something was done that needs no segment: call again.
    Again,
    /// The outputs or the speed of the spindle have changed, at a standstill: call again.
    Switched,
    /// X is to leave the cut, also in segments that are already queued ([`Exec::lead`]): call again.
    Leaves,
    /// An override is to change; [`take_override`] returns the change. No segment is to be queued: call again
    /// afterwards.
    Override,
    /// Heaters and the fan are to change; [`take_heat`] returns the change. No segment is to be queued: call again
    /// afterwards.
    Heat,
    /// A program stop, end or change of outputs is due: call again when the steppers stand still.
    Standstill,
    /// The block queue is empty.
    Idle,
    /// A feedhold is on, and the steppers stand still.
    Held,
}

/// Releases the oldest block, for which [`Step::Override`] was returned, and returns its change.
#[inline(never)]
#[small]
pub fn take_override(blocks: &mut BlockSource) -> Change {
    match take_action(blocks) {
        Some(QueuedAction::Override(change)) => change,
        // The end of a program switches all overrides on again.
        _ => Change::ALL_ON,
    }
}

/// Releases the oldest block, for which [`Step::Heat`] was returned, and returns its change.
#[inline(never)]
#[small]
pub fn take_heat(blocks: &mut BlockSource) -> Option<Heat> {
    match take_action(blocks) {
        Some(QueuedAction::Heat(heat)) => Some(heat),
        _ => None,
    }
}

#[inline(always)]
fn take_action(blocks: &mut BlockSource) -> Option<QueuedAction> {
    let block = blocks.oldest();
    blocks.release();
    match block?.body {
        Body::QueuedAction(action) => Some(action),
        Body::Line(_) => None,
    }
}

/// The line that exec is running.
#[derive(Clone, Copy, Debug, Default)]
struct Running {
    /// Whether a line is running.
    active: bool,
    /// Whether the line takes long enough for fine ticks.
    long: bool,
    /// Whether the line is short, so that another one follows soon.
    short: bool,
    /// Distance to go, mm.
    left: f32,
    /// Where distances are sampled: what rounding has not taken from `left` yet, mm.
    owed: f32,
    /// Velocity limit, mm/s.
    cruise: f32,
    /// Phase units of the dominant motor in a mm. Not valid while `fresh`.
    scale: f32,
    /// The square of the velocity that is allowed at the end of the line.
    headroom: f32,
    /// The version of the queue that `headroom` belongs to.
    version: u8,
    /// Whether no stretch of the line has been prepared yet.
    fresh: bool,
    /// Whether the governor has handed out the whole line; `Prep` still holds a part of it.
    done: bool,
}

impl Running {
    /// Updates the feed and the headroom, if they have changed.
    #[inline(always)]
    fn look_ahead(&mut self, blocks: &mut BlockSource, governor: &mut Governor) {
        let version = blocks.version();
        if version != self.version {
            self.version = version;
            self.cruise = blocks.cruise();
            if blocks.take_changed() {
                governor.change_feed();
            }
            self.headroom = blocks.headroom();
        }
    }
}

/// The state of exec.
#[derive(Debug, Default)]
#[repr(C)]
pub struct Exec {
    // The largest fields are last: the CPU reaches 64 bytes from a pointer.
    running: Running,
    /// Whether a feedhold is on.
    hold: bool,
    /// Whether stretches of short lines are to be twice as long.
    coarse: bool,
    /// Whether all stretches are to be twice as long.
    hurry: bool,
    /// Whether the segment ring has room for longer stretches.
    long: bool,
    /// Whether a pass in step with the spindle is to end at once.
    breaks_off: bool,
    dwell_ms: u32,
    governor: Governor,
    prep: Prep,
    sampler: Sampler,
    smooth: Smooth,
    backlash: Backlash,
    /// A line waits for the take-up at a standstill. These are its means, in whose place others are meanwhile.
    lent: Option<Spans>,
    // Last of all, because few lines need it.
    follows: Follows,
}

impl Exec {
    /// Exec at a standstill, without a line.
    pub const fn new() -> Self {
        let running = Running {
            active: false,
            long: false,
            short: false,
            left: 0.0,
            owed: 0.0,
            cruise: 0.0,
            scale: 0.0,
            headroom: 0.0,
            version: 0,
            fresh: false,
            done: false,
        };
        Self {
            prep: Prep::new(),
            governor: Governor::new(),
            sampler: Sampler::new(),
            smooth: Smooth::new(),
            backlash: Backlash::new(),
            lent: None,
            running,
            hold: false,
            coarse: false,
            hurry: false,
            long: true,
            breaks_off: false,
            dwell_ms: 0,
            follows: Follows::Nothing,
        }
    }

    /// Does the next piece of work, and returns what it was. Writes `segment` if that is [`Step::Segment`].
    /// `standstill`: the steppers have stopped.
    pub fn step(
        &mut self,
        blocks: &mut BlockSource,
        standstill: bool,
        out: &mut Snapshot,
        segment: &mut Segment,
    ) -> Step {
        if self.prep.held(segment) {
            return Step::Segment;
        }
        if self.hold && self.rests(blocks) {
            if self.empties(out, segment) {
                return Step::Segment;
            }
            if standstill && self.ends_pass(blocks) {
                return Step::Again;
            }
            out.held = standstill;
            return if standstill { Step::Held } else { Step::Standstill };
        }
        if self.dwell_ms > 0 {
            if !self.empties(out, segment) {
                self.dwell(segment);
            }
            return Step::Segment;
        }
        if Capability::Lathe.is_built_in() && matches!(self.follows, Follows::Retreats(_)) {
            return self.retreat(blocks, out, segment);
        }
        if !self.running.active {
            if blocks.is_empty() {
                if self.empties(out, segment) {
                    return Step::Segment;
                }
                return self.idle(standstill, out);
            }
            if Capability::Backlash.is_built_in() && self.takes_up(blocks, out, segment) {
                return Step::Segment;
            }
            if !self.begin(blocks, out)
                && let Some(block) = blocks.oldest()
                && let Body::QueuedAction(action) = block.body
            {
                if !block.is_aside() && self.empties(out, segment) {
                    return Step::Segment;
                }
                return self.take_up(&action, blocks, standstill, out);
            }
        }
        if self.is_sampled() {
            self.run_sampled(blocks, out, segment)
        } else {
            self.run(blocks, out, segment)
        }
    }

    /// Sets whether stretches of short lines are twice as long without means, which halves the CPU time of their
    /// mathematics, and, in a `hurry`, those of all lines.
    #[inline(always)]
    pub fn set_coarse(&mut self, coarse: bool, hurry: bool) {
        (self.coarse, self.hurry) = (coarse || hurry, hurry);
    }

    /// Sets whether the segment ring has room for stretches that are twice as long.
    #[inline(always)]
    pub fn set_long(&mut self, long: bool) {
        self.long = long;
    }

    /// Begins a feedhold, or ends one. Cost: 15 if nothing changes.
    #[inline(always)]
    pub fn set_hold(&mut self, hold: bool, out: &mut Snapshot) {
        if hold != self.hold {
            self.hold = hold;
            out.held = false;
        }
    }

    /// Inserts a pause of `ms` milliseconds before anything else. The machine is at a standstill, perhaps within a
    /// line.
    pub fn wait(&mut self, ms: u16, out: &mut Snapshot) {
        if ms > 0 {
            self.dwell_ms += u32::from(ms);
            out.running = true;
        }
    }

    /// In a hold: whether everything up to the standstill has been prepared.
    #[inline(never)]
    fn rests(&mut self, blocks: &BlockSource) -> bool {
        let running = &self.running;
        let is_line = |block: &Block| matches!(block.body, Body::Line(_)) || block.is_aside();
        let must_go_on = match &self.follows {
            _ if !Capability::Lathe.is_built_in() => false,
            Follows::Retreats(retreat) => !retreat.is_done(),
            // A tapping pass must follow the spindle, which cannot be held.
            Follows::Angle(thread) => {
                let ends = self.breaks_off || thread.fault().is_some() || thread.has_turned();
                thread.is_tapping() && !ends
            }
            _ => false,
        };
        let goes_on = if must_go_on {
            true
        } else if running.active {
            // Once the end of a line has been computed, all of that line is handed out.
            running.done || !self.governor.is_at_rest()
        } else {
            !self.governor.is_at_rest() && blocks.look(is_line) == Some(true)
        };
        !goes_on
    }

    /// At a standstill of the path: makes the next segment in which motors still move, because the means are not empty or
    /// the extruder has a lead to take back. Returns false, and no segment, if the motors stand still, too.
    #[inline(never)]
    fn empties(&mut self, out: &mut Snapshot, segment: &mut Segment) -> bool {
        self.governor.stop();
        if self.smooth.spans().is_some() && self.drains(out, segment) {
            return true;
        }
        out.velocity = 0.0;
        if self.prep.relax(segment) {
            return true;
        }
        self.prep.rest();
        false
    }

    /// Drops everything that is queued. The steppers stand still: held, or stopped within a segment. Returns the
    /// segment that [`Prep`] held back, which has not been queued. `out.target` is then where the queued segments and
    /// the returned one end; [`Dda::settle`](crate::dda::Dda::settle) makes the last steps made the position.
    ///
    /// Blocks that set drivers, means, backlash, pressure advance, G95 or the origin still take effect, as do those that set the position before the
    /// first dropped line, dwell, output or stop.
    ///
    /// Cost: 600 a block.
    #[inline(never)]
    pub fn drop_all(&mut self, blocks: &mut BlockSource, out: &mut Snapshot) -> Option<Segment> {
        self.halt(out);
        let mut moved = self.running.active || self.dwell_ms > 0;
        let held = self.prep.cut(&mut out.target);
        self.sampler.clear();
        self.smooth.clear();
        if Capability::Backlash.is_built_in() {
            self.backlash.stop();
            self.give_back();
        }
        self.running.active = false;
        self.dwell_ms = 0;
        let keeps = match &mut self.follows {
            _ if !Capability::Lathe.is_built_in() => true,
            Follows::Angle(thread) => thread.drop_rest(),
            Follows::Speed(share) => {
                *share = greater(*share, 0.0);
                true
            }
            _ => false,
        };
        if !keeps {
            self.follows = Follows::Nothing;
        }
        out.left = 0.0;
        out.running = false;
        out.program = Program::Stopped;
        while let Some(block) = blocks.oldest() {
            match &block.body {
                Body::QueuedAction(QueuedAction::Drivers(drivers)) => {
                    self.prep.set_drivers(*drivers)
                }
                Body::QueuedAction(QueuedAction::Advance(lead))
                    if Capability::Printer.is_built_in() =>
                {
                    self.prep.set_lead(lead);
                }
                Body::QueuedAction(QueuedAction::PerTurn(on))
                    if Capability::Lathe.is_built_in() =>
                {
                    self.go_by_speed(*on)
                }
                Body::QueuedAction(QueuedAction::SetPosition(steps)) if !moved => {
                    out.target = *steps
                }
                Body::QueuedAction(QueuedAction::Origin(origin)) => out.origin = *origin,
                Body::QueuedAction(QueuedAction::Smooth(spans)) => self.smooth.set(*spans),
                Body::QueuedAction(QueuedAction::Backlash(slacks)) => self.backlash.set(slacks),
                Body::QueuedAction(
                    QueuedAction::SetPosition(_)
                    | QueuedAction::Override(_)
                    | QueuedAction::Lead(_)
                    | QueuedAction::Advance(_)
                    | QueuedAction::Heat(_),
                ) => {}
                _ => moved = true,
            }
            blocks.enter();
            blocks.release();
        }
        held
    }

    /// Carries out the oldest block, which is an action.
    #[inline(never)]
    fn take_up(
        &mut self,
        action: &QueuedAction,
        blocks: &mut BlockSource,
        standstill: bool,
        out: &mut Snapshot,
    ) -> Step {
        match action {
            QueuedAction::Dwell(ms) => {
                self.dwell_ms = *ms;
                self.halt(out);
                out.running = true;
                out.length = 0.0;
            }
            QueuedAction::SetPosition(steps) => {
                out.target = *steps;
                out.left = 0.0;
            }
            QueuedAction::Outputs(outputs) | QueuedAction::Surface(outputs, _) => {
                self.halt(out);
                if !standstill {
                    return Step::Standstill;
                }
                out.switch(outputs, action);
                blocks.release();
                return Step::Switched;
            }
            QueuedAction::ProgramStop | QueuedAction::ProgramEnd => {
                self.halt(out);
                if !standstill {
                    return Step::Standstill;
                }
                out.running = false;
                out.program = match action {
                    QueuedAction::ProgramEnd => Program::Ended,
                    _ => Program::Stopped,
                };
                if matches!(action, QueuedAction::ProgramEnd) {
                    return Step::Override;
                }
            }
            QueuedAction::Override(_) => return Step::Override,
            QueuedAction::Heat(_) if Capability::Printer.is_built_in() => return Step::Heat,
            QueuedAction::Origin(origin) => out.origin = *origin,
            QueuedAction::Drivers(drivers) => self.prep.set_drivers(*drivers),
            QueuedAction::Smooth(spans) => self.smooth.set(*spans),
            QueuedAction::Backlash(slacks) => self.backlash.set(slacks),
            QueuedAction::Advance(lead) if Capability::Printer.is_built_in() => {
                self.prep.set_lead(lead)
            }
            QueuedAction::Thread(_) | QueuedAction::EndThread | QueuedAction::Return
                if Capability::Lathe.is_built_in() =>
            {
                self.halt(out);
                if !standstill {
                    return Step::Standstill;
                }
                self.prep.rest();
                match (action, &mut self.follows) {
                    (QueuedAction::Thread(pass), _) => {
                        self.follows = Follows::Angle(Thread::begin(pass))
                    }
                    (QueuedAction::Return, Follows::Angle(thread)) => thread.turn_back(),
                    _ => self.follows = Follows::Nothing,
                }
            }
            QueuedAction::PerTurn(on) if Capability::Lathe.is_built_in() => self.go_by_speed(*on),
            QueuedAction::Lead(lead) if Capability::Lathe.is_built_in() => {
                if let Follows::Angle(thread) = &mut self.follows {
                    self.governor.rescale(thread.set_lead(*lead));
                }
            }
            // Actions that need nothing more, and those that are never queued because the image lacks their
            // capability.
            _ => {}
        }
        blocks.release();
        Step::Again
    }

    fn halt(&mut self, out: &mut Snapshot) {
        self.governor.stop();
        out.velocity = 0.0;
    }

    #[inline(never)]
    fn idle(&mut self, standstill: bool, out: &mut Snapshot) -> Step {
        self.halt(out);
        self.prep.rest();
        if standstill && out.running {
            out.running = false;
            out.program = Program::Stopped;
        }
        Step::Idle
    }

    #[inline(never)]
    fn dwell(&mut self, segment: &mut Segment) {
        let ms = if self.dwell_ms < u32::from(DWELL_MS) { 1 } else { DWELL_MS };
        self.dwell_ms -= u32::from(ms);
        let (ticks, period) = PAUSE;
        self.prep.pause(ms * ticks, period, segment);
    }

    /// Begins the oldest block if it is a line, and returns whether it is. The line stays in the ring until its last
    /// segment, so that the planner counts it as pending work.
    #[inline(never)]
    fn begin(&mut self, blocks: &mut BlockSource, out: &mut Snapshot) -> bool {
        blocks.enter();
        let version = blocks.version().wrapping_sub(1);
        let lined = blocks.look(|block| {
            out.line = block.line();
            let Body::Line(line) = &block.body else { return false };
            self.begin_line(line, version, out);
            true
        });
        lined == Some(true)
    }

    #[inline(always)]
    fn begin_line(&mut self, line: &Line, version: u8, out: &mut Snapshot) {
        let length = line.extent.length();
        let long = below(scaled(line.cruise, FINE_LOG2), length);
        let short = below(length, scaled(line.cruise, SHORT_LOG2));
        out.length = length;
        out.running = true;
        // Field by field, to write in place. The remaining fields are set before they are read.
        let running = &mut self.running;
        running.active = true;
        (running.long, running.short) = (long, short);
        running.left = length;
        running.owed = 0.0;
        running.version = version;
        running.fresh = true;
        running.done = false;
        self.governor.begin(line.accel.get());
        if Capability::Backlash.is_built_in() {
            self.backlash.turn(&line.way);
        }
        if self.is_sampled() {
            self.begin_sampled(line, out);
        } else {
            self.prep.begin(line, &mut out.steps, &mut out.target);
        }
    }

    /// Prepares the next stretch of the running line. Works in place: copying the line's state would cost as much as
    /// the mathematics.
    #[inline(never)]
    fn run(&mut self, blocks: &mut BlockSource, out: &mut Snapshot, segment: &mut Segment) -> Step {
        let running = &mut self.running;
        if running.done {
            return self.end(0, false, blocks, segment);
        }
        if Capability::Lathe.is_built_in() && matches!(self.follows, Follows::Angle(_)) {
            return self.follow(blocks, out, segment);
        }
        let (cruise, holds) = match self.limit(blocks) {
            Ok(limit) => limit,
            Err(share) => return self.await_speed(share, out, segment),
        };
        let running = &self.running;
        let (left, headroom) = (running.left, running.headroom);
        let stretch = if holds {
            self.governor.take(SEGMENT_S);
            self.governor.halt(left, headroom)
        } else {
            if (self.coarse && running.short || self.hurry) && self.long {
                self.governor.take_long(2.0 * SEGMENT_S);
            } else {
                self.governor.take(SEGMENT_S);
            }
            self.governor.stretch(left, cruise, headroom)
        };
        self.hand_out(&stretch, blocks, out, segment, |exec| {
            (exec.running.long, exec.running.short && exec.coarse)
        })
    }

    /// Turns a stretch of the running line into a segment. `ticks` returns whether the segment may have fine ticks,
    /// and whether coarse ones ([`Prep::refine`]).
    #[inline(always)]
    fn hand_out(
        &mut self,
        stretch: &Stretch,
        blocks: &mut BlockSource,
        out: &mut Snapshot,
        segment: &mut Segment,
        ticks: impl FnOnce(&Self) -> (bool, bool),
    ) -> Step {
        let running = &mut self.running;
        out.velocity = self.governor.velocity();
        let cycles = cycles_of(stretch.seconds);
        if self.prep.leads() {
            self.prep.aim(out.velocity, stretch.seconds);
        }
        if stretch.ends {
            out.left = 0.0;
            running.done = true;
            let whole = running.fresh;
            return self.end(cycles, whole, blocks, segment);
        }
        if running.fresh {
            running.fresh = false;
            running.scale = self.prep.own() as f32 / running.left;
        }
        let before = running.left;
        running.left -= stretch.distance;
        let cycles = match is_rounded(before, stretch.distance) {
            true => rounded(before, &mut running.left, stretch),
            false => cycles,
        };
        out.left = running.left;
        let left = whole(running.left * running.scale);
        let (fine, coarse) = ticks(self);
        self.prep.refine(fine, coarse);
        step(self.prep.segment(left, cycles, segment))
    }

    /// Turns a stretch of a pass into a segment. Its ticks are coarse, to leave CPU time to exec, which reads the
    /// spindle for each stretch.
    #[inline(never)]
    #[small]
    fn hand_out_coarsely(
        &mut self,
        stretch: &Stretch,
        blocks: &mut BlockSource,
        out: &mut Snapshot,
        segment: &mut Segment,
    ) -> Step {
        self.hand_out(stretch, blocks, out, segment, |_| (false, true))
    }

    /// For how many more segments the end of a line that has been prepared goes on.
    #[inline(always)]
    pub fn lag(&self) -> u8 {
        if self.is_sampled() { self.smooth.lag() } else { 0 }
    }

    /// The velocity along the path at the end of the queued segments, mm/s.
    pub fn velocity(&self) -> f32 {
        self.governor.velocity()
    }

    /// Hands out the remainder of the running line.
    fn end(
        &mut self,
        cycles: u32,
        whole: bool,
        blocks: &mut BlockSource,
        segment: &mut Segment,
    ) -> Step {
        // The end is exact where motion ends: the governor is at a standstill, or is slow in a line that no other line
        // follows.
        let exact = below(self.governor.velocity(), SLOW)
            && (self.governor.is_at_rest() || !blocks.goes_on());
        let some = if whole {
            self.prep.whole(cycles, exact, segment)
        } else {
            self.prep.last(cycles, exact, segment)
        };
        if self.prep.left() == 0 {
            self.running.active = false;
            blocks.release();
        }
        step(some)
    }
}

fn step(segment: bool) -> Step {
    if segment { Step::Segment } else { Step::Again }
}

/// Whether a stretch is so short against what is left of its line that the difference of the two, which has 24 bits,
/// lacks more than 0.1 % of the stretch.
#[inline(always)]
fn is_rounded(left: f32, distance: f32) -> bool {
    const BITS: u32 = 14;
    left.to_bits() > distance.to_bits() + (BITS << 23)
}

/// Takes at least one bit from what is left of a line, which was `before`, for a stretch. Returns how long the distance
/// takes that is taken, CPU cycles. A stretch that goes nowhere takes its own time.
#[cold]
#[inline(never)]
#[small]
fn rounded(before: f32, left: &mut f32, stretch: &Stretch) -> u32 {
    if !some(stretch.distance) {
        return cycles_of(stretch.seconds);
    }
    *left = lesser(*left, f32::from_bits(before.to_bits() - 1));
    cycles_of(stretch.seconds * ((before - *left) / stretch.distance))
}

/// Returns the CPU cycles in `seconds`: at least 1, at most [`CYCLES_MAX`]. Cost: 250, 25 for a usual stretch.
#[inline(never)]
fn cycles_of(seconds: f32) -> u32 {
    if same(seconds, SEGMENT_S) {
        return SEGMENT_CYCLES;
    }
    let cycles = (whole(seconds * HALVES_PER_S) + 1) >> 1;
    if cycles > CYCLES_MAX {
        return CYCLES_MAX;
    }
    cycles | u32::from(cycles == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pause_is_exact_on_a_fast_chip() {
        assert_eq!(pause(16_000_000), (1, 16_000));
        assert_eq!(pause(20_000_000), (1, 20_000));
        assert_eq!(pause(125_000_000), (2, 62_500));
        assert_eq!(pause(168_000_000), (3, 56_000));
    }
}
