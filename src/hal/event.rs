//! Tells thread-mode tasks what interrupts and the exec level have done, by the event bits of [`avr_embassy::event`].
//!
//! Each event has at most one waiting task. Only for [`Event::Transmitted`] there is one task for each port.

use core::future::poll_fn;
use core::task::{Poll, Waker};

use avr_embassy::{Interrupt, Thread, Waiter};

use super::byte::SharedByte;
use super::imp;
use super::serial::{NATIVE, PORTS, USB};

/// What happened. The discriminant is the bit. Of the events in one turn of the main loop the one with the highest
/// bit is served first: control before the reader, and the reader before the planner and the reporter, whose turns
/// may take 10 ms of a busy CPU.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Event {
    /// The transmit ring has room for one more byte.
    Transmitted = 0,
    /// Exec released a block.
    BlockDone = 1,
    /// Bytes arrived, or were lost.
    Received = 2,
    /// A real-time character arrived, or a switch has changed.
    Realtime = 3,
    /// A millisecond has passed.
    Tick = avr_embassy::Event::TICK.bit(),
}

impl Event {
    /// Returns the event of the runtime.
    #[inline(always)]
    pub(super) const fn bit(self) -> avr_embassy::Event {
        match self {
            Event::Transmitted => avr_embassy::Event::new::<0>(),
            Event::BlockDone => avr_embassy::Event::new::<1>(),
            Event::Received => avr_embassy::Event::new::<2>(),
            Event::Realtime => avr_embassy::Event::new::<3>(),
            Event::Tick => avr_embassy::Event::TICK,
        }
    }

    /// Whether the event is among the bits of a turn.
    #[inline(always)]
    pub(super) const fn is_in(self, bits: u8) -> bool {
        bits & 1 << self as u8 != 0
    }
}

/// Whether bytes have come and a millisecond has passed since the last turn of the main loop. The reader should then
/// have a turn before a long calculation.
#[inline(always)]
pub fn is_unheard() -> bool {
    imp::flags::has(Event::Received) && imp::flags::has(Event::Tick)
}

/// Whether other tasks should have their turn before the next line is executed: because of a real-time character or a
/// switch, or because bytes have come ([`is_unheard`]) that the reader has to see before that line (`calls_reader`).
#[inline(always)]
pub fn is_wanted(thread: Thread) -> bool {
    imp::flags::has(Event::Realtime) || is_unheard() && imp::uart::calls_reader(thread)
}

/// After this many segments without a turn of the main loop, received bytes are treated as a question that waits for
/// its answer: see [`is_asked`].
const UNHEARD: u8 = 1;

machine_static! {
    // The task that waits for the transmitter of the second port.
    fn transmitted() -> Waiter = Waiter::new();
    // Exec counts up. The main loop, which never runs between exec's read and its write, clears.
    fn passed_over() -> SharedByte = SharedByte::new(0);
    // The ports of `set_eager`, and the upper bits of the time of the last look at them, ms. Used by thread mode only.
    fn eager() -> SharedByte = SharedByte::new(0);
    // Thread mode writes it, exec reads it.
    fn asked() -> SharedByte = SharedByte::new(0);
}

/// Sets the ports, as bits, on which bytes may act without the end of a line. While any byte waits on such a port,
/// there is an [`Event::Received`] each [`EAGER_MS`].
pub fn set_eager(_: Thread, ports: u8) {
    eager().set(eager().get() & !EAGER_PORTS | ports);
}

/// Sets whether a sender waits for an answer that thread mode works on. Exec then leaves more of the CPU to thread
/// mode.
pub fn set_asked(_: Thread, waits: bool) {
    asked().set(waits.into());
}

/// Whether a sender waits for an answer, or may wait for one: bytes have come, and the main loop has had no turn since
/// the last segment. Any level.
#[inline(always)]
pub fn is_asked() -> bool {
    asked().get() != 0 || (passed_over().get() >= UNHEARD && is_unheard())
}

