//! The RP2040: which interrupt stands for the interrupt executor.
//!
//! It is the second of the six that no peripheral raises (RP2040 data sheet, 2.3.2).

use cortex_m::interrupt::InterruptNumber;

/// The software interrupt.
#[derive(Clone, Copy)]
pub struct Software;

// SAFETY: the number is that of SWI_IRQ_1.
unsafe impl InterruptNumber for Software {
    fn number(self) -> u16 {
        27
    }
}

/// Its handler, by the name that the vector table of `rp-pac` gives it.
#[unsafe(no_mangle)]
extern "C" fn SWI_IRQ_1() {
    crate::interrupt::run();
}
