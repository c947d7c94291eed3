//! The spindle's pulse-width output: a 16-bit timer that counts up and down, and its pin.
//!
//! Phase and frequency correct (mode 8): the pin is high while the count is below the compare value, so that a share
//! of nothing and one of all are without pulses, and a new value counts from the next period on. The timer has no
//! interrupt. Exec, or thread mode while exec cannot run. On a board without one nothing happens.

use crate::boards::{ACTIVE, Pwm};
use crate::spindle::{WHOLE, divide};

/// Registers behind the timer's first.
const CONTROL_B: usize = 1;
const COUNT: usize = 4;
const TOP: usize = 6;
const COMPARE: usize = 8;
/// Mode 8, in the second register.
const MODE: u8 = 1 << 4;

#[small]
impl Pwm {
    /// What connects the pin: clear it on the way up, set it on the way down.
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

/// Sets the frequency, in thousandths of a Hz. The share has to be set again; until then it is 0.
#[small]
pub fn set_frequency(millihertz: u32) {
    let Some(pwm) = ACTIVE.pwm else { return };
    let (prescaler, top) = divide(ACTIVE.clock_hz, millihertz);
    // SAFETY: the registers of the timer are this module's; it stands still in mode 0, where a compare value is
    // taken over at once, while it is set up.
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

/// Sets what part of the period the pin is high, in thousandths.
#[inline(never)]
#[small]
pub fn set_share(share: f32) {
    let Some(pwm) = ACTIVE.pwm else { return };
    // SAFETY: as in `set_frequency`. The high byte of a word waits in a register of this timer, which nobody else uses.
    unsafe {
        let top = pwm.word(TOP).read_volatile();
        let counts = share * (1.0 / WHOLE as f32) * f32::from(top) + 0.5;
        pwm.word(COMPARE + 2 * usize::from(pwm.channel)).write_volatile(counts as u32 as u16);
    }
}

/// Disconnects the pin, which is low from then on. For the panic handler.
#[small]
pub fn kill() {
    if let Some(pwm) = ACTIVE.pwm {
        // SAFETY: a single store; the machine stops for good.
        unsafe { pwm.byte(0).write_volatile(0) };
    }
}
