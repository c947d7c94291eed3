//! Actions that begin without a line of G-code: a built-in job, homing, check mode, a jog.

use kerf_macros::small;

use super::{View, values};
use crate::capability::Capability;
use crate::gcode::command::Motion;
use crate::gcode::limits::is_near;
use crate::gcode::printing::EXTRUDER;
use crate::gcode::setup::{AxisMode, Setup};
use crate::hal::eeprom::Eeprom;
use crate::jobs::{Job, STORED};
use crate::machine::jog::Bar;
use crate::machine::{self, Alarm};
use crate::protocol::{Machine, Value};
use crate::status::Status;
use crate::store::program;
use crate::tasks::homing;
use crate::units::Length;

/// Begins a built-in or stored job.
#[small]
#[inline(always)]
pub(super) fn start_job(view: &mut View<'_>, number: u8) -> Status {
    let Some(job) = Job::new(number) else {
        return Capability::Jobs.check().err().unwrap_or(Status::Error);
    };
    if !job.is_none() && view.is_busy() {
        return Status::NotAccepted;
    }
    if number == STORED && !program::is_whole(&Eeprom::of(view.links.thread)) {
        return Status::Error;
    }
    view.links.job.set(job);
    view.links.parser_wake.signal();
    Status::Ok
}

/// Begins homing these axes, as bits. `ends_alarm`: an alarm that is on ends if the homing begins, and only then.
#[small]
#[inline(always)]
pub(super) fn home(view: &mut View<'_>, axes: u8, ends_alarm: bool) -> Status {
    let axes = homing::axes(&view.settings) & axes;
    if axes == 0 {
        return Status::HomingSwitches;
    }
    if ends_alarm && machine::is_alarmed() && machine::is_flushing() {
        // Not yet: the machine may still slow down.
        return view.clear();
    }
    if let Err(status) = view.may_begin(ends_alarm) {
        return status;
    }
    for axis in (0..homing::AXES).filter(|axis| axes & 1 << axis != 0) {
        if let Err(status) = homing::of(&view.settings, axis) {
            view.links.model.borrow_mut().blame(axis);
            view.links.except(status);
            return status;
        }
    }
    // Last, because a request that is refused ends no alarm.
    if ends_alarm && machine::is_alarmed() {
        let status = view.clear();
        if status != Status::Ok {
            return status;
        }
    }
    // What ends an alarm is grbl's `$H`, which changes no mode: an axis word behind it needs no G0.
    view.links.model.borrow_mut().cancel_motion(ends_alarm);
    view.begin(Motion::Home { axes, set: true }, machine::Event::Homing)
}

/// Switches check mode.
#[small]
#[inline(always)]
pub(super) fn check(view: &mut View<'_>, on: bool) -> Status {
    if on == machine::is_checking() {
        return Status::Ok;
    }
    let alarm = machine::alarm();
    if alarm != Alarm::None {
        return alarm.status();
    }
    // Check mode itself is no work, but a hold in check mode is.
    let works = machine::is_held() || view.has_work() || view.has_others();
    // What an alarm or a `^d` switches off would be off in check mode, too: it must be off before.
    let runs = values::modal(view, Value::SpindleOn)
        + values::modal(view, Value::Mist)
        + values::modal(view, Value::Flood);
    if works || (on && runs != 0) {
        return Status::NotAccepted;
    }
    view.begin(Motion::Check, if on { machine::Event::Check } else { machine::Event::Done })
}

/// Begins a jog of one axis to a place.
#[small]
#[inline(always)]
pub(super) fn jog(view: &mut View<'_>, axis: u8, place: Length) -> Status {
    if Setup::mode(&*view.settings, axis) == AxisMode::Disabled {
        return Status::AxisDisabled;
    }
    if view.links.signs.jogs.get() != Bar::Open {
        return Status::Terminated;
    }
    if usize::from(axis) == EXTRUDER
        && let Err(status) = Setup::extrudes(&*view.settings)
    {
        return status;
    }
    if let Err(status) = view.may_begin(false) {
        return status;
    }
    let model = view.links.model.borrow();
    let mut target = *model.position();
    let travel = view.settings.travel(axis).filter(|_| model.is_homed(axis));
    drop(model);
    let near = is_near(&target, &*view.settings);
    if let Some(at) = target.get_mut(usize::from(axis)) {
        *at = travel.map_or(place, |(low, high)| place.max(low).min(high));
    }
    if !near || !is_near(&target, &*view.settings) {
        return Status::OutOfRange;
    }
    view.begin(Motion::Jog { target }, machine::Event::Jog)
}
