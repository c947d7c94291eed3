//! Two tasks that blink: PB7, the LED of an Arduino Mega 2560 (pin 13), four times a second, and PB6 (pin 12) ten
//! times a second.
//!
//! The clock is 16 MHz; with the feature `uneven-clock` it is 20 MHz.
#![no_std]
#![no_main]

mod chip;

use avr_embassy::{Executor, time};
use chip::Peripherals;
use embassy_time::{Duration, Ticker};
use static_cell::StaticCell;

const CLOCK_HZ: u32 = if cfg!(feature = "uneven-clock") { 20_000_000 } else { 16_000_000 };

#[embassy_executor::task(pool_size = 2)]
async fn blink(pin: u8, half_period: Duration) {
    let mut ticker = Ticker::every(half_period);
    loop {
        ticker.next().await;
        // SAFETY: a 1 written to PINB toggles that pin and leaves the others alone.
        unsafe { Peripherals::steal().PORTB.pinb().write(|w| w.bits(1 << pin)) };
    }
}

#[avr_device::entry]
fn main() -> ! {
    static EXECUTOR: StaticCell<Executor> = StaticCell::new();
    // SAFETY: called once.
    let peripherals = unsafe { Peripherals::steal() };
    peripherals.PORTB.ddrb().write(|w| w.pb7().set_bit().pb6().set_bit());
    time::start::<CLOCK_HZ>();
    EXECUTOR.init(Executor::new()).run(|spawner, _| {
        for (pin, ms) in [(7, 125), (6, 50)] {
            if let Ok(task) = blink(pin, Duration::from_millis(ms)) {
                spawner.spawn(task);
            }
        }
    })
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}
