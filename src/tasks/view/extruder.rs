//! What printing hosts do beside G-code: the extruder's modes and moves, autotune of heaters, settings that are lent.

use kerf_macros::small;

use super::{View, set_hardware};
use crate::config::shape::Resonances;
use crate::gcode::command::Motion;
use crate::gcode::heating::{Heat, Part, Wait};
use crate::gcode::setup::Setup;
use crate::hal::eeprom::Eeprom;
use crate::machine::{self, Alarm};
use crate::protocol::Extruder;
use crate::status::Status;
use crate::store::kept;
use crate::tasks::heat;
use crate::tasks::lent::LENT;
use crate::tasks::links::{Changes, Links};

/// How much hotter than its target a heater may get in an autotune, eighths of a degree.
const OVERSHOOT: u16 = 80;

/// Changes a mode of the extruder, or moves it.
#[small]
#[inline(always)]
pub(super) fn extruder(view: &mut View<'_>, what: Extruder) -> Status {
    let links = view.links;
    if !view.may_feed() {
        return Status::Muted;
    }
    let mut model = links.model.borrow_mut();
    match (what, not_now(links)) {
        (Extruder::Relative(relative), _) => model.set_relative(relative),
        (Extruder::Flow(flow), _) => model.set_flow(flow),
        (Extruder::LeaveOut, _) => model.leave_out(true),
        (_, Some(status)) => return status,
        (Extruder::Advance(time), None) => {
            let Some(heating) = view.settings.heating.first_mut() else {
                return Status::NotBuiltIn;
            };
            heating.advance = time;
            // The planner tells exec before the next line.
            links.changes.note(Changes::SETTINGS);
        }
        (Extruder::Move { by, feed }, None) => {
            heat::has_extruder(&mut view.settings);
            if let Err(status) = Setup::extrudes(&*view.settings) {
                return status;
            }
            let done = model.extrude(by, feed as f32, &mut links.command_sender().slot());
            if let Err(status) = done {
                return status;
            }
            // The origin of its words moves along.
            links.changes.note(Changes::ORIGIN);
            links.command_sender().send();
        }
    }
    Status::Ok
}

/// Begins an autotune of a heater.
#[small]
#[inline(always)]
pub(super) fn tune(view: &mut View<'_>, heater: u8, to: u16, cycles: u8, uses: bool) -> Status {
    let (links, alarm) = (view.links, machine::alarm());
    let part = if heater == 0 { Part::HotEnd } else { Part::Bed };
    if alarm != Alarm::None {
        return alarm.status();
    }
    if !view.may_feed() {
        return Status::Muted;
    }
    if let Err(status) = Setup::heats(&*view.settings, part) {
        return status;
    }
    if to.saturating_add(OVERSHOOT) > Setup::hottest(&*view.settings, part) {
        return Status::AboveMaximum;
    }
    if machine::is_checking() {
        return Status::Ok;
    }
    if !links.command_sender().is_free() || machine::is_flushing() {
        return Status::Again;
    }
    heat::ask_tune(&links.heat, cycles, uses);
    let mut commands = links.command_sender().slot();
    commands.clear();
    commands.motion = Motion::Heat(Heat { part, to: Some(to), wait: Wait::Tuned });
    links.command_sender().send();
    Status::Ok
}

/// Gives back one setting that has been lent; when there is none left the row, and tells all parts.
#[small]
#[inline(always)]
pub(super) fn recall(view: &mut View<'_>) -> Status {
    if view.is_busy() {
        return Status::Again;
    }
    let storage = view.links.storage;
    view.links.changes.note(Changes::STEPS | Changes::SETTINGS);
    if let Some(setting) = storage.take_lent() {
        view.settings
            .store(setting, kept::value(&storage.log(), &Eeprom::of(view.links.thread), setting));
        return Status::Again;
    }
    set_hardware(view.links.thread, &view.settings);
    storage.drop_row();
    // The interpreter has the row's values, if they are those of the selected coordinate system.
    match view.links.model.borrow_mut().set(LENT, 0, storage.value(LENT, 0)) {
        Ok(()) => Status::Ok,
        Err(status) => status,
    }
}

/// M593: sets the resonances of the axes. The planner tells exec before the next line.
pub(super) fn shape(view: &mut View<'_>, to: Resonances) -> Status {
    if !view.may_feed() {
        return Status::Muted;
    }
    if let Some(status) = not_now(view.links) {
        return status;
    }
    let Some(resonances) = view.settings.resonances.first_mut() else {
        return Status::NotBuiltIn;
    };
    *resonances = to;
    view.links.changes.note(Changes::SETTINGS);
    Status::Ok
}

/// Returns the answer to what the planner is to carry out, if it cannot do so now: an alarm, a check of lines, or a line
/// before it that the planner has not taken.
fn not_now(links: &Links) -> Option<Status> {
    match machine::alarm() {
        Alarm::None if machine::is_checking() => Some(Status::Ok),
        Alarm::None if !links.command_sender().is_free() || machine::is_flushing() => {
            Some(Status::Again)
        }
        Alarm::None => None,
        alarm => Some(alarm.status()),
    }
}
