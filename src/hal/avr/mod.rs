//! The ATmega2560: all the registers, the interrupts, the two executors' loops.
//!
//! | interrupt | file | level | does |
//! |---|---|---|---|
//! | TIMER1_COMPA | `step_isr` | 0 | one tick of the step generator |
//! | USART0_RX, USART0_UDRE | `uart` | 1 | bytes between the line and the rings |
//! | TIMER0_COMPA | `time` | 1 | counts milliseconds |
//! | INT, PCINT, TIMER2_COMPA | `inputs` | 1 | looks at the switches when one moves |
//! | WDT | `watchdog` | 0 | resets a machine that has got stuck |
//! | USART2_UDRE | `exec` | 2 | software interrupt: polls the exec executor, interrupts on |
//!
//! Everything else runs in thread mode, from `executor::run`.

pub mod eeprom;
pub mod exec;
pub mod executor;
pub mod gpio;
pub mod inputs;
mod mem;
pub mod panic;
pub mod pwm;
mod step_isr;
pub mod stepper;
pub mod time;
pub mod uart;
pub mod watchdog;

use avr_device::atmega2560::Peripherals;

use crate::hal::event::Event;
use crate::hal::resets::Mark;

/// The peripherals.
///
/// Each register has one owner, named in the table above; the others are set up before interrupts
/// are on.
pub(super) fn peripherals() -> Peripherals {
    // SAFETY: see above: no register is written from two levels, but for single-instruction bit
    // operations.
    unsafe { Peripherals::steal() }
}

/// Does something of a few cycles with interrupts off.
#[inline(always)]
pub fn mask<R>(act: impl FnOnce() -> R) -> R {
    avr_device::interrupt::free(|_| act())
}

/// Starts the firmware anew, as if the reset button had been pressed: by the watchdog, in 15 ms.
pub fn reset() -> ! {
    avr_device::interrupt::disable();
    stepper::kill();
    watchdog::reset(Mark::ASKED)
}

/// Starts the boot loader, if the board has one; else starts the firmware anew.
///
/// A jump, not a reset: loaders of common boards pass a reset by the watchdog on to the firmware at once. They find
/// the chip as after a reset by the button as far as they look: no cause of reset noted, interrupts off, the timers
/// still. Outputs are off as after a panic. The loader is where the fuses of these boards have it, in the last 8 KiB.
pub fn boot() -> ! {
    avr_device::interrupt::disable();
    if !has_boot_loader() {
        reset();
    }
    panic::make_safe();
    watchdog::off();
    // SAFETY: nothing of the firmware runs after this; the loader makes a stack of its own.
    unsafe {
        uart::stop();
        core::arch::asm!(
            "ldi  r24, 1",
            "out  0x3C, r24",
            "ldi  r30, 0x00",
            "ldi  r31, 0xF0",
            "clr  r1",
            "eijmp",
            options(noreturn),
        );
    }
}

/// Whether the boot section, from 0x3E000 on, holds anything.
fn has_boot_loader() -> bool {
    let (low, high): (u8, u8);
    // SAFETY: reads two bytes of flash. RAMPZ is nobody's else: interrupts are off.
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

/// The event bits: general-purpose I/O register 0, where a bit is set or cleared in one instruction.
pub mod flags {
    use super::Event;

    const GPIOR0: *mut u8 = 0x3E as *mut u8;

    /// Sets a bit. Any level.
    #[inline(always)]
    pub fn set(event: Event) {
        // One `sbi` for a constant bit: cannot be torn.
        // SAFETY: the register is nobody else's.
        unsafe { GPIOR0.write_volatile(GPIOR0.read_volatile() | 1 << event as u8) };
    }

    /// The bits that are set, cleared by reading. Thread mode.
    pub fn take() -> u8 {
        // SAFETY: the register is nobody else's; interrupts are off in between.
        avr_device::interrupt::free(|_| unsafe {
            let bits = GPIOR0.read_volatile();
            GPIOR0.write_volatile(0);
            bits
        })
    }

    /// Whether a bit is set.
    #[inline(always)]
    pub fn has(event: Event) -> bool {
        // SAFETY: as in `set`.
        unsafe { GPIOR0.read_volatile() & 1 << event as u8 != 0 }
    }

    /// Whether any is set.
    #[inline(always)]
    pub fn any() -> bool {
        // SAFETY: as in `set`.
        unsafe { GPIOR0.read_volatile() != 0 }
    }
}
