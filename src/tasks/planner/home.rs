//! Homing, G28.2 and G28.4, and `{home:1}`: each axis searches for its switch, in the order Z X Y A.
//!
//! | stage | move | ends |
//! |---|---|---|
//! | `Clear` | only if the switch is closed: `lb` away | at its end |
//! | `Search` | towards the switch, the travel and `lb` at most | where it closes |
//! | `Latch` | slowly to `lb` off where it closed | where it opens |
//! | `Zero` | to `zb` off where it opened | at its end, which is the axis's place ([`homing`]) |
//!
//! Between two stages everything stands still for [`SETTLE_MS`], because a switch that has just changed is not read
//! again for a while. Contacts are exact to the step ([`seek`](super::seek)), and so is the position, whatever the
//! speed at the switch. Without `lb`, the place is counted from where the switch closed.
//!
//! An axis that homes by a stall (`drs1`) has no switch. The driver of its motor raises DIAG while the motor is stalled
//! at about the speed of the search. Such an axis only searches, and its position is counted from where it has stopped.
//! Its motor may have slipped at the stop by whole electrical periods of four full steps, and stands two full steps
//! from the stop at most. If DIAG is high at standstill, the driver has a fault or a wire is off.
//!
//! While an axis is homed its own limit switches are ignored; those of other axes act. The settings of all axes are
//! checked before anything moves. A failure ends the cycle: an exception gives the axis and the reason, the axis is not
//! homed, and its position is where it has stopped. A feedhold holds the cycle; a flush ends it as a failure. Lines
//! after the homing line wait for its end.
//!
//! Several motors of an axis move together. A second motor that has a switch of its own squares the axis
//! ([`square`](super::square)).

use kerf_macros::small;

use super::Planner;
use super::seek::{Sought, drop_blocks};
use super::square::Second;
use crate::capability::Capability;
use crate::gcode::command::{Feed, Motion};
use crate::hal::inputs;
use crate::machine::{Alarm, Event};
use crate::motion::block::QueuedAction;
use crate::status::Status;
use crate::tasks::alarm;
use crate::tasks::homing::{self, Homing};
use crate::tasks::overrides;
use crate::units::Length;

/// How long the machine stands still between two stages: longer than a switch is not read again
/// ([`LOCK_MS`](crate::switches::LOCK_MS)).
const SETTLE_MS: u32 = 20;

/// The order of the axes: four bits each, the first axis lowest.
const ORDER: u16 = 0x3102;

/// The stage that comes next.
#[derive(Clone, Copy, Default, PartialEq)]
enum Stage {
    /// This is also where the next axis begins.
    #[default]
    Clear,
    Search,
    /// In this stage and the next three, some motors of a squared axis move alone.
    Square,
    Latch,
    LatchSecond,
    Level,
    Zero,
    /// The axis is at its place.
    Place,
}

/// How far homing has come.
#[derive(Default)]
struct Progress {
    /// The index, in the order, of the axis after this one.
    next: u8,
    axis: u8,
    stage: Stage,
    /// Where the switch was, by the position of the axis.
    contact: Length,
    /// The second motor, if the axis is squared.
    second: Option<Second>,
    /// How far the axis has gone beyond the contact.
    beyond: Length,
    /// How far the first motor is off its switch; then, how far the second motor has to go.
    off: Length,
}

impl Stage {
    /// Whether the stage is done at the speed of latching. If the axis is squared, some motors move alone then.
    fn is_slow(self) -> bool {
        matches!(self, Stage::Square | Stage::Latch | Stage::LatchSecond | Stage::Level)
    }
}

