//! Pins of the board: outputs that are not steps, and the connection of pins to units of the chip.
//!
//! Setting a pin is one store that disturbs no other pin. Pins behind a shift register are set by [`register`].

use embassy_rp::pac::io::vals::{Inover, Outover};
use embassy_rp::pac::pads::vals::Drive;
use embassy_rp::pac::{IO_BANK0, PADS_BANK0, SIO};

use super::register;
use crate::boards::outputs::{COUNTERCLOCKWISE, SPINDLE};
use crate::boards::{ACTIVE, Pin, Port};
use crate::hal::byte::SharedByte;
use crate::hal::{Boot, Exclusive};

/// The unit that a pin is connected to (RP2040 data sheet, 2.19.2).
#[derive(Clone, Copy)]
#[repr(u8)]
pub(super) enum Unit {
    Spi = 1,
    Uart = 2,
    Pwm = 4,
    Cpu = 5,
    Pio0 = 6,
    Pio1 = 7,
}

/// The pin of the first channel of the analog-to-digital converter.
const FIRST_SENSED: u8 = 26;
/// Connects a pin to no unit.
const NOBODY: u8 = 0x1F;

/// Connects a pin to a unit. Nobody else may connect this pin at the same time.
pub(super) fn connect(pin: Pin, unit: Unit) {
    PADS_BANK0.gpio(pin.bit.into()).modify(|w| {
        w.set_ie(true);
        w.set_od(false);
        w.set_pue(false);
        w.set_pde(false);
    });
    IO_BANK0.gpio(pin.bit.into()).ctrl().write(|w| {
        w.set_funcsel(unit as u8);
        w.set_inover(Inover::NORMAL);
        w.set_outover(if is_inverted(pin) { Outover::INVERT } else { Outover::NORMAL });
    });
}

/// Whether the board inverts what a pin drives.
fn is_inverted(pin: Pin) -> bool {
    ACTIVE.pwm.is_some_and(|pwm| pwm.inverted && pwm.pin().is(pin))
}

/// Whether a pin is an output of a shift register.
pub(super) const fn is_behind(pin: Pin) -> bool {
    matches!(pin.port, Port::Outputs)
}

/// Connects an output to a unit. It may drive 12 mA, because the LED of an opto-coupler takes 8 to 12; after a reset a
/// pin drives 4.
pub(super) fn connect_output(pin: Pin, unit: Unit) {
    connect(pin, unit);
    PADS_BANK0.gpio(pin.bit.into()).modify(|w| w.set_drive(Drive::_12M_A));
}

/// Makes a pin an input with a pull-up.
pub(super) fn pull_up(pin: Pin) {
    connect_pulled(pin, Unit::Cpu);
}

/// Connects an input to a unit, with a pull-up.
pub(super) fn connect_pulled(pin: Pin, unit: Unit) {
    connect(pin, unit);
    PADS_BANK0.gpio(pin.bit.into()).modify(|w| w.set_pue(true));
}

/// Connects the pin of an analog channel to the converter.
pub(super) fn sense(_: &Boot, channel: u8) {
    let pin = usize::from(FIRST_SENSED + channel);
    IO_BANK0.gpio(pin).ctrl().write(|w| w.set_funcsel(NOBODY));
    PADS_BANK0.gpio(pin).write(|w| w.set_od(true));
}

/// Sets whether the output of a unit is inverted at a pin.
pub(super) fn invert(pin: Pin, inverted: bool) {
    IO_BANK0.gpio(pin.bit.into()).ctrl().modify(|w| {
        w.set_outover(if inverted { Outover::INVERT } else { Outover::NORMAL });
    });
}

/// Returns the levels of all pins.
pub(super) fn levels() -> u32 {
    SIO.gpio_in(0).read()
}

/// Drives an output high or low, which may be behind a shift register.
pub(super) fn switch(alone: Exclusive<'_>, output: Pin, high: bool) {
    if is_behind(output) {
        return register::set(alone, output.bit, high);
    }
    set(output, high);
}

