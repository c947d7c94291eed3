//! Time: a millisecond tick, and embassy-time's driver on top of it.
//!
//! The interrupt only counts and sets an event bit. The timer queue is kept and walked in thread mode,
//! where it costs no interrupts-off time; timers are for thread-mode tasks only, and exact to the
//! millisecond.

use core::arch::asm;
use core::task::Waker;

use embassy_time_driver::{Driver, time_driver_impl};

use crate::boards::{ACTIVE, Timer};
use crate::hal::event::Event;
use crate::hal::timers::Timers;

const _: () = assert!(matches!(ACTIVE.tick_timer, Timer::T0), "the tick is on timer 0");

/// Milliseconds since reset, the lowest byte first: enough for 34 years. The interrupt alone writes it.
static mut MILLIS: [u8; 5] = [0; 5];

/// TIMER0_COMPA: counts. Interrupts are off for 20 cycles.
///
/// They are on again while it carries into the upper bytes, every 256 ms. Exec, which may come then and
/// stay for some of these, does not ask for the time.
#[unsafe(no_mangle)]
extern "C" fn __vector_21() -> ! {
    // SAFETY: every register it changes is restored, and it returns by `reti`. Only it writes `MILLIS`.
    unsafe {
        asm!(
            "push r24",
            "in   r24, 0x3F",
            "push r24",
            "lds  r24, {millis}",
            "inc  r24",
            "sts  {millis}, r24",
            "sei",
            "brne 1f",
            "lds  r24, {millis} + 1",
            "inc  r24",
            "sts  {millis} + 1, r24",
            "brne 1f",
            "lds  r24, {millis} + 2",
            "inc  r24",
            "sts  {millis} + 2, r24",
            "brne 1f",
            "lds  r24, {millis} + 3",
            "inc  r24",
            "sts  {millis} + 3, r24",
            "brne 1f",
            "lds  r24, {millis} + 4",
            "inc  r24",
            "sts  {millis} + 4, r24",
            "1:",
            "sbi  0x1E, {tick}",
            "pop  r24",
            "out  0x3F, r24",
            "pop  r24",
            "reti",
            millis = sym MILLIS,
            tick = const Event::Tick as u8,
            options(noreturn),
        );
    }
}

fn count() -> [u8; 5] {
    // SAFETY: the writer is an interrupt, and interrupts are off.
    avr_device::interrupt::free(|_| unsafe { MILLIS })
}

/// Milliseconds since reset, modulo 2^32: they wrap after 49.7 days.
pub fn millis() -> u32 {
    let [a, b, c, d, _] = count();
    u32::from_le_bytes([a, b, c, d])
}

struct Millis(Timers);

time_driver_impl!(static DRIVER: Millis = Millis(Timers::new()));

impl Driver for Millis {
    fn now(&self) -> u64 {
        let [a, b, c, d, e] = count();
        u64::from_le_bytes([a, b, c, d, e, 0, 0, 0])
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        self.0.schedule(at, waker);
    }
}

/// Wakes the tasks whose time has come. Thread mode, after a tick.
pub fn wake_expired() {
    DRIVER.0.wake_expired(millis());
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
