//! Homing, G28.2 and G28.4, and `{home:1}`: each axis looks for its switch, in the order Z X Y A.
//!
//! | stage | move | ends |
//! |---|---|---|
//! | `Clear` | only if the switch is closed: `lb` away | at its end |
//! | `Search` | towards the switch, the travel and `lb` at most | where it closes |
//! | `Latch` | slowly to `lb` off where it closed | where it opens |
//! | `Zero` | to `zb` off where it opened | at its end: this is the place ([`homing`]) |
//!
//! Between two stages everything stands still for [`SETTLE_MS`]: a switch that was just believed is not asked again for
//! a while. Contacts are exact to the step ([`seek`](super::seek)), and so is the place, however fast the
//! axis passed the switch. Without `lb` the place is counted from where the switch closed.
//!
//! The limits of the axis are none meanwhile; those of others are. All settings are looked at before anything moves.
//! What fails ends the cycle: exception with the axis and the reason, the axis not homed, the position where
//! it is. A feedhold holds; a flush ends it as a failure. What waits behind the line is carried out after it.
//!
//! Several motors of an axis move together: they have one switch, and do not square it.

use kerf_macros::small;

use super::Planner;
use super::seek::{Sought, drop_blocks};
use crate::gcode::command::{Feed, Motion};
use crate::hal::imp::inputs;
use crate::motion::block::Action;
use crate::status::Status;
use crate::tasks::alarm;
use crate::tasks::homing::{self, Homing};
use crate::tasks::links::Cycle;
use crate::units::Length;

/// Longer than a switch is not asked again ([`LOCK_MS`](crate::switches::LOCK_MS)).
const SETTLE_MS: u32 = 20;

/// The axes in their order, four bits each, the first one lowest.
const ORDER: u16 = 0x3102;

/// What comes next.
#[derive(Clone, Copy, PartialEq)]
enum Stage {
    /// Also: with the next axis.
    Clear,
    Search,
    Latch,
    Zero,
    /// The axis is there.
    Place,
}

/// How far homing has come.
struct Progress {
    /// The place in the order of the axis after this one.
    next: u8,
    axis: u8,
    stage: Stage,
    /// Where the switch was.
    contact: Length,
}

impl Planner {
    /// Carries out the line's homing.
    pub(super) async fn home(&mut self) {
        self.enter(Cycle::Homing);
        let mut at = Progress { next: 0, axis: 0, stage: Stage::Clear, contact: Length::ZERO };
        let mut done = self.check_homing(&mut at);
        while done.is_ok() {
            self.room().await;
            self.pause(Action::Dwell(SETTLE_MS));
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
            // It may still move towards the switch.
            drop_blocks().await;
        }
        self.end_homing(&at, done.err());
    }

    /// What the line asks for: the axes, and whether their positions are set.
    fn homed_by_line(&self) -> (u8, bool) {
        match self.links.commands.borrow().motion {
            Motion::Home { axes, set } => (axes, set),
            _ => (0, false),
        }
    }

    /// Looks at the settings of all axes, which may have changed since the line was taken.
    #[inline(never)]
    #[small]
    fn check_homing(&mut self, at: &mut Progress) -> Result<bool, Status> {
        let (axes, _) = self.homed_by_line();
        for axis in (0..homing::AXES).filter(|axis| axes & 1 << axis != 0) {
            at.axis = axis;
            homing::of(&self.links.settings.borrow(), axis)?;
        }
        Ok(true)
    }

