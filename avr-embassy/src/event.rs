//! Event bits: how interrupts and interrupt-mode tasks tell thread-mode tasks that something happened.
//!
//! A handler never calls a [`Waker`]: it sets one bit, in one instruction of two cycles. The main loop turns bits
//! into wake-ups between polls. A bit stays set until then, so no event is lost; events that repeat before the loop
//! looks merge into one. An event only says "look again". The data lies elsewhere, in a [`Ring`](crate::ring::Ring)
//! for example.
//!
//! Of the events that the main loop finds in one turn, the one with the highest bit is served first. Timers come
//! last.
//!
//! ```
//! use avr_embassy::{Event, Thread};
//!
//! const RECEIVED: Event = Event::new::<0>();
//!
//! // A handler calls `RECEIVED.set()`; a task waits.
//! async fn task(thread: Thread, mut pop: impl FnMut() -> Option<u8>) -> u8 {
//!     RECEIVED.wait(thread, || pop()).await
//! }
//! ```

use core::cell::Cell;
use core::future::poll_fn;
use core::task::{Poll, Waker};

use embassy_executor::raw::{TaskRef, task_from_waker, wake_task};

use crate::Thread;

/// The bits 0 to 3 belong to the program.
pub const OWN: usize = 4;
/// Events that tasks can wait for.
const WAITABLE: usize = OWN + 1;
// The runtime uses the other bits: see `assembly` and `POLL`.
const _: () = assert!(
    WAITABLE <= 5,
    "bits 5, 6 and 7 are HOLD, HELD and POLL: an event needs another register"
);
/// A task of the thread-mode executor was woken: there is something to poll.
pub(crate) const POLL: u8 = 7;

/// An event: a bit of the register of events.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Event(u8);

impl Event {
    /// A millisecond has passed: the event of the time driver. Tasks may wait for it, too.
    pub const TICK: Event = Event(OWN as u8);

    /// Returns the program's event for a bit, 0 to 3. Another bit does not compile:
    ///
    /// ```compile_fail
    /// const TOO_MANY: avr_embassy::Event = avr_embassy::Event::new::<4>();
    /// ```
    pub const fn new<const BIT: u8>() -> Event {
        const {
            assert!(
                (BIT as usize) < OWN,
                "the program's own events are the bits 0 to 3, and the register has no more: let two things that happen share an \
                 event, whose task looks at both, or pend a task of interrupt mode"
            );
        };
        Event(BIT)
    }

    /// Returns the bit of this event, for handlers in assembly.
    pub const fn bit(self) -> u8 {
        self.0
    }

    /// Marks the event as happened. Any level. Cost: 2 cycles, if the event is a constant.
    #[inline(always)]
    pub fn set(self) {
        flags::set(self.0);
    }

    /// Whether the event has happened since the main loop looked last. Any level. Cost: 2 cycles.
    #[inline(always)]
    pub fn is_set(self) -> bool {
        flags::all() & 1 << self.0 != 0
    }

    /// Waits until `ready` returns a value. Asks now, and after each time that the event happens. Cost: see
    /// [`Waiter::wake_after`].
    ///
    /// An event is meant for one waiting task. If a second task waits, the two keep waking each other: both make
    /// progress, at the cost of polls. The future keeps `ready` and a byte; an `async fn` would keep its arguments
    /// twice.
    pub fn wait<R>(
        self,
        thread: Thread,
        mut ready: impl FnMut() -> Option<R>,
    ) -> impl Future<Output = R> {
        poll_fn(move |cx| {
            // An event between the question and the registration sets its bit. The main loop sees that bit after this
            // poll, so nothing is missed.
            if let Some(value) = ready() {
                return Poll::Ready(value);
            }
            self.wake_after(thread, cx.waker());
            Poll::Pending
        })
    }

    /// Waits for the next time that the event happens after the last poll of the task.
    pub fn next(self, thread: Thread) -> impl Future<Output = ()> {
        let mut asked = false;
        self.wait(thread, move || core::mem::replace(&mut asked, true).then_some(()))
    }

    /// Has the main loop wake a task after the next time that the event happens.
    #[inline(never)]
    #[cfg_attr(target_arch = "avr", optimize(size))]
    pub fn wake_after(self, thread: Thread, waker: &Waker) {
        if let Some(waiter) = waiters().get(usize::from(self.0)) {
            waiter.wake_after(thread, waker);
        }
    }
}

/// A place for one waiting task.
pub struct Waiter(Cell<Option<TaskRef>>);

// SAFETY: every function asks for the token of thread mode, in which nothing preempts anything.
unsafe impl Sync for Waiter {}

impl Waiter {
    /// Nobody waits.
    pub const fn new() -> Self {
        Self(Cell::new(None))
    }

    /// Stores a task for [`Waiter::wake`]. If another task is stored, that task is woken now; it asks again and is
    /// stored again.
    ///
    /// # Panics
    /// If the waker is not that of a task of Embassy's executors.
    #[inline(never)]
    #[cfg_attr(target_arch = "avr", optimize(size))]
    pub fn wake_after(&self, _: Thread, waker: &Waker) {
        let task = task_from_waker(waker);
        if let Some(before) = self.0.replace(Some(task))
            && before != task
        {
            wake_task(before);
        }
    }

    /// Wakes the task, if one waits.
    #[inline]
    pub fn wake(&self, _: Thread) {
        if let Some(task) = self.0.take() {
            wake_task(task);
        }
    }
}

impl Default for Waiter {
    fn default() -> Self {
        Self::new()
    }
}

machine_static! {
    fn waiters() -> [Waiter; WAITABLE] = [const { Waiter::new() }; WAITABLE];
}

