//! Pins of the board, as constants: setting one is a single `sbi` or `cbi` on ports A to G.
//!
//! Ports H to L take a read-modify-write, so a pin there must share its port with no pin that
//! another level writes.

use crate::boards::{ACTIVE, MOTORS, Pin};
use crate::hal::byte::SharedByte;

/// Drives a pin high.
#[inline(always)]
pub fn high(pin: Pin) {
    let port = pin.port.address() as *mut u8;
    // SAFETY: an output port of the board; see the module's note on sharing.
    unsafe { port.write_volatile(port.read_volatile() | 1 << pin.bit) };
}

/// Drives a pin low.
#[inline(always)]
pub fn low(pin: Pin) {
    let port = pin.port.address() as *mut u8;
    // SAFETY: an output port of the board; see the module's note on sharing.
    unsafe { port.write_volatile(port.read_volatile() & !(1 << pin.bit)) };
}

/// Turns a pin round. One store on any port, which disturbs no other pin.
#[inline(always)]
pub fn toggle(pin: Pin) {
    let input = (pin.port.address() - 2) as *mut u8;
    // SAFETY: a one written to an input register toggles the output of that bit alone.
    unsafe { input.write_volatile(1 << pin.bit) };
}

fn output(pin: Pin) {
    let direction = (pin.port.address() - 1) as *mut u8;
    // SAFETY: the data direction register lies one below the port register; start-up only.
    unsafe { direction.write_volatile(direction.read_volatile() | 1 << pin.bit) };
}

/// Makes outputs of the board's outputs: steps low, drivers off, hazards off.
pub fn start() {
    for motor in ACTIVE.motors {
        low(motor.step);
        output(motor.step);
        output(motor.dir);
        if let Some(enable) = motor.enable {
            high(enable);
            output(enable);
        }
    }
    if let Some(enable) = ACTIVE.enable_all {
        high(enable);
        output(enable);
    }
    for &hazard in ACTIVE.hazards {
        low(hazard);
        output(hazard);
    }
}

static POWERED: SharedByte = SharedByte::new(0);

/// Whether the motor drivers are on.
pub fn is_powered() -> bool {
    POWERED.get() != 0
}

/// Switches all motor drivers on or off.
pub fn power(on: bool) {
    POWERED.set(on.into());
    let set = if on { low } else { high };
    for m in 0..MOTORS {
        if let Some(enable) = ACTIVE.motors[m].enable {
            set(enable);
        }
    }
    if let Some(enable) = ACTIVE.enable_all {
        set(enable);
    }
}
