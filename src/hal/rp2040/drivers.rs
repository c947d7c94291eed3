//! TMC2209 drivers on one line of UART1. Their settings are sent again and again, because a driver forgets them when
//! the motors' supply fails. Between them each driver is asked what it has taken, and how it is ([`watch`]).
//!
//! Thread mode calls it each millisecond. Each [`EVERY_MS`] it takes a step of a driver's [`ROUND`]: a datagram of 8
//! bytes, or a request of 4 bytes, whose answer it looks for [`ANSWER_MS`] later. While a register has a new value it
//! takes a step each millisecond in which the line is free. Nothing waits: all bytes of a step find room in the UART's
//! FIFOs. After the start the first [`FIRST_STEPS`] follow each other as closely. A late call delays the next step. An
//! answer that is damaged, or does not come, counts as missed. Cost: 2,000 cycles a step.
//!
//! `embassy-rp`'s `BufferedUart` is not used: it takes an interrupt each 32 bytes and two rings for what fits the UART's
//! FIFOs, and its pins are types.

use core::cell::Cell;
use core::sync::atomic::{AtomicU32, Ordering};

use embassy_rp::pac::UART1;

use super::gpio::{Unit, connect, connect_pulled};
use crate::boards::{ACTIVE, MOTORS};
use crate::drivers::watch::{Asked, ROUND, Step, Watch};
use crate::drivers::{DATAGRAM, FIRST, REGISTERS, REQUEST, answer, clearing, datagram, request};
use crate::hal::{Boot, Thread};

/// Bits a second. The drivers detect the rate.
const RATE: u32 = 115_200;
/// Milliseconds from one step to the next while no value is new.
const EVERY_MS: u32 = 4;
/// The steps in which each driver has been given its settings, and has been asked whether it has taken them.
const FIRST_STEPS: u32 = (MOTORS * ROUND.len()) as u32;
/// Milliseconds from a request to its answer: twelve bytes and the driver's pause take 1.3 ms.
const ANSWER_MS: u32 = 3;
/// Bytes from the beginning of a request to the end of its answer.
const EXCHANGE: usize = REQUEST + DATAGRAM;

/// The values of the registers, motor 1 first. Only thread mode uses them.
static VALUES: [AtomicU32; MOTORS * REGISTERS] = first();
/// The values that are new, as bits.
static NEW: AtomicU32 = AtomicU32::new(0);
const _: () = assert!(ACTIVE.drivers.is_none() || MOTORS * REGISTERS <= 32);
/// The drivers whose GSTAT has to be cleared, as bits.
static CLEAR: AtomicU32 = AtomicU32::new(0);
/// The steps that have been taken.
static STEPS: AtomicU32 = AtomicU32::new(0);

/// A request that has been sent: the motor, the register, and when.
#[derive(Clone, Copy)]
struct Sent {
    motor: usize,
    asked: Asked,
    at_ms: u32,
}

/// What is known of the drivers, and the request whose answer is awaited.
struct Known {
    watches: [Cell<Watch>; MOTORS],
    sent: Cell<Option<Sent>>,
}

// SAFETY: only functions with a `Thread` use it, and thread mode never interrupts itself.
unsafe impl Sync for Known {}

static KNOWN: Known =
    Known { watches: [const { Cell::new(Watch::NEW) }; MOTORS], sent: Cell::new(None) };

const fn first() -> [AtomicU32; MOTORS * REGISTERS] {
    let mut values = [const { AtomicU32::new(0) }; MOTORS * REGISTERS];
    let mut at = 0;
    while at < values.len() {
        values[at] = AtomicU32::new(FIRST[at % REGISTERS]);
        at += 1;
    }
    values
}

/// Connects the UART.
pub(super) fn start(_: &Boot) {
    let Some(drivers) = ACTIVE.drivers else { return };
    connect(drivers.tx, Unit::Uart);
    connect_pulled(drivers.rx, Unit::Uart);
    let divisor = embassy_rp::clocks::clk_peri_freq() * 4 / RATE;
    UART1.uartibrd().write(|w| w.set_baud_divint((divisor >> 6) as u16));
    UART1.uartfbrd().write(|w| w.set_baud_divfrac((divisor & 0x3F) as u8));
    UART1.uartlcr_h().write(|w| {
        w.set_wlen(3);
        w.set_fen(true);
    });
    UART1.uartcr().write(|w| {
        w.set_uarten(true);
        w.set_txe(true);
        w.set_rxe(true);
    });
}

/// Sets the values of the registers of a motor's driver.
pub fn tell(_: Thread, motor: u8, values: &[u32; REGISTERS]) {
    let first = usize::from(motor) * REGISTERS;
    for (at, value) in (first..).zip(values) {
        let Some(told) = VALUES.get(at) else { return };
        if told.load(Ordering::Relaxed) != *value {
            told.store(*value, Ordering::Relaxed);
            set_bits(&NEW, 1 << at);
        }
    }
}

