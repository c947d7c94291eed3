//! The power task: gives motors power, and takes it from them when they have been idle.
//!
//! Reads the settings, the milliseconds and exec's snapshot; writes the drivers' enables. Waits for
//! [`LOOK_MS`] between looks, and sees to the [health](super::health) of all besides. Exec calls [`segment`] before it queues one, so that a driver is on before
//! its step; that costs 40 cycles a segment. Everyone else changes the state under the ceiling.

use core::cell::UnsafeCell;

use embassy_time::Timer;

use super::health;
use super::links::{Links, snapshot};
use crate::config::Settings;
use crate::hal::Thread;
use crate::hal::imp::time::millis;
use crate::hal::imp::{exec, gpio};
use crate::machine;
use crate::motors::{Modes, Motors};

/// How often idle motors are looked for, ms.
const LOOK_MS: u64 = 20;

/// The state: exec's, and thread mode's while exec is locked out.
struct Shared(UnsafeCell<Motors>);

// SAFETY: exec changes it, and thread mode does while exec cannot run.
unsafe impl Sync for Shared {}

machine_static! {
    fn shared() -> Shared = Shared(UnsafeCell::new(Motors::new()));
}

/// The task.
pub async fn run(links: &'static Links) -> ! {
    loop {
        health::look();
        links.signs.age(millis());
        look(links);
        Timer::after_ticks(LOOK_MS).await;
    }
}

/// Takes power from the motors that have been idle long enough.
#[inline(never)]
#[small]
fn look(links: &Links) {
    let timeout = links.settings.borrow().motor_timeout_centis().saturating_mul(10);
    let (now, running) = (millis(), snapshot(links.thread).running);
    let holds = machine::is_held();
    let pass = |motors: &mut Motors| {
        if holds {
            motors.stand_still(LOOK_MS as u32);
        }
        motors.pass(now, running, timeout)
    };
    if change(links.thread, pass) {
        links.reporter_wake.signal();
    }
}

/// Before a segment of a block that moves the motors `moving` (bits) is queued: they get power. Its
/// increments would not tell: a motor may have a rest of the block before. Exec only.
#[small]
pub fn segment(moving: u8) {
    carry_out(|motors| motors.segment(moving));
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
fn change<R>(thread: Thread, what: impl FnOnce(&mut Motors) -> R) -> R {
    exec::lock(thread, |_| carry_out(what))
}

#[small]
fn carry_out<R>(what: impl FnOnce(&mut Motors) -> R) -> R {
    // SAFETY: exec runs, or cannot; and `what` calls nothing of this module.
    let motors = unsafe { &mut *shared().0.get() };
    let before = motors.on();
    let result = what(motors);
    if motors.on() != before {
        gpio::power(motors.on());
    }
    result
}
