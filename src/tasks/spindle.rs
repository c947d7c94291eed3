//! The outputs of M3 to M9 and the spindle's speed, carried out in step with motion.
//!
//! Exec keeps the outputs and S of the program ([`Snapshot`]). This module converts them to levels and pulse widths
//! ([`Spindle`]). Exec calls [`switch`] at a standstill when something may have changed, and waits for the time that it
//! returns: a spindle needs time to start. In a feedhold the outputs that the settings select pause, and they are on
//! again before motion resumes.
//!
//! Thread mode applies changes of settings ([`set`]) and of the override ([`follow`]), which take effect at once. A
//! sender may [switch the coolant](flip), and [stop the spindle](pause) for the hold that is on. Cost of a change:
//! 4,000 cycles.

use super::common;
use super::links::Links;
use super::storage::Storage;
use super::turning;
use crate::boards::outputs;
use crate::config::Setting;
use crate::gcode::modal::Coolant;
use crate::hal::byte::SharedByte;
use crate::hal::{Exclusive, Thread, gpio, pwm, stepper};
use crate::machine;
use crate::motion::snapshot::Snapshot;
use crate::spindle::{Changed, Spindle};

machine_static! {
    // What is on. Exec writes it.
    fn now_on() -> SharedByte = SharedByte::new(0);
}

/// Returns the outputs that are on. In a feedhold these may be fewer than the program has switched on.
#[small]
pub fn on() -> u8 {
    now_on().get()
}

/// Updates the outputs. Returns how long motion has to wait, ms. `changed` says that S may have changed. Called by
/// exec, or with exec locked out.
#[inline(never)]
#[small]
pub fn switch(alone: Exclusive<'_>, spindle: &Spindle, out: &Snapshot, changed: bool) -> u16 {
    let before = on();
    // A probe that has made contact holds motion as well; the outputs stay on then.
    let wanted = match out.held && machine::is_held() {
        _ if stepper::is_stopped() || machine::is_alarmed() => 0,
        true => spindle.held(out.outputs),
        false => out.outputs,
    };
    if wanted == before && !changed {
        return 0;
    }
    now_on().set(wanted);
    // The speed is set before the spindle starts.
    pwm::set_share(alone, spindle.share(wanted, out.speed));
    gpio::set_outputs(alone, wanted);
    spindle.spin_up(before, wanted)
}

/// Switches the outputs off, because an alarm has begun.
#[small]
pub fn stop(thread: Thread) {
    common::with_outputs(thread, |common, alone| {
        switch(alone, &common.spindle, &common.motion, true)
    });
}

/// Takes over all settings that concern the outputs, and then sets the outputs by them.
#[small]
#[inline(never)]
pub fn set_all(thread: Thread, storage: &Storage) {
    let settings = (Setting::WARM..Setting::COLD).filter_map(Setting::from_number);
    for setting in settings.filter(|setting| !setting.is_data()) {
        let value = storage.cold(setting);
        take_over(thread, setting, value);
    }
    turning::set_up(thread, storage);
    tell(thread);
}

/// Takes over the value of a setting, if it concerns the outputs.
#[small]
#[inline(never)]
pub fn set(thread: Thread, setting: Setting, value: i32) {
    if take_over(thread, setting, value) {
        tell(thread);
    }
}

/// Takes over the value of a setting. Returns whether the outputs have to be set by it.
#[small]
fn take_over(thread: Thread, setting: Setting, value: i32) -> bool {
    common::with_outputs(thread, |common, alone| match common.spindle.set(setting, value) {
        Changed::Nothing => false,
        Changed::Outputs => true,
        Changed::Frequency(millihertz) => {
            pwm::set_frequency(alone, millihertz);
            true
        }
    })
}

/// Multiplies S by this many thousandths from now on.
#[small]
pub fn follow(thread: Thread, thousandths: u16) {
    if with(thread, |spindle| spindle.set_factor(thousandths)) {
        tell(thread);
    }
}

/// Sets S to `speed` turns a minute, for a surface speed. Under the override S is `most` at most.
#[small]
pub fn turn_at(thread: Thread, speed: f32, most: f32) {
    common::with_outputs(thread, |common, alone| {
        let speed = common.spindle.limited(speed, most);
        if common.motion.speed.to_bits() != speed.to_bits() {
            common.motion.speed = speed;
            pwm::set_share(alone, common.spindle.share(on(), speed));
        }
    });
}

/// Changes the state while exec cannot run.
#[small]
fn with<R>(thread: Thread, what: impl FnOnce(&mut Spindle) -> R + Send) -> R {
    common::with(thread, |common| what(&mut common.spindle))
}

/// Updates the outputs.
#[small]
fn tell(thread: Thread) {
    common::with_outputs(thread, |common, alone| {
        pwm::set_share(alone, common.spindle.share(on(), common.motion.speed));
        gpio::set_low(alone, common.spindle.low(), on());
    });
}

/// Toggles a coolant output at once. Does nothing in an alarm or in check mode. A line that waits in the queue to
/// switch an output later switches all outputs as they were when that line was planned.
#[inline(never)]
#[small]
pub fn flip(links: &Links, output: u8) {
    if machine::is_alarmed() || machine::is_checking() {
        return;
    }
    let now = common::with_outputs(links.thread, |common, alone| {
        common.motion.outputs ^= output;
        switch(alone, &common.spindle, &common.motion, true);
        common.motion.outputs
    });
    links.changes.flip(output);
    links.model.borrow_mut().set_coolant(coolant(now));
}

/// Stops the spindle while the machine stands still in a hold, or starts it again.
#[inline(never)]
#[small]
pub fn pause(links: &Links) {
    common::with_outputs(links.thread, |common, alone| {
        if common.motion.held && common.motion.outputs & outputs::SPINDLE != 0 {
            common.spindle.pause();
            switch(alone, &common.spindle, &common.motion, true);
        }
    });
}

/// Returns the coolant that the outputs stand for.
#[small]
pub fn coolant(on: u8) -> u8 {
    let bit = |output, which: Coolant| if on & output != 0 { which as u8 } else { 0 };
    bit(outputs::MIST, Coolant::Mist) | bit(outputs::FLOOD, Coolant::Flood)
}
