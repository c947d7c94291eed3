//! Switches: their settings, and the actions of limits, door and emergency stop.
//!
//! When a limit or the emergency stop is hit, the interrupt that finds it has stopped the steps already
//! (`hal::inputs`). The control task calls this module, which raises the [`alarm`]. Nothing here waits, and nothing
//! can be full.
//!
//! A limit is a switch whose `sn` or `sx` says so. By default none does, so that a machine without switches runs. A
//! limit acts when it closes (with `st` 1: opens), not while it is closed: a machine can start on its limit and move
//! off it. While an axis is being homed, its ends are no limits (`spare`).
//!
//! The pins of an axis that homes by a stall ([`homing`](super::homing)) are wired to DIAG of its driver, which is
//! high when the motor is held up, whatever `st` says.
//!
//! The door and the emergency stop act by their level, if `saf` and `est` say that they exist. An open door is a hold
//! that no tilde ends before the door is shut. If the door is open while nothing runs, no motion can begin.

use kerf_macros::small;

use super::homing::AXES;
use super::links::Links;
use super::{alarm, hold};
use crate::boards::{ACTIVE, inputs};
use crate::config::Settings;
use crate::gcode::setup::{AxisMode, Setup};
use crate::hal::event::Event;
use crate::hal::{Thread, flags, inputs as pins};
use crate::machine::{self, Alarm};

/// A bit of the settings `sn` and `sx`: the switch is a limit.
const LIMIT: u8 = 2;
/// The value of the settings `saf` and `est` for a normally closed switch.
const OPENS: u8 = 2;

/// The inputs that the board has.
pub const WIRED: u16 = {
    let (mut bits, mut i) = (0, 0);
    while i < inputs::COUNT {
        if ACTIVE.inputs[i].is_some() {
            bits |= 1 << i;
        }
        i += 1;
    }
    bits
};

/// The inputs that are ends of axes.
const ENDS: u16 = (1 << inputs::ENDS) - 1;

/// Returns what `sn` or `sx` says of the switch at an end: 0 off, 1 homing, 2 limit, 3 both. A switch whose pin is
/// used by an encoder is off.
pub fn mode(settings: &Settings, end: u8) -> u8 {
    let axis = end / 2;
    match end % 2 {
        _ if Setup::mode(settings, axis) == AxisMode::Disabled => 0,
        _ if pins::left_out() >> end & 1 != 0 => 0,
        0 => settings.switch_min(axis.into()),
        _ => settings.switch_max(axis.into()),
    }
}

/// Applies the settings of all switches. Door and emergency stop are normally open, unless a setting says otherwise.
#[inline(never)]
#[small]
pub fn set_up(thread: Thread, settings: &Settings) {
    let mut closing = if settings.switches_normally_closed() { !ENDS } else { u16::MAX };
    if settings.door_switch() == OPENS {
        closing &= !(1 << inputs::DOOR);
    }
    if settings.stop_switch() == OPENS {
        closing &= !(1 << inputs::STOP);
    }
    for axis in (0..AXES).filter(|axis| settings.homes_by_stall(*axis)) {
        closing &= !(3 << (2 * axis));
    }
    let is_limit = |end: &u8| mode(settings, *end) & LIMIT != 0;
    let mut stops = (0..inputs::ENDS as u8).filter(is_limit).fold(0, |bits, end| bits | 1 << end);
    if settings.stop_switch() != 0 {
        stops |= 1 << inputs::STOP;
    }
    pins::set_up(thread, closing & WIRED, stops & WIRED);
    // Switches may be active already.
    flags::set(Event::Realtime);
}

/// Whether the emergency stop is hit.
pub fn is_stopped(thread: Thread, settings: &Settings) -> bool {
    settings.stop_switch() != 0 && pins::worked(thread.level()) & 1 << inputs::STOP != 0
}

/// Acts on changes of switches.
pub fn serve(links: &Links) {
    let hits = pins::take_hits(links.thread);
    let settings = links.settings.borrow();
    let stops = hits & 1 << inputs::STOP != 0 || is_stopped(links.thread, &settings);
    let open =
        settings.door_switch() != 0 && pins::worked(links.thread.level()) & 1 << inputs::DOOR != 0;
    drop(settings);
    if stops {
        alarm::raise(links, Alarm::Shutdown);
    } else if hits as u8 != 0 && machine::alarm() < Alarm::Limit {
        links.notices.limits_hit.set(hits as u8);
        alarm::raise(links, Alarm::Limit);
    }
    if open != machine::has_open_door() {
        hold::door(links, open);
    }
    links.reporter_wake.signal();
}
