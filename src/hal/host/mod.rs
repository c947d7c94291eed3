//! The host's stand-in for the hardware, over mocked time.
//!
//! Each thread is one machine with a clock of its own, in CPU cycles. Code takes no time; what takes
//! time is what does on the chip: bytes on the line, ticks of the step timer, milliseconds.
//! [`Machine`] moves the clock from one such event to the next and runs the same tasks, rings and step
//! generator as the image.

pub mod eeprom;
pub mod exec;
pub mod gpio;
pub mod inputs;
mod machine;
pub mod pwm;
pub mod stepper;
pub mod time;
pub mod uart;
pub mod watchdog;

pub use machine::Machine;

use core::cell::Cell;

use super::event::Event;

/// Never.
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
    fn bits() -> Local<u8> = Local::new(0);
    fn resets() -> Local<bool> = Local::new(false);
    fn clock() -> Local<u64> = Local::new(0);
}

/// Does something with interrupts off. Here everything is one thread.
pub fn mask<R>(act: impl FnOnce() -> R) -> R {
    act()
}

/// The machine's time in CPU cycles.
pub fn now() -> u64 {
    clock().get()
}

/// Starts the firmware anew. On the host it is only noted: see [`was_reset`].
pub fn reset() {
    resets().set(true);
}

/// Starts the boot loader. On the host it is as [`reset`].
pub fn boot() {
    reset();
}

/// Whether the firmware has asked for a reset.
pub fn was_reset() -> bool {
    resets().get()
}

/// The event bits.
pub mod flags {
    use super::{Event, bits};

    /// Sets a bit.
    pub fn set(event: Event) {
        bits().set(bits().get() | 1 << event as u8);
    }

    /// The bits that are set, cleared by reading.
    pub fn take() -> u8 {
        let taken = bits().get();
        bits().set(0);
        taken
    }

    /// Whether a bit is set.
    #[inline(always)]
    pub fn has(event: Event) -> bool {
        bits().get() & 1 << event as u8 != 0
    }

    /// Whether any is set.
    pub fn any() -> bool {
        bits().get() != 0
    }
}
