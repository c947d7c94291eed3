//! Switches: what their settings make of them, and what a limit that is hit leads to.
//!
//! The interrupt that finds a limit hit has stopped the steps already (`hal::imp::inputs`). This, called by the
//! control task, switches spindle and coolant off and has the reporter tell; from then on lines of G-code are
//! refused, and the motors stand wherever they were in the middle of their steps until a reset (`^x`): position
//! is lost. Settings and reports go on. Nothing here waits, and nothing can be full.
//!
//! A limit is a switch whose `sn` or `sx` says so; by default none does, so that a machine without switches runs.
//! It counts when it closes (with `st` 1, opens), not if it stands so: a machine can start on its limit and move
//! off it. Homing will take its axis out of `limits` for as long as it goes; a probe will be latched where limits
//! stop the steps.

use super::links::Links;
use super::spindle;
use crate::boards::{ACTIVE, inputs};
use crate::config::Settings;
use crate::gcode::setup::{AxisMode, Setup};
use crate::hal::imp::inputs as pins;
use crate::status::Status;

/// Of `sn` and `sx`: a limit.
const LIMIT: u8 = 2;

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

/// The ends of axes, of the inputs.
const ENDS: u16 = (1 << inputs::ENDS) - 1;

/// What `sn` or `sx` says of the switch at an end: 0 off, 1 homing, 2 limit, 3 both.
pub fn mode(settings: &Settings, end: u8) -> u8 {
    let axis = end / 2;
    match end % 2 {
        _ if Setup::mode(settings, axis) == AxisMode::Disabled => 0,
        0 => settings.switch_min(axis.into()),
        _ => settings.switch_max(axis.into()),
    }
}

/// Takes over what the settings say. Those that are no ends close when they are worked, whatever `st` says.
#[inline(never)]
pub fn set_up(settings: &Settings) {
    let closing = if settings.switches_normally_closed() { !ENDS } else { u16::MAX };
    let is_limit = |end: &u8| mode(settings, *end) & LIMIT != 0;
    let limits = (0..inputs::ENDS as u8).filter(is_limit).fold(0, |bits, end| bits | 1 << end);
    pins::set_up(closing & WIRED, limits & WIRED as u8);
}

/// Looks for what has happened.
pub fn serve(links: &Links) {
    let hits = pins::take_hits();
    if hits != 0 && links.limits_hit.get() == 0 {
        links.limits_hit.set(hits);
        spindle::stop();
        links.except(Status::LimitHit);
        links.parser_wake.signal();
    }
    links.reporter_wake.signal();
}
