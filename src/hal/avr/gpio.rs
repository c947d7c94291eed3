//! Pins of the board, as constants: setting one is a single `sbi` or `cbi` on ports A to G, as long as
//! its level is a constant too.
//!
//! Otherwise, and on ports H to L, it is a read-modify-write, so the pin must share its port with no pin
//! that another level writes meanwhile. Enables see to that themselves.

use crate::boards::outputs::{COUNTERCLOCKWISE, SPINDLE};
use crate::boards::{ACTIVE, Handshake, Pin, each_motor};
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

#[inline(always)]
pub(super) fn output(pin: Pin) {
    let direction = (pin.port.address() - 1) as *mut u8;
    // SAFETY: the data direction register lies one below the port register; thread mode alone writes it.
    unsafe { direction.write_volatile(direction.read_volatile() | 1 << pin.bit) };
}

/// Does the same for each item of a list of the board's, up to eight, as a constant: neither list nor loop are left.
macro_rules! each {
    ($list:expr, $item:ident => $body:expr) => {
        each!($list, $item => $body; 0 1 2 3 4 5 6 7)
    };
    ($list:expr, $item:ident => $body:expr; $($i:literal)+) => {$(
        if let Some($item) = const { $crate::hal::imp::gpio::item($list, $i) } {
            $body
        }
    )+};
}

pub(super) use each;

/// An item of a list.
pub(super) const fn item<T: Copy>(list: &[T], i: usize) -> Option<T> {
    if i < list.len() { Some(list[i]) } else { None }
}

/// Makes outputs of the board's outputs: steps low, drivers off, hazards off, senders welcome, no bus driven.
/// Of the spindle's enable it is not known yet which level is off: see [`set_low`].
pub fn start() {
    each_motor!(M => {
        low(ACTIVE.motors[M].step);
        output(ACTIVE.motors[M].step);
        output(ACTIVE.motors[M].dir);
        if let Some(enable) = ACTIVE.motors[M].enable {
            high(enable);
            output(enable);
        }
    });
    if let Some(enable) = ACTIVE.enable_all {
        high(enable);
        output(enable);
    }
    each!(ACTIVE.hazards, hazard => {
        low(hazard);
        if ACTIVE.outputs[0] != Some(hazard) {
            output(hazard);
        }
    });
    each!(ACTIVE.serial, serial => {
        if let Some(Handshake { rts, cts }) = serial.handshake {
            low(rts);
            output(rts);
            // Pulled up: of a wire that is not there nothing is sent.
            high(cts);
        }
        if let Some(driver) = serial.driver_enable {
            low(driver);
            output(driver);
        }
    });
    super::heaters::start();
    super::spi::start();
    if let Some(select) = ACTIVE.card {
        high(select);
        output(select);
    }
}

/// The motors whose drivers are wanted on, as bits.
static WANTED: SharedByte = SharedByte::new(0);

/// The motors whose drivers are on, as bits.
#[inline(never)] // In a function built for size the board would be a table in RAM.
pub fn powered() -> u8 {
    ACTIVE.powered(WANTED.get())
}

/// Switches the drivers of these motors (bits) on, and the others off as far as the board can: an
/// enable that all drivers share is on for any of them. Exec, or while it cannot run.
pub fn power(motors: u8) {
    WANTED.set(motors);
    each_motor!(M => if let Some(enable) = ACTIVE.motors[M].enable {
        set(enable, motors & (1 << M) == 0);
    });
    if let Some(enable) = ACTIVE.enable_all {
        set(enable, motors == 0);
    }
}

/// The outputs that are on when they are low, as bits.
static LOW: SharedByte = SharedByte::new(0);

/// Switches the outputs of M3 to M9, bits of [`outputs`](crate::boards::outputs). The direction of a spindle that is
/// off stays as it is. Exec, or while it cannot run.
pub fn set_outputs(on: u8) {
    let high = on ^ LOW.get();
    macro_rules! each {
        ($($o:literal)+) => {$(
            if let Some(pin) = ACTIVE.outputs[$o]
                && (1 << $o != COUNTERCLOCKWISE || on & SPINDLE != 0)
            {
                set(pin, high & (1 << $o) != 0);
            }
        )+};
    }
    each!(1 0 2 3);
}

/// Which outputs are on when they are low. From the first time on the spindle's enable is driven. Thread mode, while
/// exec cannot run.
pub fn set_low(outputs: u8, on: u8) {
    LOW.set(outputs);
    if let Some(direction) = ACTIVE.outputs[1] {
        set(direction, (on ^ outputs) & COUNTERCLOCKWISE != 0);
    }
    set_outputs(on);
    if let Some(enable) = ACTIVE.outputs[0] {
        output(enable);
    }
}

/// Stops the spindle for good. Interrupts are off.
pub fn stop_spindle() {
    if let Some(enable) = ACTIVE.outputs[0] {
        set(enable, LOW.get() & SPINDLE != 0);
    }
}

/// The compiler makes one read-modify-write of the two cases, and the port may be shared with pins of the
/// step interrupt, which must not come in between: 8 cycles.
#[inline(always)]
pub(super) fn set(pin: Pin, level: bool) {
    avr_device::interrupt::free(|_| if level { high(pin) } else { low(pin) });
}
