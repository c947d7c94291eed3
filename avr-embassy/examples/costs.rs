//! Measures the costs of the runtime with timer 1, in cycles: the numbers of the README.
//!
//! The numbers are in `COSTS` when `FINISHED` is 1, in the order of the constants below.
#![no_std]
#![no_main]
#![feature(abi_avr_interrupt)]
#![allow(missing_docs)] // of what `avr_device::interrupt` makes

mod chip;

use core::hint::black_box;
use core::sync::atomic::{AtomicU8, AtomicU16, Ordering::Relaxed};

use avr_embassy::ring::Ring;
use avr_embassy::{Event, Executor, Interrupt, Thread, interrupt, time};
use chip::{Peripherals, TC1};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use static_cell::StaticCell;

const SET: usize = 0;
const LOCK: usize = 1;
const PUSH: usize = 2;
const POP: usize = 3;
const MILLIS: usize = 4;
const PEND: usize = 5;
const PEND_AND_BACK: usize = 6;
const SIGNAL: usize = 7;
const EVENT: usize = 8;
const EVENT_ASLEEP: usize = 9;

#[unsafe(no_mangle)]
static COSTS: [AtomicU16; 10] = [const { AtomicU16::new(0) }; 10];
#[unsafe(no_mangle)]
static FINISHED: AtomicU8 = AtomicU8::new(0);

const CALLED: Event = Event::new::<0>();
const ANSWERED: Event = Event::new::<1>();
static CALL: Signal<CriticalSectionRawMutex, ()> = Signal::new();
/// The time at which the called task had its turn.
static ANSWERED_AT: AtomicU16 = AtomicU16::new(0);
static BYTES: Ring<u8, 64> = Ring::new();

fn timer() -> TC1 {
    // SAFETY: the timer's count is read from everywhere; its registers are written only where nothing else runs.
    unsafe { Peripherals::steal().TC1 }
}

#[inline(always)]
fn now() -> u16 {
    timer().tcnt1().read().bits()
}

#[cfg_attr(feature = "atmega1284p", avr_device::interrupt(atmega1284p))]
#[cfg_attr(feature = "atmega2560", avr_device::interrupt(atmega2560))]
fn TIMER1_COMPB() {
    timer().timsk1().write(|w| w.ocie1b().clear_bit());
    CALLED.set();
}

#[embassy_executor::task]
async fn pended(level: Interrupt) {
    loop {
        let mut asked = false;
        interrupt::wait(level, || core::mem::replace(&mut asked, true).then_some(())).await;
        ANSWERED_AT.store(now(), Relaxed);
    }
}

#[embassy_executor::task]
async fn signalled() {
    loop {
        CALL.wait().await;
        ANSWERED_AT.store(now(), Relaxed);
    }
}

#[embassy_executor::task]
async fn called(thread: Thread) {
    loop {
        CALLED.next(thread).await;
        ANSWERED_AT.store(now(), Relaxed);
        ANSWERED.set();
    }
}

/// Returns the cycles that `act` takes.
#[inline(always)]
fn cycles(act: impl FnOnce()) -> u16 {
    let began = now();
    act();
    now().wrapping_sub(began)
}

#[embassy_executor::task]
async fn measure(thread: Thread) {
    embassy_futures::yield_now().await;
    let overhead = cycles(|| ());
    let note = |what: usize, cycles: u16| COSTS[what].store(cycles.wrapping_sub(overhead), Relaxed);
    let answered = |began: u16| ANSWERED_AT.load(Relaxed).wrapping_sub(began);

    note(SET, cycles(|| ANSWERED.set()));
    note(LOCK, cycles(|| interrupt::lock(thread, |_| ())));
    note(MILLIS, cycles(|| _ = black_box(time::millis())));
    if let Some((mut producer, mut consumer)) = BYTES.split() {
        note(PUSH, cycles(|| _ = producer.push(black_box(1))));
        note(POP, cycles(|| _ = black_box(consumer.pop())));
    }

    let began = now();
    interrupt::pend();
    let back = now();
    note(PEND, answered(began));
    note(PEND_AND_BACK, back.wrapping_sub(began));

    let began = now();
    CALL.signal(());
    note(SIGNAL, answered(began));

    ANSWERED.next(thread).await;
    let began = now();
    CALLED.set();
    ANSWERED.next(thread).await;
    note(EVENT, answered(began));

    let due = now().wrapping_add(2_000);
    timer().ocr1b().write(|w| w.set(due));
    timer().tifr1().write(|w| w.ocf1b().set_bit());
    timer().timsk1().write(|w| w.ocie1b().set_bit());
    ANSWERED.next(thread).await;
    note(EVENT_ASLEEP, answered(due));
    FINISHED.store(1, Relaxed);
}

#[avr_device::entry]
fn main() -> ! {
    static EXECUTOR: StaticCell<Executor> = StaticCell::new();
    timer().tccr1b().write(|w| w.cs1().direct());
    interrupt::start(|spawner, level| {
        if let (Ok(pended), Ok(signalled)) = (pended(level), signalled()) {
            spawner.spawn(pended);
            spawner.spawn(signalled);
        }
    });
    EXECUTOR.init(Executor::new()).run(|spawner, thread| {
        if let (Ok(called), Ok(measure)) = (called(thread), measure(thread)) {
            spawner.spawn(called);
            spawner.spawn(measure);
        }
    })
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}