/// Returns what is known of a motor's driver.
pub fn watch(_: Thread, motor: u8) -> Watch {
    KNOWN.watches.get(usize::from(motor)).map_or(Watch::NEW, Cell::get)
}

/// Takes the worst of the news of a motor's driver since the last call.
pub fn take_news(_: Thread, motor: u8) -> u8 {
    change(motor.into(), Watch::take_news).unwrap_or(0)
}

/// Takes a step, if it is time for one. Called each millisecond.
pub(super) fn look(_: Thread, now_ms: u32) {
    let Some(drivers) = ACTIVE.drivers else { return };
    if let Some(sent) = KNOWN.sent.get() {
        if now_ms.wrapping_sub(sent.at_ms) < ANSWER_MS {
            return;
        }
        KNOWN.sent.set(None);
        take_answer(&sent);
    }
    let new = NEW.load(Ordering::Relaxed);
    let clear = CLEAR.load(Ordering::Relaxed);
    let is_time = now_ms.is_multiple_of(EVERY_MS) || STEPS.load(Ordering::Relaxed) < FIRST_STEPS;
    if new | clear == 0 && !is_time || UART1.uartfr().read().busy() {
        return;
    }
    forget_heard();
    if clear != 0 {
        clear_global(drivers.addresses, clear.trailing_zeros() as usize);
    } else if new != 0 {
        write_register(drivers.addresses, new.trailing_zeros() as usize);
    } else {
        let step = STEPS.load(Ordering::Relaxed);
        STEPS.store(step.wrapping_add(1), Ordering::Relaxed);
        let motor = step as usize / ROUND.len() % drivers.addresses.len();
        match ROUND[step as usize % ROUND.len()] {
            Step::Write(register) => {
                write_register(drivers.addresses, motor * REGISTERS + usize::from(register));
            }
            Step::Ask(asked) => ask(drivers.addresses, Sent { motor, asked, at_ms: now_ms }),
        }
    }
}

fn set_bits(word: &AtomicU32, bits: u32) {
    word.store(word.load(Ordering::Relaxed) | bits, Ordering::Relaxed);
}

fn clear_bits(word: &AtomicU32, bits: u32) {
    word.store(word.load(Ordering::Relaxed) & !bits, Ordering::Relaxed);
}

fn change<R>(motor: usize, what: impl FnOnce(&mut Watch) -> R) -> Option<R> {
    let place = KNOWN.watches.get(motor)?;
    let mut watch = place.get();
    let result = what(&mut watch);
    place.set(watch);
    Some(result)
}

fn send(bytes: &[u8]) {
    bytes.iter().for_each(|byte| UART1.uartdr().write(|w| w.set_data(*byte)));
}

/// Writes a register: `at` is its number, counted from the first register of motor 1.
fn write_register(addresses: &[u8], at: usize) {
    clear_bits(&NEW, 1 << at);
    let motor = at / REGISTERS;
    let (Some(address), Some(value)) = (addresses.get(motor), VALUES.get(at)) else { return };
    send(&datagram(*address, at % REGISTERS, value.load(Ordering::Relaxed)));
    change(motor, Watch::wrote);
}

fn clear_global(addresses: &[u8], motor: usize) {
    clear_bits(&CLEAR, 1 << motor);
    let Some(address) = addresses.get(motor) else { return };
    send(&clearing(*address));
    change(motor, Watch::wrote);
}

fn ask(addresses: &[u8], sent: Sent) {
    let Some(address) = addresses.get(sent.motor) else { return };
    send(&request(*address, sent.asked));
    KNOWN.sent.set(Some(sent));
}

/// Takes a byte from the FIFO. One with an error spoils the checksum or is as it was sent.
fn take_byte() -> Option<u8> {
    let is_empty = UART1.uartfr().read().rxfe();
    (!is_empty).then(|| UART1.uartdr().read().data())
}

/// Forgets what has been heard: the FIFO has 32 bytes, all of Kerf's own but a late answer.
fn forget_heard() {
    for _ in 0..4 * DATAGRAM {
        if take_byte().is_none() {
            return;
        }
    }
}

fn take_answer(sent: &Sent) {
    let mut heard = [0; EXCHANGE];
    let mut count = 0;
    while let (Some(place), Some(byte)) = (heard.get_mut(count), take_byte()) {
        *place = byte;
        count += 1;
    }
    let value = answer(heard.get(..count).unwrap_or(&[]), sent.asked);
    if change(sent.motor, |watch| watch.answer(sent.asked, value)) == Some(true) {
        set_bits(&CLEAR, 1 << sent.motor);
        let all = (1 << REGISTERS) - 1;
        set_bits(&NEW, all << (sent.motor * REGISTERS));
    }
}
