//! Heaters and their sensors: the analog-to-digital converter, and the pins.
//!
//! A reading is the sum of [`SAMPLES`] conversions of one channel, 104 us each, which the converter's interrupt adds
//! up. A conversion is started only after the one before has been added, so the interrupt cannot come again soon, and
//! it lets all other interrupts in. It is not time-critical, so exec may interrupt it.
//!
//! | interrupt | does | cycles |
//! |---|---|---|
//! | ADC | adds a conversion, and starts the next | 60, interrupts off for 12 and 22 |
//!
//! A reading each 20 ms is 0.6 % of the CPU. RAM: 3 bytes.
//!
//! A pin at an output of timer 2 (D10 and D9) gets pulses from that timer, 122 a second, which counts up and down
//! (mode 1). With power 0 there is no pulse, with 255 no gap. The interrupts of the timer are off.

#[cfg(feature = "printer")]
use core::arch::asm;
use core::cell::UnsafeCell;

use super::{gpio, spi};
use crate::boards::{ACTIVE, Heaters, PULSED, Pin};
use crate::hal::{Boot, Thread};
use crate::heat::sensor::SAMPLES;

const ADCSRA: *mut u8 = 0x7A as *mut u8;
const ADCSRB: *mut u8 = 0x7B as *mut u8;
const ADMUX: *mut u8 = 0x7C as *mut u8;
/// Switched on, a clock each 128 cycles; starts a conversion, with an interrupt at its end.
const START: u8 = 1 << 7 | 1 << 6 | 1 << 3 | 0b111;
/// Reference is the supply, as for the sensors.
const SUPPLY: u8 = 1 << 6;

const TCCR2A: *mut u8 = 0xB0 as *mut u8;
const TCCR2B: *mut u8 = 0xB1 as *mut u8;
const OCR2: [*mut u8; 2] = [0xB3 as *mut u8, 0xB4 as *mut u8];
/// Mode 1: up to 255 and down again.
const UP_AND_DOWN: u8 = 1;
/// A count each 256 cycles.
const PACE: u8 = 0b110;
/// Whether timer 2 drives anything.
const HAS_PULSES: bool = cfg!(feature = "printer") && (PULSED[0] || PULSED[1] || PULSED[2]);

/// The sum that the interrupt adds up, and the number of conversions that are left.
#[repr(C)]
struct Sum {
    sum: u16,
    left: u8,
}

#[repr(transparent)]
struct Place(UnsafeCell<Sum>);

// SAFETY: the interrupt alone touches it while conversions are left. When none are, functions with a `Thread` do.
unsafe impl Sync for Place {}

static SUM: Place = Place(UnsafeCell::new(Sum { sum: 0, left: 0 }));

#[cfg(feature = "printer")]
const _: () = assert!(
    ACTIVE.heaters.is_some(),
    "this board has no heaters: leave `printer` out of its features"
);

#[cfg(feature = "printer")]
#[unsafe(no_mangle)]
extern "C" fn __vector_29() -> ! {
    // SAFETY: it restores every register it changes, and returns by `reti`. Nobody else touches the sum while
    // conversions are left. It does not nest, because the next conversion is started with interrupts off.
    unsafe {
        asm!(
            "push r24",
            "in   r24, 0x3F",
            "push r24",
            "sei",
            "push r25",
            "push r30",
            "lds  r24, 0x78",
            "lds  r25, 0x79",
            "lds  r30, {sum}",
            "add  r24, r30",
            "lds  r30, {sum} + 1",
            "adc  r25, r30",
            "sts  {sum}, r24",
            "sts  {sum} + 1, r25",
            "lds  r30, {sum} + 2",
            "subi r30, 1",
            "ldi  r25, {start}",
            "cli",
            "sts  {sum} + 2, r30",
            "breq 1f",
            "sts  0x7A, r25",
            "1:",
            "pop  r30",
            "pop  r25",
            "pop  r24",
            "out  0x3F, r24",
            "pop  r24",
            "reti",
            sum = sym SUM,
            start = const START,
            options(noreturn),
        )
    }
}

/// Begins a reading of a heater's sensor, unless a reading is already under way.
#[small]
pub fn begin(_: Thread, heater: u8) {
    let Some(Heaters { heaters: [hot_end, bed], .. }) = ACTIVE.heaters else { return };
    let sum = SUM.0.get();
    // SAFETY: see `Place`; the registers of the converter are this module's.
    unsafe {
        if (&raw const (*sum).left).read_volatile() != 0 {
            return;
        }
        let channel = if heater == 0 { hot_end.channel } else { bed.channel };
        ADMUX.write_volatile(SUPPLY | channel & 7);
        ADCSRB.write_volatile(channel & 8);
        (&raw mut (*sum).sum).write_volatile(0);
        (&raw mut (*sum).left).write_volatile(SAMPLES as u8);
        ADCSRA.write_volatile(START);
    }
}

