//! The panic handler. No panic is meant to be reachable after start-up. If one happens, motion and outputs stop and the
//! machine stays still until it is reset.

use super::gpio::{self, each};
use crate::boards::ACTIVE;
use crate::hal::Exclusive;

/// Stops the step timer, switches drivers and hazardous outputs off, and never returns.
pub fn halt() -> ! {
    avr_device::interrupt::disable();
    make_safe();
    super::watchdog::off();
    loop {
        avr_device::asm::nop();
    }
}

/// Stops the step timer, and switches drivers and hazardous outputs off. Interrupts are off.
pub fn make_safe() {
    super::stepper::kill();
    super::pwm::kill();
    super::heaters::kill();
    each!(ACTIVE.hazards, hazard => gpio::low(hazard));
    // SAFETY: interrupts are off.
    let alone = unsafe { Exclusive::assume() };
    gpio::stop_spindle(alone);
    gpio::power(alone, 0);
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    halt()
}
