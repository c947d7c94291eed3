//! The ATmega2560: its registers and interrupts.
//!
//! | interrupt | file | level | does |
//! |---|---|---|---|
//! | TIMER1_COMPA | `step_isr` | 0 | one tick of the step generator |
//! | USART0_RX, USART0_UDRE | `uart` | 1 | bytes between the line and the rings |
//! | TIMER0_COMPA | [`avr_embassy::time`] | 1 | counts milliseconds |
//! | INT, PCINT, TIMER2_COMPA or TIMER3_COMPA | `edges`, `inputs` | 1 | samples the switches when one moves |
//! | INT, PCINT of the encoder's pins | `edges`, `encoder` | 1 | takes the time of a pulse |
//! | ADC | `heaters` | 1 | adds up a reading of a temperature |
//! | WDT | `watchdog` | 0 | resets a firmware that hangs |
//! | USART2_UDRE | [`avr_embassy::interrupt`] | 2 | software interrupt: polls the exec executor, interrupts on |
//!
//! The registers of an interrupt are owned by the file in this table. Registers that no interrupt owns are set up
//! before interrupts are enabled. All other code runs in thread mode, from [`avr_embassy::Executor::run_with`].

pub mod arithmetic;
pub mod card;
pub mod drivers;
mod edges;
pub mod eeprom;
pub mod encoder;
pub mod flash;
pub mod float;
pub mod gpio;
pub mod heaters;
pub mod inputs;
mod mem;
pub mod panic;
pub mod pwm;
mod spi;
mod step_isr;
pub mod stepper;
pub mod text;
pub mod time;
mod timing;
pub mod uart;
pub mod watchdog;

pub use avr_embassy::mask;

pub use crate::hal::{exec, flags};

use crate::hal::Thread;
use crate::hal::resets::Mark;

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

/// Restarts the firmware, as if the reset button had been pressed: the watchdog resets the chip in 15 ms.
pub fn reset(_: Thread) -> ! {
    avr_device::interrupt::disable();
    stepper::kill();
    watchdog::reset(Mark::ASKED)
}

/// Starts the boot loader, if the board has one; else restarts the firmware.
///
/// This is a jump, not a reset: after a reset by the watchdog the loaders of common boards start the firmware at once.
/// The loader finds the chip as after a reset by the button: interrupts are off and all registers of peripherals have
/// their values after a reset, so no interrupt comes when the loader allows them, and all pins float. No reset cause is
/// set. The loader is in the last 8 KiB of flash, as the fuses of these boards select.
pub fn boot(thread: Thread) -> ! {
    avr_device::interrupt::disable();
    if !has_boot_loader() {
        reset(thread);
    }
    watchdog::off();
    // SAFETY: nothing of the firmware runs after this; the loader sets up its own stack. The loop stores 0 to each
    // register from 0x20 to 0x136, the stack pointer included, except OSCCAL (0x66), which a reset does not zero. It
    // goes upwards: each USART and the SPI are off before 0 gets into their data registers. UCSR0C is 6 after a reset.
    unsafe {
        core::arch::asm!(
            "clr  r1",
            "ldi  r24, 1",
            "ldi  r30, 0x20",
            "clr  r31",
            "1:",
            "cpi  r30, 0x66",
            "breq 2f",
            "st   Z, r1",
            "2:",
            "adiw r30, 1",
            "cpi  r30, 0x37",
            "cpc  r31, r24",
            "brne 1b",
            "ldi  r30, 6",
            "sts  0xC2, r30",
            "out  0x3C, r24",
            "ldi  r30, 0x00",
            "ldi  r31, 0xF0",
            "eijmp",
            options(noreturn),
        );
    }
}

/// Does nothing: this chip has no USB.
pub fn set_rests(_: Thread, _: bool) {}

/// Whether lines are blended: this chip has no room for it.
pub fn blends() -> bool {
    false
}

/// Whether the boot section, from 0x3E000 on, holds a program.
fn has_boot_loader() -> bool {
    let (low, high): (u8, u8);
    // SAFETY: reads two bytes of flash. Nobody else uses RAMPZ meanwhile: interrupts are off.
    unsafe {
        core::arch::asm!(
            "ldi  r24, 3",
            "out  0x3B, r24",
            "elpm {low}, Z+",
            "elpm {high}, Z",
            "out  0x3B, r1",
            low = out(reg) low,
            high = out(reg) high,
            inout("Z") 0xE000u16 => _,
            out("r24") _,
            options(nostack),
        );
    }
    !matches!((low, high), (0xFF, 0xFF) | (0, 0))
}
