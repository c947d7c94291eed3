//! Pins of the board, as constants. On ports A to G a pin is set by a single `sbi` or `cbi` if its level is a
//! constant as well.
//!
//! Otherwise, and on ports H to L, setting a pin is a read-modify-write. Its port must then have no pin that another
//! level writes meanwhile. The functions for enables ensure that themselves.

use crate::boards::outputs::{COUNTERCLOCKWISE, SPINDLE};
use crate::boards::{ACTIVE, Handshake, Pin, SdCard, each_motor};
use crate::hal::byte::SharedByte;
use crate::hal::{Boot, Exclusive};

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

/// Toggles a pin. One store on any port, which disturbs no other pin.
#[inline(always)]
pub fn toggle(pin: Pin) {
    let input = (pin.port.address() - 2) as *mut u8;
    // SAFETY: a one written to an input register toggles the output of that bit alone.
    unsafe { input.write_volatile(1 << pin.bit) };
}

#[inline(always)]
pub(super) fn output(_: Exclusive<'_>, pin: Pin) {
    let direction = (pin.port.address() - 1) as *mut u8;
    // SAFETY: the data direction register lies one below the port register. No handler writes it, and no other code
    // is in interrupt mode, as `Exclusive` shows; thread mode writes it only with that proof, too.
    unsafe { direction.write_volatile(direction.read_volatile() | 1 << pin.bit) };
}

/// Repeats code for each item of a list of the board's, up to eight, with the item as a constant: neither the list
/// nor a loop is left in the image.
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

/// Returns item `i` of a list, `None` beyond its end.
pub(super) const fn item<T: Copy>(list: &[T], i: usize) -> Option<T> {
    if i < list.len() { Some(list[i]) } else { None }
}

/// Makes the board's output pins outputs: steps low, drivers off, hazards off, senders not held back, no bus driven.
/// The level that switches the spindle off is not known yet, so its enable pin is not driven before [`set_low`].
pub fn start(boot: &Boot) {
    let alone = boot.exclusive();
    free_debug_pins();
    each_motor!(M => {
        low(ACTIVE.motors[M].step);
        output(alone, ACTIVE.motors[M].step);
        output(alone, ACTIVE.motors[M].dir);
        if let Some(enable) = ACTIVE.motors[M].enable {
            high(enable);
            output(alone, enable);
        }
    });
    if let Some(enable) = ACTIVE.enable_all {
        high(enable);
        output(alone, enable);
    }
    each!(ACTIVE.hazards, hazard => {
        low(hazard);
        if ACTIVE.outputs[0] != Some(hazard) {
            output(alone, hazard);
        }
    });
    each!(ACTIVE.serial, serial => {
        if let Some(Handshake { rts, cts }) = serial.handshake {
            low(rts);
            output(alone, rts);
            // Pulled up, so that nothing is sent without a cable.
            high(cts);
        }
        if let Some(driver) = serial.driver_enable {
            low(driver);
            output(alone, driver);
        }
    });
    super::heaters::start(boot);
    super::spi::start(boot);
    if let Some(SdCard { select, .. }) = ACTIVE.card {
        high(select);
        output(alone, select);
    }
}

/// Takes the pins F4 to F7 from JTAG, which a fuse may have switched on.
fn free_debug_pins() {
    // SAFETY: start-up, with interrupts off. JTD of MCUCR must be set twice within four cycles (data sheet, 28.3).
    unsafe {
        core::arch::asm!("out 0x35, {jtd}", "out 0x35, {jtd}", jtd = in(reg_upper) 0x80u8, options(nostack));
    }
}

/// The motors whose drivers have been requested, as bits.
static WANTED: SharedByte = SharedByte::new(0);

/// Returns the motors whose drivers are on, as bits.
#[inline(never)] // In a function built for size the board would be a table in RAM.
pub fn powered() -> u8 {
    ACTIVE.powered(WANTED.get())
}

/// Switches the drivers of these motors (bits) on and the others off, as far as the board can: an enable that all
/// drivers share is on as soon as one of them is wanted.
pub fn power(_: Exclusive<'_>, motors: u8) {
    WANTED.set(motors);
    each_motor!(M => if let Some(enable) = ACTIVE.motors[M].enable {
        set(enable, motors & (1 << M) == 0);
    });
    if let Some(enable) = ACTIVE.enable_all {
        set(enable, motors == 0);
    }
}

/// The outputs that are active low, as bits.
static LOW: SharedByte = SharedByte::new(0);

/// Switches the outputs of M3 to M9, bits of [`outputs`](crate::boards::outputs). While the spindle is off, its
/// direction pin keeps its level.
pub fn set_outputs(_: Exclusive<'_>, on: u8) {
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

/// Sets which outputs are active low, and switches to the outputs `on`. The first call also begins to drive the enable
/// of the spindle.
pub fn set_low(alone: Exclusive<'_>, outputs: u8, on: u8) {
    LOW.set(outputs);
    if let Some(direction) = ACTIVE.outputs[1] {
        set(direction, (on ^ outputs) & COUNTERCLOCKWISE != 0);
    }
    set_outputs(alone, on);
    if let Some(enable) = ACTIVE.outputs[0] {
        output(alone, enable);
    }
}

/// Stops the spindle for good.
pub fn stop_spindle(_: Exclusive<'_>) {
    if let Some(enable) = ACTIVE.outputs[0] {
        set(enable, LOW.get() & SPINDLE != 0);
    }
}

/// Sets a pin to a level, with interrupts off for 8 cycles: the compiler makes one read-modify-write of the two
/// cases, and the port may be shared with pins of the step interrupt, which must not come in between.
#[inline(always)]
pub(super) fn set(pin: Pin, level: bool) {
    avr_device::interrupt::free(|_| if level { high(pin) } else { low(pin) });
}
