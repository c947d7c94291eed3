//! Time: a millisecond tick, and embassy-time's driver on top of it.
//!
//! The interrupt only counts and sets an event bit. The timer queue is kept and walked in thread mode,
//! where it costs no interrupts-off time; timers are for thread-mode tasks only, and exact to the
//! millisecond.

use core::cell::RefCell;
use core::task::Waker;

use embassy_time_driver::{Driver, time_driver_impl};
use embassy_time_queue_utils::Queue;

use super::flags;
use crate::boards::{ACTIVE, Timer};
use crate::hal::event::Event;

const _: () = assert!(matches!(ACTIVE.tick_timer, Timer::T0), "the tick is on timer 0");

/// Milliseconds since reset. The interrupt alone writes it.
static mut MILLIS: u32 = 0;

#[avr_device::interrupt(atmega2560)]
fn TIMER0_COMPA() {
    // SAFETY: the only writer; readers disable interrupts.
    unsafe { MILLIS = MILLIS.wrapping_add(1) };
    flags::set(Event::Tick);
}

/// Milliseconds since reset.
pub fn millis() -> u32 {
    // SAFETY: the writer is an interrupt, and interrupts are off.
    avr_device::interrupt::free(|_| unsafe { MILLIS })
}

struct Millis {
    queue: RefCell<Queue>,
}

// SAFETY: the queue is touched in thread mode only.
unsafe impl Sync for Millis {}

time_driver_impl!(static DRIVER: Millis = Millis { queue: RefCell::new(Queue::new()) });

impl Driver for Millis {
    fn now(&self) -> u64 {
        // 49 days, then timers that are pending fire late by as much: a machine is off by then.
        u64::from(millis())
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        if let Ok(mut queue) = self.queue.try_borrow_mut() {
            queue.schedule_wake(at, waker);
        }
    }
}

/// Wakes the tasks whose time has come. Thread mode, after a tick.
pub fn wake_expired() {
    if let Ok(mut queue) = DRIVER.queue.try_borrow_mut() {
        queue.next_expiration(DRIVER.now());
    }
}

/// Starts the tick: CTC, clock / 64, 250 counts.
pub fn start() {
    let timer = super::peripherals().TC0;
    const COUNT: u8 = (ACTIVE.clock_hz / 64 / 1000 - 1) as u8;
    timer.ocr0a().write(|w| w.set(COUNT));
    timer.tccr0a().write(|w| w.wgm0().ctc());
    timer.tccr0b().write(|w| w.cs0().prescale_64());
    timer.timsk0().write(|w| w.ocie0a().set_bit());
}
