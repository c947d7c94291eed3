//! The plane of the bed: moves that probe it, and whether moves follow it.

use kerf_macros::small;

use super::View;
use crate::gcode::command::{Feed, Motion};
use crate::gcode::limits::is_near;
use crate::gcode::modal::MotionMode;
use crate::machine::{self, Alarm};
use crate::protocol::Level;
use crate::status::Status;
use crate::tasks::setup::counted;
use crate::units::Length;

/// The axis that follows the bed.
const Z: usize = 2;

/// Returns where an axis is in machine coordinates, from the place of its motor: Z may follow the bed.
#[small]
#[inline(never)]
pub(super) fn lowered(view: &View<'_>, axis: usize, at: Length) -> Length {
    let Some(bed) = view.settings.followed_bed().filter(|_| axis == Z) else { return at };
    let place = |axis| counted(&view.settings, &view.motion().position, axis, None);
    let [x, y] = [0, 1].map(|axis| place(axis).unwrap_or(Length::ZERO));
    bed.lowered_z(x, y, at)
}

/// Begins a step of probing the bed, or switches the plane on or off.
#[small]
#[inline(always)]
pub(super) fn level(view: &mut View<'_>, what: Level) -> Status {
    let (links, alarm) = (view.links, machine::alarm());
    if alarm != Alarm::None {
        return alarm.status();
    }
    if !view.may_feed() {
        return Status::Muted;
    }
    if machine::is_checking() {
        return Status::NotAccepted;
    }
    if !links.command_sender().is_free() || machine::is_flushing() {
        return Status::Again;
    }
    let mut model = links.model.borrow_mut();
    let mut target = *model.position();
    if let Level::Go(to) | Level::Probe(to) = what {
        target.iter_mut().zip(to).for_each(|(place, to)| *place = to);
        if !is_near(&target, &*view.settings) {
            return Status::OutOfRange;
        }
    }
    let mut commands = links.command_sender().slot();
    commands.clear();
    commands.motion = match what {
        Level::Follow(follows) => Motion::FollowBed(follows),
        Level::Go(_) => Motion::Traverse { target },
        Level::Probe(_) => {
            let feed = Feed::PerMinute(view.settings.latch_velocity(Z));
            Motion::Probe { target, feed, mode: MotionMode::ProbeTowards }
        }
    };
    model.set_position(&target);
    links.command_sender().send();
    Status::Ok
}
