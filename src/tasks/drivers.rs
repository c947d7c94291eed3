//! Drivers that are set up by UART: their settings, and what they report. Empty in an image without such drivers.
//!
//! The power task [looks](look) at them every 20 ms. While a driver of an axis in use has not taken its settings, or
//! has switched its motor off, lines that move are refused; if that begins in motion it is an alarm, and so is a reset
//! of a driver in motion. In the first half second after the start such lines wait. A driver that fails or resets has
//! the homes forgotten, at rest, too. A reset at rest is told, and so are warnings: one of them each turn. Thread mode.
//! Cost: 600 cycles a turn.

use super::links::Links;
use super::storage::Storage;
use crate::config::{Setting, Settings};
use crate::hal::Thread;
#[cfg(feature = "drivers")]
use crate::{
    boards::ACTIVE,
    config::Owner,
    config::drive::DRIVERS,
    drivers::registers,
    drivers::watch::{State, news},
    gcode::setup::{AxisMode, Setup},
    hal::drivers,
    hal::time::millis,
    kinematics::NOTHING,
    machine::{self, Alarm},
    status::Status,
    tasks::{alarm, common, setup::moved_by},
};

/// Time after the start for which moves wait for drivers that have not taken their settings yet.
#[cfg(feature = "drivers")]
const START_MS: u32 = 500;

/// Why moves are refused because of the driver of a motor; `Ok` if they are not.
#[cfg(feature = "drivers")]
fn refusal(thread: Thread, motor: usize, settings: &Settings) -> Status {
    let state = drivers::watch(thread, motor as u8).state();
    let axis = moved_by(settings, motor);
    let is_in_use = axis != NOTHING && settings.mode(axis) != AxisMode::Disabled;
    match state {
        _ if !is_in_use || !state.refuses() => Status::Ok,
        State::Silent => Status::DriverSilent,
        State::Unset if millis() < START_MS => Status::Again,
        State::Unset => Status::DriverUnset,
        _ => Status::DriverOff,
    }
}

/// Returns what a driver's news are told as.
#[cfg(feature = "drivers")]
fn told(news: u8) -> Option<Status> {
    match news {
        0 => None,
        news::RESET => Some(Status::DriverReset),
        news::OFF => Some(Status::DriverOff),
        news::WARM => Some(Status::DriverHot),
        _ => Some(Status::DriverOpen),
    }
}

/// Takes a turn: see the module's text.
#[cfg(feature = "drivers")]
#[inline(never)]
pub fn look(links: &Links) {
    if ACTIVE.drivers.is_none() {
        return;
    }
    let runs = common::snapshot(links.thread).running;
    let refused = take_refusal(links);
    let news = (0..DRIVERS).find_map(|motor| told(drivers::take_news(links.thread, motor as u8)));
    match (news, refused) {
        (Some(fault @ (Status::DriverReset | Status::DriverOff)), _) | (_, Some(fault)) => {
            links.model.borrow_mut().forget_homes();
            tell_fault(links, runs, fault);
        }
        (Some(warning), None) => links.except(warning),
        (None, None) => {}
    }
}

/// Updates why moves are refused, `Again` if they wait. Returns the reason if they were not refused before.
#[cfg(feature = "drivers")]
#[inline(never)]
fn take_refusal(links: &Links) -> Option<Status> {
    let mut settings = links.settings.borrow_mut();
    let reasons = (0..DRIVERS).map(|motor| refusal(links.thread, motor, &settings));
    let now = reasons.max_by_key(|status| *status as u8).filter(|status| *status != Status::Ok);
    let now = now.unwrap_or(Status::Ok);
    let before = settings.undriven.first_mut()?;
    let before = core::mem::replace(before, now);
    if before != now {
        // A line may wait for it.
        links.parser_wake.signal();
    }
    // While moves were refused, none has been queued.
    Some(now).filter(|now| before == Status::Ok && !matches!(now, Status::Ok | Status::Again))
}

/// Raises an alarm if motors move. Else a reset is told, and refusals are told by the lines that are refused.
#[cfg(feature = "drivers")]
#[inline(never)]
fn tell_fault(links: &Links, runs: bool, fault: Status) {
    if runs && !machine::is_alarmed() {
        alarm::raise_for(links, Alarm::Alarm, fault);
    } else if fault == Status::DriverReset {
        links.except(fault);
    }
}

/// Takes over a setting, if it belongs to a driver. Returns whether it does.
#[cfg(feature = "drivers")]
pub fn set(settings: &mut Settings, setting: Setting, value: i32) -> bool {
    settings.set_drive(setting, value)
}

/// Takes over all settings of drivers, as they have been saved.
#[cfg(feature = "drivers")]
pub fn recall(settings: &mut Settings, storage: &Storage) {
    for setting in Owner::Drivers.settings() {
        settings.set_drive(setting, storage.cold(setting));
    }
}

/// Sends all settings to the drivers. Cost: eight divisions of floats.
#[cfg(feature = "drivers")]
pub fn tell(thread: Thread, settings: &Settings) {
    for motor in 0..DRIVERS {
        drivers::tell(thread, motor as u8, &registers(settings, motor));
    }
}

/// Without drivers, no setting belongs to one.
#[cfg(not(feature = "drivers"))]
#[inline(always)]
pub fn set(_settings: &mut Settings, _setting: Setting, _value: i32) -> bool {
    false
}

/// Without drivers, there is nothing to take over.
#[cfg(not(feature = "drivers"))]
#[inline(always)]
pub fn recall(_settings: &mut Settings, _storage: &Storage) {}

/// Without drivers, does nothing.
#[cfg(not(feature = "drivers"))]
#[inline(always)]
pub fn tell(_thread: Thread, _settings: &Settings) {}

/// Without drivers, does nothing.
#[cfg(not(feature = "drivers"))]
#[inline(always)]
pub fn look(_links: &Links) {}