/// Returns the reading that was begun last; `None` until it is complete.
#[small]
pub fn reading(_: Thread) -> Option<u16> {
    let sum = SUM.0.get();
    // SAFETY: see `Place`.
    unsafe {
        let complete = (&raw const (*sum).left).read_volatile() == 0;
        complete.then(|| (&raw const (*sum).sum).read_volatile())
    }
}

/// Reads the word of a heater's MAX6675, which then begins a conversion: see [`sensor`](crate::heat::sensor). `None` if
/// the board has none, or while the SD card is selected. Cost: 500 cycles.
#[small]
pub fn word(thread: Thread, heater: u8) -> Option<u16> {
    let Heaters { heaters: [hot_end, bed], .. } = ACTIVE.heaters?;
    if !super::card::is_free() {
        return None;
    }
    // Each call has its pin as a constant.
    match heater {
        0 => hot_end.select.map(|select| ask(thread, select)),
        _ => bed.select.map(|select| ask(thread, select)),
    }
}

#[inline(always)]
fn ask(thread: Thread, select: Pin) -> u16 {
    exchange(thread, select.port.address() as u16, 1 << select.bit)
}

/// Exchanges two bytes over SPI while one bit of a port is low, and returns those received.
#[inline(never)]
#[small]
fn exchange(thread: Thread, port: u16, bit: u8) -> u16 {
    let port = usize::from(port) as *mut u8;
    spi::set_clock(thread, spi::Clock::Mhz1);
    // SAFETY: this is the output port of a pin of the board. Other levels write it with interrupts off or by single
    // instructions.
    avr_device::interrupt::free(|_| unsafe { port.write_volatile(port.read_volatile() & !bit) });
    let word = u16::from_be_bytes([spi::exchange(thread, 0), spi::exchange(thread, 0)]);
    // SAFETY: as above.
    avr_device::interrupt::free(|_| unsafe { port.write_volatile(port.read_volatile() | bit) });
    word
}

/// Makes the select pins of sensors outputs, and starts timer 2.
pub fn start(boot: &Boot) {
    let Some(Heaters { heaters: [hot_end, bed], .. }) = ACTIVE.heaters else { return };
    for select in [hot_end.select, bed.select].into_iter().flatten() {
        gpio::high(select);
        gpio::output(boot.exclusive(), select);
    }
    if HAS_PULSES {
        // SAFETY: the registers of the timer are this module's.
        unsafe {
            TCCR2A.write_volatile(UP_AND_DOWN);
            TCCR2B.write_volatile(PACE);
        }
    }
}

/// Sets the power of the hot end, the bed and the fan; 255 is full power. Outputs that [`PULSED`] names have pulses;
/// the others are off at 0, else on.
pub fn drive(_: Thread, power: [u8; 3]) {
    let Some(heaters) = ACTIVE.heaters else { return };
    let [hot_end, bed] = heaters.heaters;
    let [of_hot_end, of_bed, of_fan] = power;
    drive_pin(hot_end.pin, of_hot_end);
    drive_pin(bed.pin, of_bed);
    drive_pin(heaters.fan, of_fan);
}

/// Does nothing: no board with this chip has a fan for the heatbreak.
pub fn cool(_: Thread, _: bool) {}

/// Sets the power of a pin. The timer drives the pin while it is connected to it. The port's bit stays low, so the
/// pin is low while it is not connected.
#[inline(always)]
fn drive_pin(pin: Pin, power: u8) {
    let Some(channel) = pin.channel().filter(|_| HAS_PULSES) else {
        return gpio::set(pin, power != 0);
    };
    let connected = 1 << (7 - 2 * channel);
    // SAFETY: the registers of the timer are this module's; code that stops the timer for good, with interrupts off,
    // does not come back.
    unsafe {
        OCR2[usize::from(channel)].write_volatile(power);
        let others = TCCR2A.read_volatile() & !connected;
        TCCR2A.write_volatile(if power == 0 { others } else { others | connected });
    }
}

/// Disconnects the pins of heaters from the timer; they are low from then on. For the panic handler.
#[small]
pub fn kill() {
    if HAS_PULSES {
        // SAFETY: a single store; the machine stops for good.
        unsafe { TCCR2A.write_volatile(0) };
    }
}
