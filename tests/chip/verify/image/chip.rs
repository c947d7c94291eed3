//! The chip as a whole: what a boot loader may have left, and the watchdog.

use super::register::Register;
use super::{serial, timers};

const MCUSR: Register = Register::at(0x54);
const WDTCSR: Register = Register::at(0x60);
/// Power reduction.
const PRR: [Register; 2] = [Register::at(0x64), Register::at(0x65)];
const SPCR: Register = Register::at(0x4C);
const TWCR: Register = Register::at(0xBC);
const ADCSRA: Register = Register::at(0x7A);
/// DDRA; PORTA follows, and PINB, and so on up to PORTG.
const FIRST_PORTS: u16 = 0x21;
/// DDRH; PORTH follows, and so on up to PORTL. There is no port I.
const LAST_PORTS: u16 = 0x101;

const CHANGE: u8 = 1 << 4 | 1 << 3;
/// Reset in 250 ms.
const RESETS: u8 = 1 << 3 | 0b100;

/// Puts into its state after a reset what a loader may have left otherwise. The watchdog is first, because after a
/// reset by the watchdog it is on, with 15 ms.
pub fn settle() {
    avr_device::interrupt::disable();
    // While the flag says that the watchdog has reset the chip, the watchdog cannot be switched off.
    MCUSR.put(0);
    set_watchdog(0);
    PRR.iter().for_each(|register| register.put(0));
    [SPCR, TWCR, ADCSRA].iter().for_each(|register| register.put(0));
    serial::stop();
    timers::stop();
    release(FIRST_PORTS, 7);
    release(LAST_PORTS, 4);
}

/// Makes the pins of some ports inputs without pull-ups.
fn release(first: u16, ports: u16) {
    for port in 0..ports {
        Register::at(first + 3 * port).put(0);
        Register::at(first + 3 * port + 1).put(0);
    }
}

/// Writes the control register by the timed sequence of the data sheet (13.5).
#[inline(always)]
fn set_watchdog(value: u8) {
    avr_device::asm::wdr();
    WDTCSR.put(CHANGE);
    WDTCSR.put(value);
}

/// Hangs, with the watchdog on, which resets the chip in 250 ms.
///
/// After such a reset the loader of the Arduino Mega (of 2012, issue 181) calls 0x20000 instead of 0, because it leaves
/// 1 in EIND. If the flash is erased there, the loader is reached again, and the greeting comes a second late. Remains of
/// another program would run. A host that flashes this image over a large one puts a jump to 0 there, too.
pub fn hang() -> ! {
    set_watchdog(RESETS);
    loop {
        avr_device::asm::nop();
    }
}
