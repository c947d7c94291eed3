//! What interrupts and the exec level tell thread-mode tasks, by the event bits of [`avr_embassy::event`].
//!
//! Each event has one waiting task at most, but for the transmitters.

use core::future::poll_fn;
use core::task::{Poll, Waker};

use avr_embassy::{Thread, Waiter};

use super::byte::SharedByte;
use super::imp;
use super::serial::{NATIVE, PORTS, USB};

/// What happened. The discriminant is the bit; of events that happen in one turn of the main loop the one with the highest bit is
/// seen to first: control before the reader, and that before the planner and the reporter, whose turns may take 10 ms of a busy CPU.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Event {
    /// The transmit ring drained by a byte.
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
    /// The event of the runtime.
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

    /// Whether it is among the bits of a turn.
    #[inline(always)]
    pub(super) const fn is_in(self, bits: u8) -> bool {
        bits & 1 << self as u8 != 0
    }
}

/// Whether bytes have come, and a millisecond has passed, since the main loop had its last turn: the reader should have one before a
/// long calculation.
#[inline(always)]
pub fn is_unheard() -> bool {
    imp::flags::has(Event::Received) && imp::flags::has(Event::Tick)
}

/// Whether others should have their turn before the next line is carried out: the reader for what [`is_unheard`], unless that can wait for some
/// lines, and others for a real-time character or a switch.
#[inline(always)]
pub fn is_wanted() -> bool {
    imp::flags::has(Event::Realtime) || is_unheard() && imp::uart::calls_reader()
}

/// Segments without a turn of the main loop after which bytes that have come count as a question.
const UNHEARD: u8 = 1;

machine_static! {
    // Who waits for the transmitter of the second port.
    fn transmitted() -> Waiter = Waiter::new();
    // Exec counts; the main loop, which never runs in between, begins anew.
    fn passed_over() -> SharedByte = SharedByte::new(0);
    // Thread mode alone.
    fn eager() -> SharedByte = SharedByte::new(0);
    // Thread mode says so, exec looks.
    fn asked() -> SharedByte = SharedByte::new(0);
}

/// Says on which ports, as bits, bytes are looked for that act without the end of a line: while any byte waits there, there is an
/// [`Event::Received`] each [`EAGER_MS`]. Thread mode.
pub fn set_eager(ports: u8) {
    eager().set(ports);
}

/// Says whether somebody waits for an answer that thread mode works on. Exec leaves it more of the CPU then.
pub fn set_asked(waits: bool) {
    asked().set(waits.into());
}

/// Whether somebody does, or may: bytes have come, and the main loop has had no turn since the last segment. Exec and thread mode.
#[inline(always)]
pub fn is_asked() -> bool {
    asked().get() != 0 || (passed_over().get() >= UNHEARD && is_unheard())
}

/// Counts one more segment since the main loop had its last turn, and says how many they are. Exec only.
pub fn pass_over() -> u8 {
    let count = passed_over().get().saturating_add(1);
    passed_over().set(count);
    count
}

/// See [`set_eager`]: a power of two.
const EAGER_MS: u8 = 4;

/// Waits until `ready` gives a value, asking again after each `event`.
pub fn wait<R>(
    thread: Thread,
    event: Event,
    ready: impl FnMut() -> Option<R>,
) -> impl Future<Output = R> {
    event.bit().wait(thread, ready)
}

/// Waits until `ready` gives a value, asking again after each byte that any port has sent.
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

/// Has the main loop wake a task after the next `event`.
pub fn wake_after(thread: Thread, event: Event, waker: &Waker) {
    event.bit().wake_after(thread, waker);
}

/// Has the main loop wake the task that waits for the transmitter of `port`, after the next byte that any port has sent.
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

/// Whether a byte waits on a port where one may act without the end of a line.
fn is_eager() -> bool {
    let eager = eager().get();
    (0..PORTS as u8).any(|port| eager & 1 << port != 0 && imp::uart::newest(port).is_some())
}

/// A turn of the main loop: what is too small for a task. `bits` are the events since the last.
pub fn turn(thread: Thread, bits: u8) {
    passed_over().set(0);
    if NATIVE {
        imp::uart::go_on();
    }
    if PORTS > 1 && Event::Transmitted.is_in(bits) {
        transmitted().wake(thread);
    }
    if Event::Tick.is_in(bits) {
        imp::uart::look();
        if imp::time::millis() as u8 & (EAGER_MS - 1) == 0 && is_eager() {
            super::flags::set(Event::Received);
        }
    }
}
