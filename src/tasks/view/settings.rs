//! Changes of settings: who has to be told of them; and the defaults.

use kerf_macros::small;

use super::{View, set_hardware};
use crate::baud;
use crate::capability::Capability;
use crate::config::Setting;
use crate::protocol::{Remembers, Warning};
use crate::status::Status;
use crate::tasks::drivers;
use crate::tasks::heat;
use crate::tasks::links::Changes;
use crate::tasks::setup::limit_velocity;
use crate::tasks::shaper;
use crate::tasks::spindle;
use crate::tasks::storage::{TO_ALL, TO_MACHINE, TO_OFFSETS};
use crate::tasks::switches;
use crate::tasks::turning;

/// Changes a setting, and tells all parts that go by it. Returns a warning if the change has side effects.
#[small]
#[inline(always)]
pub(super) fn set(view: &mut View<'_>, setting: Setting, value: i32) -> Result<Warning, Status> {
    view.may_set()?;
    if setting.is_cold() {
        let is_encoder = turning::is_own(setting);
        if is_encoder {
            Capability::Lathe.check()?;
        }
        if setting.needs_rest() && view.is_busy() {
            return Err(Status::NotAccepted);
        }
        view.links.storage.set_cold(setting, value)?;
        if view.settings.set_resonance(setting, value) {
            view.links.changes.note(Changes::SETTINGS);
            return Ok(Warning::None);
        }
        if drivers::set(&mut view.settings, setting, value) {
            set_hardware(view.links.thread, &view.settings);
            return Ok(Warning::None);
        }
        if Capability::Printer.is_built_in() {
            heat::set(&view.links.heat, &mut view.settings, setting, value);
            // The planner finds out then whether the extruder's lead has changed.
            view.links.changes.note(Changes::SETTINGS);
        }
        if is_encoder {
            turning::set_up(view.links.thread, view.links.storage);
            return Ok(Warning::None);
        }
        spindle::set(view.links.thread, setting, value);
        return Ok(Warning::None);
    }
    let is_machine = setting.is_machine();
    if is_machine {
        may_replace(view)?;
    }
    if setting.needs_rest() {
        if view.is_busy() {
            return Err(Status::NotAccepted);
        }
        view.links.changes.note(Changes::STEPS);
    }
    // Text mode.
    if setting.is_start_mode() && value == 0 {
        Capability::Text.check()?;
    }
    if setting.is_baud() {
        view.links.rate.set(baud::rate(value));
    }
    view.settings.store(setting, value);
    if is_machine {
        view.settings.take_over(value as u8);
    }
    let lowered = limit_velocity(&mut view.settings, setting);
    view.links.changes.note(Changes::SETTINGS);
    match is_machine {
        true => {
            view.links.storage.own();
            view.links.storage.note_change(TO_MACHINE);
        }
        false => view.note(setting, lowered),
    }
    set_hardware(view.links.thread, &view.settings);
    view.links.set_flow(&view.settings);
    Ok(match lowered {
        true => Warning::Velocity,
        false if view.settings.has_idle_jerk(setting) => Warning::Jerk,
        false if view.settings.has_fast_search(setting) => Warning::Search,
        false => Warning::None,
    })
}

/// Whether many settings may change at once. They may not while the emergency stop is hit, because its input may be off
/// then.
fn may_replace(view: &View<'_>) -> Result<(), Status> {
    if switches::is_stopped(view.links.thread, &view.settings) {
        Err(Status::ShutDown)
    } else {
        Ok(())
    }
}

/// Sets all settings to their defaults. With `offsets`, the coordinate systems are stored as 0 with them.
#[small]
#[inline(always)]
pub(super) fn restore(view: &mut View<'_>, offsets: bool) -> Status {
    if view.is_busy() {
        return Status::NotAccepted;
    }
    if let Err(status) = may_replace(view) {
        return status;
    }
    let rate = view.settings.baud();
    view.settings.set_defaults();
    if view.settings.baud() != rate {
        view.links.rate.set(baud::rate(view.settings.baud()));
    }
    view.report.restore();
    view.links.changes.note(Changes::STEPS | Changes::SETTINGS);
    view.links.storage.forget(offsets);
    drivers::recall(&mut view.settings, view.links.storage);
    shaper::recall(&mut view.settings, view.links.storage);
    spindle::set_all(view.links.thread, view.links.storage);
    heat::set_all(&view.links.heat, &mut view.settings, view.links.storage);
    view.links.storage.own();
    view.links.storage.note_change(if offsets { TO_OFFSETS } else { TO_ALL });
    set_hardware(view.links.thread, &view.settings);
    view.links.set_flow(&view.settings);
    Status::Ok
}