    /// Begins the next move. False if there is none: all axes are homed.
    #[inline(never)]
    #[small]
    fn begin_stage(&mut self, at: &mut Progress) -> Result<bool, Status> {
        loop {
            if at.stage == Stage::Clear && !self.next_axis(at) {
                return Ok(false);
            }
            let homing = homing::of(&self.links.settings.borrow(), at.axis)?;
            let closed = inputs::worked() & homing.switch() != 0;
            match at.stage {
                Stage::Clear => {
                    self.begin_axis(at.axis, &homing);
                    if closed && homing.shared {
                        // Nobody knows which of the two it is.
                        return Err(Status::HomingClosed);
                    }
                    if closed {
                        self.go(at.axis, homing.away(self.at(at.axis), homing.backoff), &homing);
                        return Ok(true);
                    }
                    at.stage = Stage::Search;
                }
                Stage::Search if closed => return Err(Status::HomingClosed),
                Stage::Search => {
                    let end = homing.towards(self.at(at.axis), homing.way);
                    self.look(at.axis, end, homing.search, &homing, homing.switch());
                    return Ok(true);
                }
                Stage::Latch if !closed => return Err(Status::HomingFailed),
                Stage::Latch if homing.backoff == Length::ZERO => at.stage = Stage::Zero,
                Stage::Latch => {
                    let end = homing.away(at.contact, homing.backoff);
                    self.look(at.axis, end, homing.latch, &homing, 0);
                    return Ok(true);
                }
                Stage::Zero => {
                    self.go(at.axis, homing.away(at.contact, homing.zero), &homing);
                    return Ok(true);
                }
                Stage::Place => {
                    self.place_axis(at.axis, homing.place);
                    at.stage = Stage::Clear;
                }
            }
        }
    }

    /// What has come of the move, and what comes next.
    #[inline(never)]
    #[small]
    fn end_stage(&mut self, at: &mut Progress, sought: &Sought) -> Result<bool, Status> {
        if let Sought::Contact(steps) = sought {
            let contact = self.located(steps);
            at.contact = contact.get(usize::from(at.axis)).copied().unwrap_or_default();
        }
        at.stage = match (at.stage, sought) {
            (_, Sought::Flushed) => return Err(Status::HomingFailed),
            (Stage::Clear, _) => Stage::Search,
            (Stage::Search, Sought::Contact(_)) => Stage::Latch,
            (Stage::Search, _) => return Err(Status::HomingFailed),
            (Stage::Latch, Sought::Contact(_)) => Stage::Zero,
            (Stage::Latch, _) => return Err(Status::HomingClosed),
            (Stage::Zero | Stage::Place, _) => Stage::Place,
        };
        Ok(true)
    }

    /// Takes the next axis of the line. False if there is none.
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

    /// Begins with an axis: it is not homed any more, unless its position is to stay.
    fn begin_axis(&mut self, axis: u8, homing: &Homing) {
        inputs::spare(homing.ends());
        if self.homed_by_line().1 {
            self.links.model.borrow_mut().set_homed(axis, false);
        }
        self.brake_hard();
    }

    /// Where an axis is.
    fn at(&self, axis: u8) -> Length {
        self.position.get(usize::from(axis)).copied().unwrap_or_default()
    }

    /// Moves an axis.
    fn go(&mut self, axis: u8, to: Length, homing: &Homing) {
        self.send(axis, to, homing.search, 0, 0);
    }

    /// Moves an axis until its switch is as in `awaited`.
    fn look(&mut self, axis: u8, to: Length, speed: f32, homing: &Homing, awaited: u16) {
        self.send(axis, to, speed, homing.switch(), awaited);
    }

    #[inline(never)]
    #[small]
    fn send(&mut self, axis: u8, to: Length, speed: f32, armed: u16, awaited: u16) {
        let mut target = self.position;
        if let Some(place) = target.get_mut(usize::from(axis)) {
            *place = to;
        }
        self.seek(&target, Feed::PerMinute(speed), armed, awaited);
    }

    /// The axis is at its place.
    #[inline(never)]
    #[small]
    fn place_axis(&mut self, axis: u8, place: Length) {
        if self.homed_by_line().1 {
            let mut position = self.position;
            if let Some(at) = position.get_mut(usize::from(axis)) {
                *at = place;
            }
            self.set_position(&position);
            self.links.model.borrow_mut().set_homed(axis, true);
        }
    }

    /// Everything is again as it was before.
    #[inline(never)]
    #[small]
    fn end_homing(&mut self, at: &Progress, failure: Option<Status>) {
        let links = self.links;
        inputs::spare(0);
        let mut model = links.model.borrow_mut();
        // In a flush it is not here yet.
        if !self.is_flushed() {
            model.set_position(&self.position);
        }
        if let Some(status) = failure {
            model.blame(at.axis);
            // An alarm has said already what ended it.
            if !alarm::is_on() {
                links.except(status);
            }
        }
        drop(model);
        self.enter(Cycle::Off);
    }
}
