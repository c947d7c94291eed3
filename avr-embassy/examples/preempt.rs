//! A task of interrupt mode that preempts a task of thread mode.
//!
//! `work` computes without a pause, 20 ms a poll, and toggles pin 12 (PB6) after each poll. Meanwhile `pulse` toggles
//! the LED (pin 13, PB7) each millisecond: a handler of timer 1 pends it. Every hundredth time it signals `tell`, a
//! task of thread mode, which toggles pin 11 (PB5).
#![no_std]
#![no_main]
#![feature(abi_avr_interrupt)]
#![allow(missing_docs)] // of what `avr_device::interrupt` makes

mod chip;

use avr_embassy::{Executor, Interrupt, interrupt};
use chip::Peripherals;
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use static_cell::StaticCell;

static HUNDRED: Signal<CriticalSectionRawMutex, ()> = Signal::new();

fn peripherals() -> Peripherals {
    // SAFETY: a 1 written to PINB toggles that pin; `main` alone writes other registers.
    unsafe { Peripherals::steal() }
}

fn turn_over(pin: u8) {
    // SAFETY: all values are valid.
    unsafe { peripherals().PORTB.pinb().write(|w| w.bits(1 << pin)) };
}

#[cfg_attr(feature = "atmega1284p", avr_device::interrupt(atmega1284p))]
#[cfg_attr(feature = "atmega2560", avr_device::interrupt(atmega2560))]
fn TIMER1_COMPA() {
    interrupt::pend();
}

#[embassy_executor::task]
async fn pulse(level: Interrupt) {
    loop {
        for _ in 0..100 {
            let mut is_due = false;
            interrupt::wait(level, || core::mem::replace(&mut is_due, true).then_some(())).await;
            turn_over(7);
        }
        HUNDRED.signal(());
    }
}

#[embassy_executor::task]
async fn work() {
    loop {
        avr_device::asm::delay_cycles(320_000);
        turn_over(6);
        yield_now().await;
    }
}

#[embassy_executor::task]
async fn tell() {
    loop {
        HUNDRED.wait().await;
        turn_over(5);
    }
}

#[avr_device::entry]
fn main() -> ! {
    static EXECUTOR: StaticCell<Executor> = StaticCell::new();
    let Peripherals { PORTB: port, TC1: timer, .. } = peripherals();
    port.ddrb().write(|w| w.pb7().set_bit().pb6().set_bit().pb5().set_bit());
    interrupt::start(|spawner, level| {
        if let Ok(task) = pulse(level) {
            spawner.spawn(task);
        }
    });
    // CTC mode, clock not divided, 16,000 cycles a millisecond.
    timer.ocr1a().write(|w| w.set(15_999));
    timer.tccr1b().write(|w| w.wgm1().set(1).cs1().direct());
    timer.timsk1().write(|w| w.ocie1a().set_bit());
    EXECUTOR.init(Executor::new()).run(|spawner, _| {
        if let (Ok(work), Ok(tell)) = (work(), tell()) {
            spawner.spawn(work);
            spawner.spawn(tell);
        }
    })
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}
