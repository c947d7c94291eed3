//! The spindle's pulse-width output: a 16-bit timer that counts up and down, and its pin.
//!
//! Phase and frequency correct (mode 8): the pin is high while the count is below the compare value. So a share of 0
//! and a full share have no pulses, and a new value takes effect with the next period. The timer has no interrupt.
//! Exec, or thread mode while exec cannot run. On a board without a PWM output nothing happens.

use crate::boards::{ACTIVE, Pwm};
use crate::hal::Exclusive;
use crate::spindle::{WHOLE, divide};

/// Offsets of registers from the timer's first.
const CONTROL_B: usize = 1;
const COUNT: usize = 4;
const TOP: usize = 6;
const COMPARE: usize = 8;
/// Bits of mode 8, in the second control register.
const MODE: u8 = 1 << 4;

#[small]
impl Pwm {
    /// Returns the bits that connect the pin: clear it on the way up, set it on the way down.
    const fn connected(self) -> u8 {
        1 << (7 - 2 * self.channel)
    }

    fn byte(self, offset: usize) -> *mut u8 {
        (self.address() + offset) as *mut u8
    }

    fn word(self, offset: usize) -> *mut u16 {
        (self.address() + offset) as *mut u16
    }
}

/// Sets the frequency, in thousandths of a Hz. The share becomes 0 and has to be set again.
#[small]
pub fn set_frequency(_: Exclusive<'_>, millihertz: u32) {
    let Some(pwm) = ACTIVE.pwm else { return };
    let (prescaler, top) = divide(ACTIVE.clock_hz, millihertz);
    // SAFETY: the registers of the timer are this module's. While it is set up the timer stands still in mode 0,
    // where a compare value is taken over at once.
    unsafe {
        pwm.byte(CONTROL_B).write_volatile(0);
        pwm.byte(0).write_volatile(0);
        pwm.word(COUNT).write_volatile(0);
        pwm.word(COMPARE + 2 * usize::from(pwm.channel)).write_volatile(0);
        pwm.word(TOP).write_volatile(top);
        pwm.byte(0).write_volatile(pwm.connected());
        pwm.byte(CONTROL_B).write_volatile(MODE | prescaler);
    }
}

/// Sets the share of the period for which the pin is high, in thousandths.
#[inline(never)]
#[small]
pub fn set_share(_: Exclusive<'_>, share: f32) {
    let Some(pwm) = ACTIVE.pwm else { return };
    // SAFETY: as in `set_frequency`. The high byte of a word is latched in a register of this timer, which nobody
    // else uses.
    unsafe {
        let top = pwm.word(TOP).read_volatile();
        let counts = share * (1.0 / WHOLE as f32) * f32::from(top) + 0.5;
        pwm.word(COMPARE + 2 * usize::from(pwm.channel)).write_volatile(counts as u32 as u16);
    }
}

/// Disconnects the pin from the timer; it is low from then on. For the panic handler.
#[small]
pub fn kill() {
    if let Some(pwm) = ACTIVE.pwm {
        // SAFETY: a single store; the machine stops for good.
        unsafe { pwm.byte(0).write_volatile(0) };
    }
}