impl Progress {
    /// Skips stages that the state of the switches makes unnecessary. `closed` are the closed switches; `all`: all
    /// those of the axis are closed.
    fn pass(&mut self, homing: &Homing, closed: u16, all: bool) -> Result<(), Status> {
        if self.stage == Stage::Clear {
            // Which of two switches on one pin is closed cannot be known.
            let doubtful = closed & homing.switch() != 0 && homing.shared;
            return match closed {
                _ if doubtful => Err(Status::HomingClosed),
                0 => {
                    self.stage = Stage::Search;
                    Ok(())
                }
                _ => Ok(()),
            };
        }
        if self.stage == Stage::Square && all {
            self.stage = Stage::Latch;
        }
        match self.stage {
            Stage::Search if closed != 0 => Err(Status::HomingClosed),
            Stage::Square if closed == 0 => Err(Status::HomingFailed),
            Stage::Latch if !all => Err(Status::HomingFailed),
            Stage::Latch if homing.backoff == Length::ZERO => {
                self.stage = Stage::Zero;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Skips stages as `pass` does, for an axis that homes by a stall and has no switch.
    #[inline(always)]
    fn pass_stall(&mut self, closed: u16) -> Result<(), Status> {
        if self.stage == Stage::Clear {
            self.stage = Stage::Search;
        }
        let is_worked = self.stage == Stage::Search && closed != 0;
        if is_worked { Err(Status::HomingClosed) } else { Ok(()) }
    }
}

impl Planner {
    /// Carries out the homing of the line.
    pub(super) async fn home(&mut self) {
        self.enter(Event::Homing);
        let mut at = Progress::default();
        let mut done = self.check_homing(&mut at);
        while done.is_ok() {
            self.room().await;
            self.pause(QueuedAction::Dwell(SETTLE_MS));
            done = match self.standstill().await {
                true => self.begin_stage(&mut at),
                false => Err(Status::HomingFailed),
            };
            if done != Ok(true) {
                break;
            }
            let sought = self.sought().await;
            done = self.end_stage(&mut at, &sought);
        }
        if self.is_flushed() {
            // The axis may still move towards the switch.
            drop_blocks(self.links.thread).await;
        }
        self.end_homing(&at, done.err());
    }

    /// Whether an axis homes by the load of its motor, without a switch.
    #[inline(always)]
    pub(super) fn homes_by_stall(&self, axis: u8) -> bool {
        Capability::Drivers.is_built_in() && self.links.settings.borrow().homes_by_stall(axis)
    }

    /// Returns the parameters of the line: the axes as bits, and whether their positions are set.
    fn homed_by_line(&self) -> (u8, bool) {
        match self.links.command_receiver().commands().motion {
            Motion::Home { axes, set } => (axes, set),
            _ => (0, false),
        }
    }

    /// Checks the settings of all axes of the line, which may have changed since the line was taken.
    #[inline(never)]
    #[small]
    fn check_homing(&mut self, at: &mut Progress) -> Result<bool, Status> {
        let (axes, _) = self.homed_by_line();
        for axis in (0..homing::AXES).filter(|axis| axes & 1 << axis != 0) {
            at.axis = axis;
            let homing = homing::of(&self.links.settings.borrow(), axis)?;
            self.second(axis, &homing)?;
        }
        Ok(true)
    }

    /// Begins the next move. Returns false if there is none, because all axes are homed.
    #[inline(never)]
    #[small]
    fn begin_stage(&mut self, at: &mut Progress) -> Result<bool, Status> {
        if at.stage == Stage::Place {
            self.place_axis(at)?;
            at.stage = Stage::Clear;
        }
        if at.stage == Stage::Clear && !self.next_axis(at) {
            return Ok(false);
        }
        let homing = homing::of(&self.links.settings.borrow(), at.axis)?;
        if at.stage == Stage::Clear {
            at.second = self.second(at.axis, &homing)?;
            self.begin_axis(at, &homing);
        }
        let (own, second) = (homing.switch(), at.second.map_or(0, Second::switch));
        let closed = inputs::worked(self.links.thread.level()) & (own | second);
        self.fix_search(at.axis);
        if self.homes_by_stall(at.axis) {
            at.pass_stall(closed)?;
        } else {
            at.pass(&homing, closed, closed == own | second)?;
        }
        // The start of the move, its distance away from the switch, and the switches that end it.
        let here = self.at(at.axis);
        // A motor may have gone beyond its own switch as far as the axis has.
        let back = homing.backoff.saturating_add(at.beyond);
        let (from, way, armed) = match at.stage {
            Stage::Clear => (here, homing.backoff, 0),
            Stage::Search => (here, Length(-homing.way.0), own | second),
            Stage::Square => (here, Length(-homing.backoff.0), (own | second) & !closed),
            Stage::Latch => (here, back, own),
            Stage::LatchSecond => (here, back, second),
            Stage::Level => (here.saturating_add(at.off), self.squaring_offset(), 0),
            Stage::Zero | Stage::Place => (at.contact, homing.zero, 0),
        };
        if let Some(motor) = at.second.filter(|_| at.stage.is_slow()) {
            let first = at.stage == Stage::Latch || armed == own;
            self.alone(at.axis, motor, !first);
        }
        let speed = if at.stage.is_slow() { homing.latch } else { homing.search };
        let awaited = if way.0 < 0 { armed } else { 0 };
        self.look(at.axis, homing.away(from, way), speed, armed, awaited);
        Ok(true)
    }

    /// Takes the result of the move, and sets the stage that comes next.
    #[inline(never)]
    #[small]
    fn end_stage(&mut self, at: &mut Progress, sought: &Sought) -> Result<bool, Status> {
        if let Sought::Contact(steps) = sought
            && matches!(at.stage, Stage::Search | Stage::Latch)
        {
            let contact = self.located(steps);
            at.contact = contact.get(usize::from(at.axis)).copied().unwrap_or_default();
        }
        if self.homes_by_stall(at.axis) && at.stage == Stage::Search {
            return self.end_stall(at, sought);
        }
        if at.stage == Stage::Search {
            let beyond = self.at(at.axis).0.wrapping_sub(at.contact.0);
            at.beyond = Length(beyond.saturating_abs());
        }
        self.end_alone(at, sought);
        at.stage = match (at.stage, sought) {
            (_, Sought::Flushed) => return Err(Status::HomingFailed),
            (Stage::Clear, _) => Stage::Search,
            (Stage::Search, Sought::Contact(_)) => Stage::Square,
            (Stage::Square, Sought::Contact(_)) => Stage::Latch,
            (Stage::Search | Stage::Square, _) => return Err(Status::HomingFailed),
            (Stage::Latch, Sought::Contact(_)) if at.second.is_some() => Stage::LatchSecond,
            (Stage::Latch, Sought::Contact(_)) => Stage::Zero,
            (Stage::LatchSecond, Sought::Contact(_)) => Stage::Level,
            (Stage::Latch | Stage::LatchSecond, _) => return Err(Status::HomingClosed),
            (Stage::Level, _) => Stage::Zero,
            (Stage::Zero | Stage::Place, _) => Stage::Place,
        };
        Ok(true)
    }

    /// Fixes the speed of a search for a stall, whatever the feed override is, because the driver is set up for that
    /// speed.
    #[inline(always)]
    fn fix_search(&mut self, axis: u8) {
        if Capability::Drivers.is_built_in() {
            overrides::fix_feed(self.links.thread, self.homes_by_stall(axis));
            self.replan();
        }
    }

    /// Takes the result of a search that a stall is to end.
    #[inline(always)]
    fn end_stall(&self, at: &mut Progress, sought: &Sought) -> Result<bool, Status> {
        if !matches!(sought, Sought::Contact(_)) {
            return Err(Status::HomingFailed);
        }
        at.contact = self.at(at.axis);
        at.stage = Stage::Zero;
        Ok(true)
    }

    /// After a move of some motors alone, has the motors move together again, and notes how far each is off its
    /// switch.
    fn end_alone(&mut self, at: &mut Progress, sought: &Sought) {
        let Some(second) = at.second.filter(|_| at.stage.is_slow()) else { return };
        let contact = match sought {
            Sought::Flushed => return,
            Sought::Contact(steps) => second.of(steps),
            Sought::End => 0,
        };
        let off = self.level(second, contact);
        match at.stage {
            Stage::Latch => at.off = Length(self.at(at.axis).0.wrapping_sub(at.contact.0)),
            Stage::LatchSecond => at.off = Length(at.off.0.wrapping_sub(off.0)),
            _ => {}
        }
    }

    /// Takes the next axis of the line. Returns false if there is none.
    fn next_axis(&self, at: &mut Progress) -> bool {
        let (axes, _) = self.homed_by_line();
        while at.next < homing::AXES {
            at.axis = (ORDER >> (4 * at.next)) as u8 & 0xF;
            at.next += 1;
            if axes & 1 << at.axis != 0 {
                return true;
            }
        }
        false
    }

    /// Begins with an axis. The axis is not homed any more, unless its position is to stay.
    fn begin_axis(&mut self, at: &Progress, homing: &Homing) {
        inputs::spare(self.links.thread, homing.ends() | at.second.map_or(0, Second::ends));
        if self.homed_by_line().1 {
            #[cfg(feature = "bed-plane")]
            self.follow_bed(false);
            self.links.model.borrow_mut().set_homed(at.axis, false);
        }
        self.brake_hard();
        // A search is no feed: only the traverse velocity of the axis limits it.
        if let Some(axis) = self.dynamics.axes.get_mut(usize::from(at.axis)) {
            axis.feed = axis.velocity;
        }
    }

    /// Returns the position of an axis.
    fn at(&self, axis: u8) -> Length {
        self.position.get(usize::from(axis)).copied().unwrap_or_default()
    }

    /// Moves an axis until one of the switches `armed` becomes as in `awaited`.
    #[inline(never)]
    #[small]
    fn look(&mut self, axis: u8, to: Length, speed: f32, armed: u16, awaited: u16) {
        let mut target = self.position;
        if let Some(place) = target.get_mut(usize::from(axis)) {
            *place = to;
        }
        self.seek(&target, Feed::PerMinute(speed), armed, awaited);
    }

    /// Sets the position of the axis, where it stands now, unless its position is to stay.
    #[inline(never)]
    #[small]
    fn place_axis(&mut self, at: &Progress) -> Result<(), Status> {
        if self.homed_by_line().1 {
            let homing = homing::of(&self.links.settings.borrow(), at.axis)?;
            let mut position = self.position;
            if let Some(here) = position.get_mut(usize::from(at.axis)) {
                *here = homing.place;
            }
            self.set_position(&position);
            self.links.model.borrow_mut().set_homed(at.axis, true);
        }
        Ok(())
    }

    /// Ends the cycle, and reports why if it has failed.
    #[inline(never)]
    #[small]
    fn end_homing(&mut self, at: &Progress, failure: Option<Status>) {
        let links = self.links;
        overrides::fix_feed(links.thread, false);
        inputs::spare(self.links.thread, 0);
        let mut model = links.model.borrow_mut();
        // In a flush, the position is not known yet.
        if !self.is_flushed() {
            model.set_position(&self.position);
        }
        if failure.is_some() {
            model.blame(at.axis);
        }
        drop(model);
        // What ended the cycle in a flush is reported when the flush is over, and so is the end of the cycle: only then
        // is the position known.
        let told = failure.filter(|_| !self.is_flushed());
        self.enter(Event::Done);
        match told {
            // The answer to the line would begin this alarm, but a report may come first.
            Some(status) if links.feeder().is_eager() => {
                alarm::raise_for(links, Alarm::Alarm, status)
            }
            Some(status) => alarm::announce(links, status, alarm::NO_PORT),
            None => {}
        }
    }
}
