//! Time: a millisecond tick, and embassy-time's driver on top of it.
//!
//! The interrupt only counts and sets [`Event::TICK`]. Thread mode walks the list of waiting tasks, without masking
//! interrupts for it. So a timer is as late as the longest poll of a thread-mode task, and otherwise exact to the
//! millisecond.
//!
//! The list has room for 4 tasks, with the feature `timers-8` for 8, with `timers-16` for 16. Further tasks are
//! polled all the time until there is room.

use core::arch::asm;
use core::cell::UnsafeCell;
use core::task::Waker;

use embassy_executor::raw::wake_task;
use embassy_time_driver::{Driver, time_driver_impl};

use crate::assembly::{CLOSED, FLAGS, MISSED, PEND, PENDED};
use crate::chip::{self, OCRA, PRESCALERS, TCCRA, TCCRB, TIMSK};
use crate::period::Period;
use crate::timers::{TIMERS, Timers};
use crate::{Event, Thread, interrupt};

/// Milliseconds since reset, the lowest byte first: enough for 34 years. The interrupt alone writes it.
static mut MILLIS: [u8; 5] = [0; 5];

/// The length of a millisecond on an uneven clock, of which a millisecond is no whole number of the timer's counts.
/// Four bytes: the parts of a count that have been left out so far, the parts that each millisecond leaves out, how
/// many parts make a count, and the whole counts. Only the interrupt touches it once the tick is on.
#[cfg(feature = "uneven-clock")]
static mut PERIOD: [u8; 4] = [0; 4];

/// The assembly of the tick. The brackets hold the code that sets the length of the millisecond that has begun; the
/// operands of that code follow.
macro_rules! tick {
    ([$($period:literal),*] $($operands:tt)*) => {
        asm!(
            "push r24",
            "in   r24, 0x3F",
            "push r24",
            $($period,)*
            "lds  r24, {millis}",
            "inc  r24",
            "sts  {millis}, r24",
            // Every 256 ms the path is 8 cycles longer, so the longer path is the one without a jump.
            "brne 4f",
            "lds  r24, {closed}",
            "inc  r24",
            "sts  {closed}, r24",
            "sei",
            "lds  r24, {millis} + 1",
            "inc  r24",
            "sts  {millis} + 1, r24",
            "brne 3f",
            "lds  r24, {millis} + 2",
            "inc  r24",
            "sts  {millis} + 2, r24",
            "brne 3f",
            "lds  r24, {millis} + 3",
            "inc  r24",
            "sts  {millis} + 3, r24",
            "brne 3f",
            "lds  r24, {millis} + 4",
            "inc  r24",
            "sts  {millis} + 4, r24",
            "3:",
            "cli",
            "lds  r24, {closed}",
            "dec  r24",
            "sts  {closed}, r24",
            "brne 4f",
            "lds  r24, {missed}",
            "tst  r24",
            "breq 4f",
            "ldi  r24, 0",
            "sts  {missed}, r24",
            "ldi  r24, {pended}",
            "sts  {pend}, r24",
            "4:",
            "sei",
            "sbi  {flags}, {tick}",
            "pop  r24",
            "out  0x3F, r24",
            "pop  r24",
            "reti",
            millis = sym MILLIS,
            closed = sym CLOSED,
            missed = sym MISSED,
            flags = const FLAGS,
            pend = const PEND,
            pended = const PENDED,
            tick = const Event::TICK.bit(),
            $($operands)*
            options(noreturn),
        )
    };
}

