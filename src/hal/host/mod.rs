//! The host's stand-in for the hardware, over mocked time.
//!
//! Each thread is one machine with a clock of its own, in CPU cycles. Code takes no time. Time passes with events that
//! take time on the chip as well: bytes on the line, ticks of the step timer, milliseconds. [`Machine`] moves the clock
//! from one such event to the next and runs the tasks, rings and step generator of the image.

pub mod arithmetic;
pub mod card;
#[path = "../avr/drivers.rs"]
pub mod drivers;
pub mod eeprom;
pub mod encoder;
pub mod flash;
pub mod float;
pub mod gpio;
pub mod heaters;
pub mod inputs;
mod machine;
pub mod pwm;
pub mod stepper;
pub mod text;
pub mod time;
#[path = "../avr/timing.rs"]
mod timing;
pub mod uart;
pub mod watchdog;

pub use machine::Machine;

use crate::hal::Thread;
use core::cell::Cell;

pub use avr_embassy::mask;

pub use super::{exec, flags};

/// This chip, for the [contract](super::contract).
pub struct Chip;

/// Functions of [`System`](super::contract::System).
pub mod system {
    pub use super::{blends, boot, reset, set_rests};
}

/// Functions of [`Text`](super::primitives::Text).
pub mod text_functions {
    pub use super::text::copy_printing;
}

/// The time of an event that never comes.
const NEVER: u64 = u64::MAX;

/// A value that only this thread's machine touches.
pub struct Local<T>(Cell<T>);

impl<T: Copy> Local<T> {
    const fn new(value: T) -> Self {
        Self(Cell::new(value))
    }
    fn get(&self) -> T {
        self.0.get()
    }
    fn set(&self, value: T) {
        self.0.set(value);
    }
}

machine_static! {
    fn resets() -> Local<bool> = Local::new(false);
    fn blending() -> Local<bool> = Local::new(false);
    fn clock() -> Local<u64> = Local::new(0);
}

/// The machine's time in CPU cycles.
pub fn now() -> u64 {
    clock().get()
}

/// Restarts the firmware. On the host this is only recorded: see [`was_reset`].
pub fn reset(_: Thread) {
    resets().set(true);
}

/// Starts the boot loader. On the host this only does what [`reset`] does.
pub fn boot(thread: Thread) {
    reset(thread);
}

/// Does nothing: there is no USB.
pub fn set_rests(_: Thread, _: bool) {}

/// Whether lines are blended.
pub fn blends() -> bool {
    blending().get()
}

/// Sets whether lines are blended: without it the host is like a small chip.
pub fn set_blends(blends: bool) {
    blending().set(blends);
}

/// Whether the firmware has asked for a reset.
pub fn was_reset() -> bool {
    resets().get()
}
