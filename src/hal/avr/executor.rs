//! The thread-mode loop.

use embassy_executor::raw::Executor;

use super::{exec, flags};
use crate::hal::event;

/// Runs the main executor for ever, asleep when there is nothing to do.
pub fn run(executor: &'static Executor) -> ! {
    avr_device::interrupt::disable();
    // Without this bit `sleep` does nothing; the mode is idle.
    super::peripherals().CPU.smcr().write(|w| w.se().set_bit());
    // SAFETY: start-up is over and no critical section is open.
    unsafe { avr_device::interrupt::enable() };
    loop {
        if flags::any() {
            event::dispatch(flags::take());
            // SAFETY: called from here only, so never reentered.
            unsafe { executor.poll() };
            continue;
        }
        // With interrupts on, as all that may be: exec runs right here if it wants to.
        exec::idle();
        avr_device::interrupt::disable();
        if !flags::any() {
            // The CPU executes one instruction after `reti` before it serves the next interrupt. That is `nop`, not
            // `cli`: a step that is due when another interrupt ends must not wait for this loop as well.
            // SAFETY: plain instructions. They must stay together: an interrupt cannot come between
            // `sei` and `sleep`, so an event set after the test above still ends the sleep.
            unsafe { core::arch::asm!("sei", "sleep", "nop") };
            continue;
        }
        // SAFETY: as above.
        unsafe { avr_device::interrupt::enable() };
    }
}