/// The handler of the tick: counts, in 33 cycles, with interrupts off for 21.
///
/// Every 256 ms it carries into the upper bytes, with interrupts on. Interrupt mode is kept out meanwhile, because
/// its tasks may ask for the time.
///
/// With the feature `uneven-clock` it also sets the length of the millisecond that has begun, which takes 21 cycles
/// more, with interrupts off. A millisecond is one count longer as soon as the parts that were left out make a count.
/// The timer's count is far from its end at that time.
///
/// # Safety
/// It is the handler of the tick's interrupt, and nothing else calls it.
#[inline(always)]
pub(crate) unsafe fn handler() -> ! {
    // SAFETY: every register it changes is restored, and it returns by `reti`. Only it writes `MILLIS` and `PERIOD`.
    // Whoever interrupts it leaves `CLOSED` as it was, so counting up and down restores it.
    #[cfg(not(feature = "uneven-clock"))]
    unsafe {
        tick!([])
    }
    // SAFETY: as above.
    #[cfg(feature = "uneven-clock")]
    unsafe {
        tick!([
            "push r25",
            "lds  r24, {period}",
            "lds  r25, {period} + 1",
            "add  r24, r25",
            "lds  r25, {period} + 2",
            "cp   r24, r25",
            // From here to `sbci` carry is set if this millisecond has only the whole counts.
            "brlo 5f",
            "sub  r24, r25",
            "5:",
            "sts  {period}, r24",
            "lds  r24, {period} + 3",
            "sbci r24, 0",
            "sts  {top}, r24",
            "pop  r25"
        ] period = sym PERIOD, top = const OCRA,)
    }
}

fn count() -> [u8; 5] {
    // SAFETY: the writer is an interrupt, and interrupts are off.
    crate::mask(|| unsafe { MILLIS })
}

/// Milliseconds since reset, modulo 2^32: they wrap after 49.7 days. Any level. Cost: 24 cycles.
pub fn millis() -> u32 {
    let [a, b, c, d, _] = count();
    u32::from_le_bytes([a, b, c, d])
}

struct Millis(UnsafeCell<Timers<TIMERS>>);

// SAFETY: the list is touched under the ceiling lock only.
unsafe impl Sync for Millis {}

time_driver_impl!(static DRIVER: Millis = Millis(UnsafeCell::new(Timers::new())));

impl Driver for Millis {
    fn now(&self) -> u64 {
        let [a, b, c, d, e] = count();
        u64::from_le_bytes([a, b, c, d, e, 0, 0, 0])
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        // SAFETY: see above; waking a task does not come back here.
        critical_section::with(|_| unsafe { &mut *self.0.get() }.schedule(at, waker));
    }
}

/// Wakes the tasks whose time has come.
pub(crate) fn wake_expired(thread: Thread) {
    let now = millis();
    // SAFETY: see above.
    let take = || interrupt::lock(thread, |_| unsafe { &mut *DRIVER.0.get() }.take_expired(now));
    while let Some(task) = take() {
        wake_task(task);
    }
}

/// Starts the tick of a chip whose clock is `CLOCK_HZ`, 8 or 16 MHz for example. From then on the timer belongs to
/// the runtime.
///
/// If a millisecond of the clock is no whole number of timer counts, as at 20 MHz, the feature `uneven-clock` is
/// needed. Milliseconds then differ by one count, 12.8 us at 20 MHz, and their mean is exact: no parts of a count are
/// lost. A clock of which a millisecond is no whole number of 128ths of a count, or of larger parts, does not
/// compile.
pub fn start<const CLOCK_HZ: u32>() {
    let period = const {
        let period = Period::new(CLOCK_HZ, &PRESCALERS)
            .expect("a millisecond of this clock cannot be made of the timer's counts");
        assert!(
            period.parts == 0 || cfg!(feature = "uneven-clock"),
            "a millisecond of this clock is no whole number of the timer's counts: \
             turn on the feature `uneven-clock` of avr-embassy"
        );
        period
    };
    chip::link();
    #[cfg(feature = "uneven-clock")]
    // SAFETY: the tick is not on yet.
    unsafe {
        (&raw mut PERIOD).write([0, period.parts, period.of, period.counts]);
    }
    // SAFETY: nobody else uses the timer. In CTC mode it counts up to `OCRA` and begins anew.
    unsafe {
        (OCRA as *mut u8).write_volatile(period.counts - 1);
        (TCCRA as *mut u8).write_volatile(0b10);
        (TCCRB as *mut u8).write_volatile(period.select);
        (TIMSK as *mut u8).write_volatile(0b10);
    }
}
