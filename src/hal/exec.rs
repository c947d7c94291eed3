//! Level 2: the exec task, alone on the interrupt executor.

use avr_embassy::{Ceiling, Interrupt, interrupt};

pub use avr_embassy::interrupt::{note_idle, pend, pend_when_idle, was_idle};

/// Runs `critical` while exec cannot run. Thread mode only; everything else goes on.
#[inline(always)]
pub fn lock<R>(critical: impl FnOnce(&Ceiling) -> R) -> R {
    interrupt::lock(super::thread(), critical)
}

/// Waits until `ready` gives a value, asking again each time exec is pended. For the exec task.
pub fn wait<R>(ready: impl FnMut() -> Option<R>) -> impl Future<Output = R> {
    // SAFETY: the exec task alone calls it.
    interrupt::wait(unsafe { Interrupt::assume() }, ready)
}
