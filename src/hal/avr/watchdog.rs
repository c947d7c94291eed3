//! The watchdog, and the cause of the last reset.
//!
//! After [`start`] the firmware has [`TIME`] between two calls of [`feed`]. If it is late, the watchdog's interrupt
//! makes the machine safe and resets it. If interrupts are off for good, the chip resets by itself after the same
//! time once more. After a reset by the watchdog the watchdog is on, with its shortest time, so [`begin`] comes first
//! at start-up.

use core::arch::asm;

use super::{panic, stepper, uart};
use crate::hal::Boot;
use crate::hal::resets::{self, Cause, Mark};

const MCUSR: *mut u8 = 0x54 as *mut u8;
const WDTCSR: *mut u8 = 0x60 as *mut u8;
const CHANGE: u8 = 1 << 4 | 1 << 3;
/// Interrupt, then reset; 0.5 s each.
const TIME: u8 = 1 << 6 | 1 << 3 | 0b101;
/// Reset in 15 ms.
const SHORTEST: u8 = 1 << 3;

unsafe extern "C" {
    /// Marks the end of all statics. Start-up does not clear the memory after it, and even the deepest stack ends above
    /// it.
    static mut _end: u16;
}

#[small]
fn leave(mark: Mark) {
    // SAFETY: nothing else lies there (`xtask size` keeps 400 bytes free). Written at start-up, and before a reset.
    unsafe { (&raw mut _end).write_volatile(mark.0) };
}

/// Writes the control register by the timed sequence of the data sheet (13.5). Interrupts are off.
#[small]
fn set(value: u8) {
    // SAFETY: nobody else uses the register, and no interrupt comes in between.
    unsafe {
        asm!("wdr", options(nostack));
        WDTCSR.write_volatile(CHANGE);
        WDTCSR.write_volatile(value);
        // The new time starts now.
        asm!("wdr", options(nostack));
    }
}

/// Switches the watchdog off, and stores the cause of the reset. The first call.
#[small]
pub fn begin(_: &Boot) {
    // SAFETY: start-up, with interrupts off. The flag in MCUSR is cleared first: while it says that the watchdog has
    // reset the chip, the watchdog cannot be switched off.
    let (chip, mark) = unsafe {
        let chip = MCUSR.read_volatile();
        MCUSR.write_volatile(0);
        (chip, Mark((&raw const _end).read_volatile()))
    };
    off();
    leave(Mark::running(resets::cause(chip, mark)));
}

/// Returns the cause of the last reset.
#[small]
pub fn cause() -> Cause {
    // SAFETY: written at start-up, and before a reset.
    let mark = unsafe { (&raw const _end).read_volatile() };
    Mark(mark).cause().unwrap_or(Cause::PowerOn)
}

/// Switches the watchdog on.
#[small]
pub fn start(_: &Boot) {
    set(TIME);
}

/// Restarts the time of the watchdog. Does nothing if the step interrupt is off, because then ticks would come only
/// from the interrupts of serial ports, one for each byte. Any level. Cost: 4 cycles.
#[inline(never)]
#[small]
pub fn feed() {
    if stepper::is_on() {
        // SAFETY: this instruction changes nothing but the watchdog's counter.
        unsafe { asm!("wdr", options(nostack)) };
    }
}

/// Switches the watchdog off. Interrupts are off.
#[small]
pub fn off() {
    set(0);
}

/// Leaves the mark `why` and resets the chip in 15 ms. Before that it ends the line that is being sent, so that a
/// sender does not read the greeting as the rest of that line. Interrupts are off.
#[small]
pub fn reset(why: Mark) -> ! {
    leave(why);
    // SAFETY: interrupts are off for good.
    unsafe { uart::end_lines() };
    set(SHORTEST);
    loop {
        avr_device::asm::nop();
    }
}

/// WDT: the firmware hangs. It never returns, so it saves no registers.
#[unsafe(no_mangle)]
extern "C" fn __vector_12() -> ! {
    // SAFETY: interrupts are off; r1 is 0, as the called function expects.
    unsafe { asm!("clr r1", "jmp {starved}", starved = sym starved, options(noreturn)) }
}

extern "C" fn starved() -> ! {
    panic::make_safe();
    // If this code hangs too, the watchdog, which is on, resets the chip.
    set(TIME & !(1 << 6));
    reset(Mark::STARVED)
}