/// Drives a pin of the chip, which is not behind a register, high or low by one write. Any level.
pub(super) fn set(pin: Pin, high: bool) {
    let out = SIO.gpio_out(0);
    let one = if high { out.value_set() } else { out.value_clr() };
    one.write_value(1 << pin.bit);
}

/// Makes a pin an output.
pub(super) fn output(pin: Pin) {
    if !is_behind(pin) {
        connect_output(pin, Unit::Cpu);
        drive(pin);
    }
}

fn drive(pin: Pin) {
    if is_behind(pin) {
        return;
    }
    SIO.gpio_oe(0).value_set().write_value(1 << pin.bit);
}

/// Makes the board's output pins outputs: drivers off, hazards off. The level that switches the spindle off is not
/// known yet, so its enable pin is not driven before [`set_low`]; its pull-down stays on, as it is from the reset on, so
/// that the pin does not float. An enable behind a register is low until then.
pub(super) fn start(boot: &Boot) {
    register::start(boot);
    let alone = boot.exclusive();
    let enables = ACTIVE.motors.iter().filter_map(|motor| motor.enable);
    enables.chain(ACTIVE.enable_all).for_each(|enable| {
        switch(alone, enable, true);
        output(enable);
    });
    for hazard in ACTIVE.hazards {
        switch(alone, *hazard, false);
        if ACTIVE.outputs[0] == Some(*hazard) && !is_behind(*hazard) {
            connect_output(*hazard, Unit::Cpu);
            PADS_BANK0.gpio(hazard.bit.into()).modify(|w| w.set_pde(true));
        } else {
            output(*hazard);
        }
    }
}

/// The motors whose drivers have been requested, as bits.
static WANTED: SharedByte = SharedByte::new(0);

/// Returns the motors whose drivers are on, as bits.
pub fn powered() -> u8 {
    ACTIVE.powered(WANTED.get())
}

/// Switches the drivers of these motors (bits) on and the others off, as far as the board can: an enable that all
/// drivers share is on as soon as one of them is wanted.
pub fn power(alone: Exclusive<'_>, motors: u8) {
    WANTED.set(motors);
    for (m, motor) in ACTIVE.motors.iter().enumerate() {
        if let Some(enable) = motor.enable {
            switch(alone, enable, motors & 1 << m == 0);
        }
    }
    if let Some(enable) = ACTIVE.enable_all {
        switch(alone, enable, motors == 0);
    }
}

/// The outputs that are active low, as bits.
static LOW: SharedByte = SharedByte::new(0);

/// Switches the outputs of M3 to M9, bits of [`outputs`](crate::boards::outputs). While the spindle is off, its
/// direction pin keeps its level.
pub fn set_outputs(alone: Exclusive<'_>, on: u8) {
    let high = on ^ LOW.get();
    // The direction is set before the enable.
    for o in [1, 0, 2, 3] {
        if let Some(pin) = ACTIVE.outputs[o]
            && (1 << o != COUNTERCLOCKWISE || on & SPINDLE != 0)
        {
            switch(alone, pin, high & (1 << o) != 0);
        }
    }
}

/// Sets which outputs are active low, and switches to the outputs `on`. The first call also begins to drive the enable
/// of the spindle.
pub fn set_low(alone: Exclusive<'_>, outputs: u8, on: u8) {
    LOW.set(outputs);
    if let Some(direction) = ACTIVE.outputs[1] {
        switch(alone, direction, (on ^ outputs) & COUNTERCLOCKWISE != 0);
    }
    set_outputs(alone, on);
    if let Some(enable) = ACTIVE.outputs[0] {
        drive(enable);
    }
}

/// Stops the spindle for good.
pub(super) fn stop_spindle(alone: Exclusive<'_>) {
    if let Some(enable) = ACTIVE.outputs[0] {
        switch(alone, enable, LOW.get() & SPINDLE != 0);
    }
}
