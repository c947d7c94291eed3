//! The RP2040: the software interrupts of the interrupt executor and of the prompt executor.
//!
//! They are the second and the third of the six interrupts that no peripheral raises (RP2040 data sheet, 2.3.2).

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

/// The software interrupt of the prompt executor: the third.
#[derive(Clone, Copy)]
pub struct Prompt;

// SAFETY: the number is that of SWI_IRQ_2.
unsafe impl InterruptNumber for Prompt {
    fn number(self) -> u16 {
        28
    }
}

/// Handler of the interrupt executor, by the name that the vector table of `rp-pac` gives it.
#[unsafe(no_mangle)]
extern "C" fn SWI_IRQ_1() {
    crate::interrupt::run();
}

/// Handler of the prompt executor.
#[unsafe(no_mangle)]
extern "C" fn SWI_IRQ_2() {
    crate::interrupt::prompt::run();
}
