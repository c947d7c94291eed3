//! The watchdog, and the cause of the last reset.
//!
//! After [`start`] the firmware has [`TIME_US`] between two calls of [`feed`]; if it is late, the chip resets. A
//! scratch register, which this reset does not clear, keeps a [`Mark`]. After a reset all pins are inputs.
//!
//! `embassy-rp`'s `Watchdog` is not used: its `feed` wants the only reference to it, and two levels feed here, with one
//! store.

use embassy_rp::pac::watchdog::regs::Load;
use embassy_rp::pac::{PSM, VREG_AND_CHIP_RESET, WATCHDOG};

use crate::hal::resets::{self, Cause, Mark};
use crate::hal::{Boot, Thread};

/// 0.5 s. The counter goes down twice a microsecond (erratum E1).
const TIME_US: u32 = 500_000;

/// Bits of the cause of a reset, as [`resets::cause`] takes them.
const POWER_ON: u8 = 1;
/// See [`POWER_ON`].
const EXTERNAL: u8 = 1 << 1;
/// See [`POWER_ON`].
const WATCHDOG_BIT: u8 = 1 << 3;

/// What the watchdog resets: everything except the oscillators.
const RESETS: u32 = 0x0001_FFFC;

fn leave(mark: Mark) {
    WATCHDOG.scratch0().write_value(mark.0.into());
}

fn left() -> Mark {
    Mark(WATCHDOG.scratch0().read() as u16)
}

/// Stores the cause of the reset. First thing at start-up.
///
/// The boot loader in ROM starts a new image by the watchdog, too. Only a mark of this firmware makes a fault of it.
pub(super) fn begin(_: &Boot) {
    off();
    let reason = WATCHDOG.reason().read();
    let chip = VREG_AND_CHIP_RESET.chip_reset().read();
    let bits = if (reason.timer() || reason.force()) && left().is_ours() {
        WATCHDOG_BIT
    } else if chip.had_por() {
        POWER_ON
    } else {
        EXTERNAL
    };
    leave(Mark::running(resets::cause(bits, left())));
}

/// Returns the cause of the last reset.
pub fn cause() -> Cause {
    left().cause().unwrap_or(Cause::PowerOn)
}

/// Switches the watchdog on.
pub(super) fn start() {
    PSM.wdsel().write_value(embassy_rp::pac::psm::regs::Wdsel(RESETS));
    feed();
    WATCHDOG.ctrl().modify(|w| w.set_enable(true));
}

/// Restarts the time of the watchdog. Any level.
pub fn feed() {
    WATCHDOG.load().write_value(Load(2 * TIME_US));
}

/// Switches the watchdog off.
pub(super) fn off() {
    WATCHDOG.ctrl().modify(|w| w.set_enable(false));
}

/// Restarts the firmware, as if the reset button had been pressed.
pub fn reset(_: Thread) -> ! {
    cortex_m::interrupt::disable();
    super::panic::make_safe();
    super::uart::end_lines();
    leave(Mark::ASKED);
    PSM.wdsel().write_value(embassy_rp::pac::psm::regs::Wdsel(RESETS));
    WATCHDOG.ctrl().write(|w| w.set_trigger(true));
    loop {
        cortex_m::asm::nop();
    }
}

/// Starts the boot loader in ROM, which appears as a drive that takes a new image.
pub fn boot(_: Thread) -> ! {
    cortex_m::interrupt::disable();
    super::panic::make_safe();
    off();
    leave(Mark::NONE);
    embassy_rp::rom_data::reset_to_usb_boot(0, 0);
    loop {
        cortex_m::asm::nop();
    }
}
