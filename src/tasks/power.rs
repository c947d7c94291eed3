//! The power task: gives motors power, and takes it from them when they have been idle.
//!
//! Reads the settings, the milliseconds and exec's snapshot; writes the drivers' enables. Runs every [`LOOK_MS`], and
//! also checks the [`health`] of the firmware, and tells a chip with USB whether the machine rests. Exec calls
//! [`segment`] before it queues a segment, so that a driver is on before its step; that costs 40 cycles a segment. All
//! others change the state under the ceiling.

use super::common;
use super::drivers;
use super::health;
use super::heat;
use super::links::Links;
use super::view::View;
use super::{spindle, surface, turning};
use crate::config::Settings;
use crate::hal::after_ms;
use crate::hal::time::millis;
use crate::hal::{Exclusive, Thread, gpio, system, uart};
use crate::machine;
use crate::motors::{Modes, Motors};

/// Period of the task, ms.
const LOOK_MS: u64 = 20;

/// The task.
pub async fn run(links: &'static Links) -> ! {
    loop {
        heat::look(links);
        health::look(links.thread);
        drivers::look(links);
        links.signs.age(millis());
        look(links);
        turning::look(links);
        surface::look(links);
        if uart::sees_opening() {
            system::set_rests(links.thread, rests(links));
        }
        if links.moves_wait.get() {
            // The lines may have waited long enough.
            links.wake_planner();
        }
        after_ms(LOOK_MS).await;
    }
}

/// Whether nothing moves or is queued, no heater and no spindle is on, and all settings are stored.
#[inline(never)]
#[small]
fn rests(links: &Links) -> bool {
    let is_cold =
        |heater| heat::standing(links, heater).is_none_or(|it| it.to == 0 && it.power == 0);
    let works = links.has_data() || View::of(links, links.feeder()).is_busy();
    !works && spindle::on() == 0 && is_cold(0) && is_cold(1) && links.storage.is_done()
}

/// Takes power from the motors that have been idle long enough.
#[inline(never)]
#[small]
fn look(links: &Links) {
    let timeout = links.settings.borrow().motor_timeout_centis().saturating_mul(10);
    let (now, holds) = (millis(), machine::is_held());
    let told = common::with_outputs(links.thread, |common, alone| {
        let running = common.motion.running;
        carry_out(alone, &mut common.motors, |motors| {
            if holds {
                motors.stand_still(LOOK_MS as u32);
            }
            motors.pass(now, running, timeout)
        })
    });
    if told {
        links.reporter_wake.signal();
    }
}

/// Gives power to the motors `moving` (bits), before a segment of a block that moves them is queued. The increments of
/// the segment would not be enough, because a motor may still have a remainder of the block before.
#[small]
pub fn segment(alone: Exclusive<'_>, motors: &mut Motors, moving: u8) {
    carry_out(alone, motors, |motors| motors.segment(moving));
}

/// Takes over the modes of the settings.
#[small]
pub fn set_modes(thread: Thread, settings: &Settings) {
    let modes = Modes::new(|m| settings.motor_power_mode(m));
    change(thread, |motors| motors.set_modes(modes));
}

/// Powers `motors` (bits).
#[small]
pub fn energize(thread: Thread, motors: u8) {
    change(thread, |all| all.energize(motors));
}

/// Takes power from `motors` (bits).
#[small]
pub fn release(thread: Thread, motors: u8) {
    change(thread, |all| all.release(motors));
}

#[small]
fn change<R>(thread: Thread, what: impl FnOnce(&mut Motors) -> R + Send) -> R {
    common::with_outputs(thread, |common, alone| carry_out(alone, &mut common.motors, what))
}

#[small]
fn carry_out<R>(
    alone: Exclusive<'_>,
    motors: &mut Motors,
    what: impl FnOnce(&mut Motors) -> R,
) -> R {
    let before = motors.on();
    let result = what(motors);
    if motors.on() != before {
        gpio::power(alone, motors.on());
    }
    result
}