/// Wakes the tasks that wait for the events in `bits`, lowest bit first, because Embassy polls in the reverse order
/// of wake-ups. The main loop calls it.
pub(crate) fn dispatch(thread: Thread, bits: u8) {
    let mut left = bits & ((1 << WAITABLE) - 1);
    for waiter in waiters() {
        if left == 0 {
            break;
        }
        if left & 1 != 0 {
            waiter.wake(thread);
        }
        left >>= 1;
    }
}

/// The register of events.
#[cfg(target_arch = "avr")]
pub(crate) mod flags {
    use crate::chip::FLAGS;

    /// Address in the data space.
    const REGISTER: *mut u8 = (FLAGS as usize + 0x20) as *mut u8;

    /// Sets a bit. Any level.
    #[inline(always)]
    pub fn set(bit: u8) {
        // One `sbi` for a constant bit: cannot be torn.
        // SAFETY: nobody else uses the register.
        unsafe { REGISTER.write_volatile(REGISTER.read_volatile() | 1 << bit) };
    }

    /// All bits.
    #[inline(always)]
    pub fn all() -> u8 {
        // SAFETY: as in `set`.
        unsafe { REGISTER.read_volatile() }
    }

    /// All bits, cleared by reading.
    #[inline(always)]
    pub fn take() -> u8 {
        crate::mask(|| {
            let bits = all();
            // SAFETY: as in `set`; interrupts are off since the read.
            unsafe { REGISTER.write_volatile(0) };
            bits
        })
    }
}

/// Stands in for the register on Cortex-M: a byte, and the CPU's event (`sev`) that ends its sleep.
#[cfg(feature = "_cortex-m")]
pub(crate) mod flags {
    use crate::byte::SharedByte;

    static REGISTER: SharedByte = SharedByte::new(0);

    /// Sets a bit. Any level. Cost: 12 cycles.
    pub fn set(bit: u8) {
        crate::mask(|| REGISTER.set(REGISTER.get() | 1 << bit));
        cortex_m::asm::sev();
    }

    /// All bits.
    pub fn all() -> u8 {
        REGISTER.get()
    }

    /// All bits, cleared by reading.
    pub fn take() -> u8 {
        crate::mask(|| {
            let bits = REGISTER.get();
            REGISTER.set(0);
            bits
        })
    }
}

/// Stands in for the register on the host: an atomic byte.
#[cfg(not(target_os = "none"))]
pub(crate) mod flags {
    use core::sync::atomic::{AtomicU8, Ordering::Relaxed};

    machine_static! {
        fn register() -> AtomicU8 = AtomicU8::new(0);
    }

    pub fn set(bit: u8) {
        register().fetch_or(1 << bit, Relaxed);
    }

    pub fn all() -> u8 {
        register().load(Relaxed)
    }

    pub fn take() -> u8 {
        register().swap(0, Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::Runtime;
    use std::cell::RefCell;
    use std::rc::Rc;
    use std::vec::Vec;

    const FIRST: Event = Event::new::<0>();
    const SECOND: Event = Event::new::<3>();

    type Seen = Rc<RefCell<Vec<&'static str>>>;

    /// Spawns a task that notes each time that the event happens.
    fn note(runtime: &Runtime, event: Event, name: &'static str, seen: &Seen) {
        let (thread, seen) = (runtime.thread(), seen.clone());
        runtime.spawn(async move {
            loop {
                event.next(thread).await;
                seen.borrow_mut().push(name);
            }
        });
    }

    #[test]
    fn each_event_wakes_its_task_and_repeated_ones_merge() {
        let (runtime, seen) = (Runtime::new(), Seen::default());
        note(&runtime, FIRST, "first", &seen);
        note(&runtime, SECOND, "second", &seen);
        runtime.settle(|_| ());
        FIRST.set();
        FIRST.set();
        runtime.settle(|_| ());
        assert_eq!(*seen.borrow(), ["first"]);
        assert!(!FIRST.is_set());
        SECOND.set();
        assert!(SECOND.is_set() && !FIRST.is_set());
        runtime.settle(|_| ());
        assert_eq!(*seen.borrow(), ["first", "second"]);
    }

    #[test]
    fn a_second_task_that_waits_is_not_forgotten() {
        let (runtime, seen) = (Runtime::new(), Seen::default());
        for name in ["one", "other"] {
            let (thread, seen) = (runtime.thread(), seen.clone());
            runtime.spawn(async move {
                let mut asked = 0;
                let third = || {
                    asked += 1;
                    (asked == 3).then_some(())
                };
                FIRST.wait(thread, third).await;
                seen.borrow_mut().push(name);
            });
        }
        for _ in 0..3 {
            FIRST.set();
            runtime.settle(|_| ());
        }
        assert_eq!(seen.borrow().len(), 2);
    }

    #[test]
    fn an_event_between_the_question_and_the_wait_is_seen() {
        let (runtime, seen) = (Runtime::new(), Seen::default());
        let (thread, told) = (runtime.thread(), seen.clone());
        runtime.spawn(async move {
            let mut asked = false;
            // The first time the event happens right behind the question.
            let ask = || {
                FIRST.set();
                core::mem::replace(&mut asked, true).then_some(())
            };
            FIRST.wait(thread, ask).await;
            told.borrow_mut().push("seen");
        });
        runtime.settle(|_| ());
        assert_eq!(*seen.borrow(), ["seen"]);
    }

    #[test]
    fn the_turn_sees_the_bits() {
        let runtime = Runtime::new();
        let mut bits = 0;
        Event::TICK.set();
        SECOND.set();
        runtime.settle(|seen| bits |= seen);
        assert_eq!(bits, 1 << Event::TICK.bit() | 1 << SECOND.bit());
    }
}
