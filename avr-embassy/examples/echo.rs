//! Sends back what comes over USART0, the serial port of an Arduino Mega 2560, at 115,200 baud, 8 bits, no parity.
//!
//! Handlers move bytes and set events, which wake the task. Up to 63 bytes can wait; a byte that comes when 63 wait
//! is lost, and PB7 (the LED on pin 13) shows it.
#![no_std]
#![no_main]
#![feature(abi_avr_interrupt)]
#![allow(missing_docs)] // of what `avr_device::interrupt` makes

mod chip;

use avr_embassy::ring::{Consumer, Producer, Ring};
use avr_embassy::{Event, Executor, Thread};
use chip::{Peripherals, USART0};
use static_cell::StaticCell;

static BYTES: Ring<u8, 64> = Ring::new();
const RECEIVED: Event = Event::new::<0>();
const SENT: Event = Event::new::<1>();

fn peripherals() -> Peripherals {
    // SAFETY: handlers alone read UDR0 and clear UDRIE0; the task does the rest.
    unsafe { Peripherals::steal() }
}

#[cfg_attr(feature = "atmega1284p", avr_device::interrupt(atmega1284p))]
#[cfg_attr(feature = "atmega2560", avr_device::interrupt(atmega2560))]
fn USART0_RX() {
    static mut INPUT: Option<Producer<u8, 64>> = None;
    let byte = peripherals().USART0.udr0().read().bits();
    if INPUT.is_none() {
        *INPUT = BYTES.producer();
    }
    if INPUT.as_mut().is_some_and(|input| input.push(byte).is_err()) {
        peripherals().PORTB.portb().modify(|_, w| w.pb7().set_bit());
    }
    RECEIVED.set();
}

#[cfg_attr(feature = "atmega1284p", avr_device::interrupt(atmega1284p))]
#[cfg_attr(feature = "atmega2560", avr_device::interrupt(atmega2560))]
fn USART0_UDRE() {
    peripherals().USART0.ucsr0b().modify(|_, w| w.udrie0().clear_bit());
    SENT.set();
}

#[embassy_executor::task]
async fn echo(thread: Thread, usart: USART0, mut input: Consumer<u8, 64>) {
    loop {
        let byte = RECEIVED.wait(thread, || input.pop()).await;
        SENT.wait(thread, || usart.ucsr0a().read().udre0().bit_is_set().then_some(())).await;
        usart.udr0().write(|w| w.set(byte));
        avr_embassy::mask(|| usart.ucsr0b().modify(|_, w| w.udrie0().set_bit()));
    }
}

#[avr_device::entry]
fn main() -> ! {
    static EXECUTOR: StaticCell<Executor> = StaticCell::new();
    let Peripherals { USART0: usart, PORTB: port, .. } = peripherals();
    port.ddrb().write(|w| w.pb7().set_bit());
    // 16 MHz / 8 / 17 is 2.1 % above 115,200.
    // SAFETY: the divisor fits 12 bits.
    unsafe { usart.ubrr0().write(|w| w.bits(16)) };
    usart.ucsr0a().write(|w| w.u2x0().set_bit());
    usart.ucsr0b().write(|w| w.rxen0().set_bit().txen0().set_bit().rxcie0().set_bit());
    EXECUTOR.init(Executor::new()).run(|spawner, thread| {
        if let Some(input) = BYTES.consumer()
            && let Ok(task) = echo(thread, usart, input)
        {
            spawner.spawn(task);
        }
    })
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}
