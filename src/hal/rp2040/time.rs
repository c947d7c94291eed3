//! The count of milliseconds, by the interrupt of SysTick, and its event. Tasks wait by means of `embassy-rp`'s time
//! driver.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::syst::SystClkSource;

use crate::boards::ACTIVE;
use crate::hal::Boot;
use crate::hal::event::Event;
use crate::hal::flags;

static MILLIS: AtomicU32 = AtomicU32::new(0);

/// Priority 1, in the two highest bits.
const PRIORITY: u8 = 1 << 6;

/// Starts the count.
pub(super) fn start(_: &Boot) {
    // Nobody has taken them before.
    let Some(mut core) = cortex_m::Peripherals::take() else { return };
    // SAFETY: start-up.
    unsafe { core.SCB.set_priority(SystemHandler::SysTick, PRIORITY) };
    let syst: &mut SYST = &mut core.SYST;
    syst.set_clock_source(SystClkSource::Core);
    syst.set_reload(ACTIVE.clock_hz / 1_000 - 1);
    syst.clear_current();
    syst.enable_counter();
    syst.enable_interrupt();
}

#[cortex_m_rt::exception]
fn SysTick() {
    MILLIS.store(millis().wrapping_add(1), Ordering::Relaxed);
    flags::set(Event::Tick);
}

/// Returns the milliseconds since start-up, modulo 2^32.
pub fn millis() -> u32 {
    MILLIS.load(Ordering::Relaxed)
}
