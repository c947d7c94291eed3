//! The panic handler. No panic is meant to be reachable after start-up. If one happens, motion and outputs stop and the
//! machine stays still until it is reset. The message of the panic is sent [after the reset](super::last_words).
//!
//! A fault of the CPU, which is an access where no memory is, does the same. A stack that is too deep is such an access,
//! because the stack lies at the lower end of RAM (`memory.x`). The CPU may then have no place for the frame of the
//! fault's handler: it stands still, and the watchdog resets it within half a second.

use cortex_m_rt::{ExceptionFrame, exception};

use super::{gpio, heaters, last_words, pwm, stepper, watchdog};
use crate::boards::ACTIVE;
use crate::hal::{Exclusive, Thread};

/// Stops the steps, switches drivers and hazardous outputs off, and never returns.
pub fn halt() -> ! {
    cortex_m::interrupt::disable();
    make_safe();
    watchdog::off();
    loop {
        cortex_m::asm::nop();
    }
}

/// Stops the steps, and switches drivers and hazardous outputs off. The fan of the heatbreak turns from then on, because
/// the hot end may be hot. Interrupts are off, and stay so.
pub fn make_safe() -> Exclusive<'static> {
    stepper::kill();
    pwm::kill();
    // SAFETY: interrupts are off, and nothing goes on after this.
    let (thread, alone) = unsafe { (Thread::assume(), Exclusive::assume()) };
    ACTIVE.hazards.iter().for_each(|hazard| gpio::switch(alone, *hazard, false));
    gpio::stop_spindle(alone);
    gpio::power(alone, 0);
    heaters::cool(thread, true);
    alone
}

// SAFETY: the handler of a fault ends all that runs, and its registers and the message are touched by nothing else
// from then on.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    let alone = make_safe();
    last_words::leave(alone, &format_args!("fault at {:#x}", frame.pc()));
    halt()
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    let alone = make_safe();
    last_words::leave(alone, info);
    halt()
}
