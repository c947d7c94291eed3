//! What runs before memory is initialised: outputs behind a shift register are switched off.
//!
//! A register keeps its outputs over a reset, while the chip's own pins fall back to inputs. The spindle would run on until
//! statics and code are in RAM and the clocks run, which takes the chip some tenths of a second at the speed of its start.
//! So the CPU sends the bits itself, at the start of the image: 100 us in the emulator, whose clock is fast from the start.
//!
//! Nothing here may use a static or call code in RAM (`memory.x`).

use cortex_m::asm::nop;
use embassy_rp::pac::{IO_BANK0, RESETS, SIO};

use super::gpio::Unit;
use super::register::SAFE;
use crate::boards::{ACTIVE, Pin, ShiftRegister};

unsafe extern "C" {
    /// What `embassy-rp` runs before memory is initialised.
    fn __real___pre_init();
}

/// The linker puts this in the place of `__pre_init` (`--wrap`).
///
/// # Safety
/// The start-up code alone calls it, once.
#[unsafe(no_mangle)]
unsafe extern "C" fn __wrap___pre_init() {
    // SAFETY: it is called once, before anything else.
    unsafe { __real___pre_init() };
    if let Some(registers) = ACTIVE.registers {
        send(registers.outputs, SAFE);
    }
}

/// Sends bits to a chain, the last output first, and latches them.
fn send(chain: ShiftRegister, levels: u32) {
    RESETS.reset().modify(|w| {
        w.set_io_bank0(false);
        w.set_pads_bank0(false);
    });
    while !RESETS.reset_done().read().io_bank0() || !RESETS.reset_done().read().pads_bank0() {}
    for pin in [chain.data, chain.clock, chain.latch] {
        drive(pin, false);
        SIO.gpio_oe(0).value_set().write_value(1 << pin.bit);
        IO_BANK0.gpio(pin.bit.into()).ctrl().write(|w| w.set_funcsel(Unit::Cpu as u8));
    }
    for output in (0..chain.outputs).rev() {
        drive(chain.data, levels >> output & 1 != 0);
        drive(chain.clock, true);
        drive(chain.clock, false);
    }
    drive(chain.latch, true);
    drive(chain.latch, false);
}

/// Drives a pin, and keeps it for 30 ns at least.
#[inline(always)]
fn drive(pin: Pin, high: bool) {
    let out = SIO.gpio_out(0);
    let one = if high { out.value_set() } else { out.value_clr() };
    one.write_value(1 << pin.bit);
    (0..4).for_each(|_| nop());
}