/// Counts one more segment since the last turn of the main loop. Returns how many there have been.
pub fn pass_over(_: Interrupt) -> u8 {
    let count = passed_over().get().saturating_add(1);
    passed_over().set(count);
    count
}

/// Milliseconds between two events of [`set_eager`]: a power of two.
const EAGER_MS: u8 = 4;
/// The bits of `eager` that are ports.
const EAGER_PORTS: u8 = EAGER_MS - 1;
const _: () =
    assert!(1 << PORTS <= EAGER_MS as usize, "the bits of the ports reach into those of the time");

/// Waits until `ready` returns a value. Asks now, and again after each `event`.
pub fn wait<R>(
    thread: Thread,
    event: Event,
    ready: impl FnMut() -> Option<R>,
) -> impl Future<Output = R> {
    event.bit().wait(thread, ready)
}

/// Waits until `ready` returns a value. Asks now, and again after each byte that any port has sent.
pub fn wait_transmitted<R>(
    thread: Thread,
    port: u8,
    mut ready: impl FnMut() -> Option<R>,
) -> impl Future<Output = R> {
    poll_fn(move |cx| {
        if let Some(value) = ready() {
            return Poll::Ready(value);
        }
        wake_after_transmitted(thread, port, cx.waker());
        Poll::Pending
    })
}

/// Makes the main loop wake a task after the next `event`.
pub fn wake_after(thread: Thread, event: Event, waker: &Waker) {
    event.bit().wake_after(thread, waker);
}

/// Makes the main loop wake the task that waits for the transmitter of `port`, after the next byte that any port has
/// sent.
pub fn wake_after_transmitted(thread: Thread, port: u8, waker: &Waker) {
    match port {
        USB => wake_after(thread, Event::Transmitted, waker),
        _ => transmitted().wake_after(thread, waker),
    }
}

/// Waits for the next `event` after the last poll of the task.
pub fn next(thread: Thread, event: Event) -> impl Future<Output = ()> {
    event.bit().next(thread)
}

/// Returns the next value of `eager` if it is time for another look. The main loop may miss any number of
/// milliseconds, always the same ones too, so it compares times and does not wait for a certain one.
fn looked(eager: u8, ms: u8) -> Option<u8> {
    let is_due = (eager ^ ms) & !EAGER_PORTS != 0;
    is_due.then_some(eager & EAGER_PORTS | ms & !EAGER_PORTS)
}

/// Whether it is time for a look, and a byte waits on a port where bytes may act without the end of a line.
#[inline(never)]
fn is_eager(thread: Thread) -> bool {
    let Some(now) = looked(eager().get(), imp::time::millis() as u8) else { return false };
    eager().set(now);
    (0..PORTS as u8).any(|port| now & 1 << port != 0 && imp::uart::newest(thread, port).is_some())
}

/// Runs work that is too small for a task, in each turn of the main loop. `bits` are the events since the last turn.
pub fn turn(thread: Thread, bits: u8) {
    passed_over().set(0);
    if NATIVE {
        imp::uart::go_on(thread);
    }
    if PORTS > 1 && Event::Transmitted.is_in(bits) {
        transmitted().wake(thread);
    }
    if Event::Tick.is_in(bits) {
        imp::uart::look(thread);
        if is_eager(thread) {
            super::flags::set(Event::Received);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_look_is_due_in_time_whichever_milliseconds_are_missed() {
        for step in [1u32, 2, 3, 4, 5, 7, 8, 12, 100] {
            for first in 0..8 {
                let (mut eager, mut last) = (0b10, first);
                for ms in (first..first + 3_000).step_by(step as usize) {
                    if let Some(now) = looked(eager, ms as u8) {
                        (eager, last) = (now, ms);
                    }
                    assert!(ms - last < u32::from(EAGER_MS).max(step), "{step}, {first}: {ms}");
                    assert_eq!(eager & EAGER_PORTS, 0b10);
                }
            }
        }
    }
}
