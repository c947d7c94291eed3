//! The thread-mode loop, and the pender that tells the two executors apart.

use embassy_executor::raw::Executor;

use super::flags;
use crate::hal::event::{self, Event};

/// Pender context of the main executor.
pub const THREAD: *mut () = core::ptr::null_mut();
/// Pender context of the exec executor.
pub const EXEC: *mut () = core::ptr::dangling_mut();

#[unsafe(export_name = "__pender")]
fn pender(context: *mut ()) {
    // The exec task is woken by the exec interrupt only, just before it polls: nothing to pend.
    if context == THREAD {
        flags::set(Event::Thread);
    }
}

/// Runs the main executor for ever, asleep when there is nothing to do.
pub fn run(executor: &'static Executor) -> ! {
    avr_device::interrupt::disable();
    // Without this bit `sleep` does nothing; the mode is idle.
    super::peripherals().CPU.smcr().write(|w| w.se().set_bit());
    loop {
        if flags::any() {
            // SAFETY: start-up is over and no critical section is open.
            unsafe { avr_device::interrupt::enable() };
            event::dispatch(flags::take());
            // SAFETY: called from here only, so never reentered.
            unsafe { executor.poll() };
            avr_device::interrupt::disable();
        } else {
            // SAFETY: plain instructions. They must stay together: an interrupt cannot come between
            // `sei` and `sleep`, so an event set after the test above still ends the sleep.
            unsafe { core::arch::asm!("sei", "sleep", "cli") };
        }
    }
}
