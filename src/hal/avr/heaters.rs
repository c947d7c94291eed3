//! Heaters and their sensors: the converter, and the pins.
//!
//! A reading is [`SAMPLES`] conversions of one channel, 104 us each, which the converter's interrupt adds up. It has the converter to itself:
//! the next conversion is started when the one before has been added, so that it cannot come again soon, and it lets all other interrupts
//! in. Nothing hangs on its time: exec may come in between.
//!
//! | interrupt | does | cycles |
//! |---|---|---|
//! | ADC | adds a conversion, and starts the next | 60, interrupts off for 12 and 22 |
//!
//! A reading each 20 ms is 0.6 % of the CPU. RAM: 3 bytes.
//!
//! What hangs at an output of timer 2 (D10 and D9) has pulses of that timer, 122 a second, up and down (mode 1): a power of 0 has no pulse,
//! one of 255 no gap. Its interrupts are off.

#[cfg(feature = "printer")]
use core::arch::asm;
use core::cell::UnsafeCell;

use super::{gpio, spi};
use crate::boards::{ACTIVE, Heaters, PULSED, Pin};
use crate::heat::sensor::SAMPLES;

const ADCSRA: *mut u8 = 0x7A as *mut u8;
const ADCSRB: *mut u8 = 0x7B as *mut u8;
const ADMUX: *mut u8 = 0x7C as *mut u8;
/// On, with a clock each 128 cycles; start, with an interrupt at the end.
const START: u8 = 1 << 7 | 1 << 6 | 1 << 3 | 0b111;
/// Against the supply, as the sensors are.
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

/// What the interrupt adds up, and how many conversions are left.
#[repr(C)]
struct Sum {
    sum: u16,
    left: u8,
}

#[repr(transparent)]
struct Place(UnsafeCell<Sum>);

// SAFETY: the interrupt alone touches it while conversions are left, thread mode when none are.
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
    // SAFETY: it restores every register it changes, and returns by `reti`. Nobody else touches the sum while conversions are left; it does
    // not nest, for the next conversion is started with interrupts off.
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

/// Begins a reading of a heater's sensor. One that is under way goes on instead. Thread mode.
#[small]
pub fn begin(heater: u8) {
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

/// The reading that has been begun last, if it is complete. Thread mode.
#[small]
pub fn reading() -> Option<u16> {
    let sum = SUM.0.get();
    // SAFETY: see `Place`.
    unsafe {
        let complete = (&raw const (*sum).left).read_volatile() == 0;
        complete.then(|| (&raw const (*sum).sum).read_volatile())
    }
}

/// What a heater's MAX6675 sends, if the board has one and no card is spoken to: see [`sensor`](crate::heat::sensor). It begins to convert then. Thread mode. Cost: 500 cycles.
#[small]
pub fn word(heater: u8) -> Option<u16> {
    let Heaters { heaters: [hot_end, bed], .. } = ACTIVE.heaters?;
    if !super::card::is_free() {
        return None;
    }
    // Each with its pin as a constant.
    match heater {
        0 => hot_end.select.map(ask),
        _ => bed.select.map(ask),
    }
}

#[inline(always)]
fn ask(select: Pin) -> u16 {
    exchange(select.port.address() as u16, 1 << select.bit)
}

/// Reads two bytes while one bit of a port is low.
#[inline(never)]
#[small]
fn exchange(port: u16, bit: u8) -> u16 {
    let port = usize::from(port) as *mut u8;
    spi::set_clock(spi::Clock::Mhz1);
    // SAFETY: the output port of a pin of the board; other levels write it with interrupts off or by single instructions.
    avr_device::interrupt::free(|_| unsafe { port.write_volatile(port.read_volatile() & !bit) });
    let word = u16::from_be_bytes([spi::exchange(0), spi::exchange(0)]);
    // SAFETY: as above.
    avr_device::interrupt::free(|_| unsafe { port.write_volatile(port.read_volatile() | bit) });
    word
}

/// Makes outputs of what selects sensors, and has timer 2 run. Start-up.
pub fn start() {
    let Some(Heaters { heaters: [hot_end, bed], .. }) = ACTIVE.heaters else { return };
    for select in [hot_end.select, bed.select].into_iter().flatten() {
        gpio::high(select);
        gpio::output(select);
    }
    if HAS_PULSES {
        // SAFETY: the registers of the timer are this module's.
        unsafe {
            TCCR2A.write_volatile(UP_AND_DOWN);
            TCCR2B.write_volatile(PACE);
        }
    }
}

/// Gives the hot end, the bed and the fan their power, 255 for all: pulses where [`PULSED`] says so, elsewhere on or, with 0, off. Thread mode.
pub fn drive(power: [u8; 3]) {
    let Some(heaters) = ACTIVE.heaters else { return };
    let [hot_end, bed] = heaters.heaters;
    let [of_hot_end, of_bed, of_fan] = power;
    drive_pin(hot_end.pin, of_hot_end);
    drive_pin(bed.pin, of_bed);
    drive_pin(heaters.fan, of_fan);
}

/// The timer drives its pin while it is connected to it. The port's bit stays low, so that the pin is low whenever it is not.
#[inline(always)]
fn drive_pin(pin: Pin, power: u8) {
    let Some(channel) = pin.channel().filter(|_| HAS_PULSES) else {
        return gpio::set(pin, power != 0);
    };
    let connected = 1 << (7 - 2 * channel);
    // SAFETY: the registers of the timer are this module's; what stops it for good, with interrupts off, does not come back.
    unsafe {
        OCR2[usize::from(channel)].write_volatile(power);
        let others = TCCR2A.read_volatile() & !connected;
        TCCR2A.write_volatile(if power == 0 { others } else { others | connected });
    }
}

/// Disconnects the pins of heaters, which are low from then on. For the panic handler.
#[small]
pub fn kill() {
    if HAS_PULSES {
        // SAFETY: a single store; the machine stops for good.
        unsafe { TCCR2A.write_volatile(0) };
    }
}
