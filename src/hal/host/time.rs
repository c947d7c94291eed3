//! The driver of `embassy-time` over the machine's clock.

use core::cell::RefCell;
use core::task::Waker;

use avr_embassy::timers::Timers;
use embassy_executor::raw::wake_task;
use embassy_time_driver::{Driver, time_driver_impl};

use super::{flags, now};
use crate::boards::ACTIVE;
use crate::hal::event::Event;

/// CPU cycles in a millisecond.
pub(super) const CYCLES_PER_MS: u64 = ACTIVE.clock_hz as u64 / 1000;

machine_static! {
    fn timers() -> RefCell<Timers<4>> = RefCell::new(Timers::new());
}

struct Millis;

time_driver_impl!(static DRIVER: Millis = Millis);

impl Driver for Millis {
    fn now(&self) -> u64 {
        now() / CYCLES_PER_MS
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        timers().borrow_mut().schedule(at, waker);
    }
}

/// Returns the machine's clock in milliseconds, modulo 2^32.
pub fn millis() -> u32 {
    DRIVER.now() as u32
}

/// Wakes the tasks whose time has come.
pub fn wake_expired() {
    let take = || timers().borrow_mut().take_expired(millis());
    while let Some(task) = take() {
        wake_task(task);
    }
}

/// Returns when the next millisecond is due.
pub(super) fn next_tick() -> u64 {
    (now() / CYCLES_PER_MS + 1) * CYCLES_PER_MS
}

/// Sets the event of the tick: a millisecond has passed.
pub(super) fn tick() {
    flags::set(Event::Tick);
}
