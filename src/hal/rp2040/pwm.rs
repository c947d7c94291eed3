//! The spindle's pulse-width output: a slice of the chip's PWM unit that counts up and down, and its pin.
//!
//! The pin is high while the count is below the compare value; a new value takes effect with the next period. Exec,
//! or thread mode while exec cannot run. On a board without a PWM output nothing happens.
//!
//! `embassy-rp`'s `Pwm` is not used: its pin and its slice are types, and here they are data of the board. Its
//! `set_config` writes both channels and the top anew with each share, and panics at a divider that is too large.

use embassy_rp::pac::PWM;

use super::gpio::{self, Unit};
use crate::boards::ACTIVE;
use crate::hal::Exclusive;
use crate::spindle::WHOLE;

/// The highest count.
const MOST: u32 = u16::MAX as u32 - 1;

/// Returns the pin, its slice, and whether it is channel B (RP2040 data sheet, 4.5.2).
fn place() -> Option<(crate::boards::Pin, usize, bool)> {
    let pin = ACTIVE.pwm?.pin();
    Some((pin, usize::from(pin.bit / 2 % 8), pin.bit % 2 == 1))
}

/// Returns the divider, in sixteenths, and the top for a frequency in thousandths of a Hz: the finest that fits.
fn divide(millihertz: u32) -> (u32, u32) {
    // A period is twice the top: up and down. 64-bit arithmetic is acceptable, because it runs once for each change
    // of the setting.
    let counts = u64::from(ACTIVE.clock_hz) * 500 / u64::from(millihertz.max(1));
    let sixteenths = (counts * 16 / u64::from(MOST) + 1).clamp(16, 0xFFF) as u32;
    let top = (counts * 16 / u64::from(sixteenths)).clamp(1, MOST.into()) as u32;
    (sixteenths, top)
}

/// Sets the frequency, in thousandths of a Hz. The share becomes 0 and has to be set again.
pub fn set_frequency(_: Exclusive<'_>, millihertz: u32) {
    let Some((pin, slice, _)) = place() else { return };
    let (sixteenths, top) = divide(millihertz);
    let channel = PWM.ch(slice);
    channel.csr().write(|w| w.set_en(false));
    channel.div().write(|w| {
        w.set_int((sixteenths / 16) as u8);
        w.set_frac((sixteenths % 16) as u8);
    });
    channel.top().write(|w| w.set_top(top as u16));
    channel.cc().write(|w| {
        w.set_a(0);
        w.set_b(0);
    });
    channel.ctr().write(|w| w.set_ctr(0));
    gpio::connect_output(pin, Unit::Pwm);
    channel.csr().write(|w| {
        w.set_ph_correct(true);
        w.set_en(true);
    });
}

/// Sets the share of the period for which the pin is high, in thousandths.
pub fn set_share(_: Exclusive<'_>, share: f32) {
    let Some((_, slice, is_b)) = place() else { return };
    let channel = PWM.ch(slice);
    let top = channel.top().read().top();
    let counts = share * (1.0 / WHOLE as f32) * f32::from(top) + 0.5;
    // A full share is beyond the top: no pulses, always high.
    let counts = if share >= f32::from(WHOLE) { u32::from(top) + 1 } else { counts as u32 };
    channel.cc().write(|w| if is_b { w.set_b(counts as u16) } else { w.set_a(counts as u16) });
}

/// Disconnects the pin from the PWM unit; it is low from then on. For the panic handler.
pub(super) fn kill() {
    if let Some((pin, ..)) = place() {
        gpio::connect(pin, Unit::Cpu);
    }
}
