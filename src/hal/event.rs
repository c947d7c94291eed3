//! Event bits: how interrupts and the exec level tell thread-mode tasks that something happened.
//!
//! An interrupt never calls a `Waker`: it sets one bit of [`imp::flags`](super::imp::flags), which
//! costs two cycles. The main loop turns bits into wake-ups between polls, in thread mode. A bit stays
//! set until then, so no event is lost; events that repeat before the loop looks merge into one.
//! Each event has one waiting task at most, but for the transmitters.

use core::cell::Cell;
use core::future::poll_fn;
use core::task::{Poll, Waker};

use super::byte::SharedByte;
use super::imp;
use super::serial::{PORTS, USB};

/// What happened. The discriminant is the bit. Bits 5 and 6 are left to interrupts among themselves.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Event {
    /// Bytes arrived, or were lost.
    Received = 0,
    /// The transmit ring drained by a byte.
    Transmitted = 1,
    /// A millisecond has passed.
    Tick = 2,
    /// Exec released a block.
    BlockDone = 3,
    /// A real-time character arrived, or a switch has changed.
    Realtime = 4,
    /// A thread-mode task was woken: the executor has work.
    Thread = 7,
}

/// Events that tasks wait for: those below this bit.
const WAITABLE: usize = 5;
/// For each a task may wait, and for [`Event::Transmitted`] one on each port.
const SLOTS: usize = WAITABLE + PORTS - 1;

/// The waiting tasks. Thread mode only.
pub struct Waiters([Cell<Option<Waker>>; SLOTS]);

// SAFETY: touched in thread mode only, by `wait` and `dispatch`, neither of which preempts the other.
unsafe impl Sync for Waiters {}

impl Waiters {
    /// Nobody waits.
    pub const fn new() -> Self {
        Self([const { Cell::new(None) }; SLOTS])
    }
}

impl Default for Waiters {
    fn default() -> Self {
        Self::new()
    }
}

machine_static! {
    fn waiters() -> Waiters = Waiters::new();
}

machine_static! {
    // Exec counts; the main loop, which never runs in between, begins anew.
    fn passed_over() -> SharedByte = SharedByte::new(0);
}

/// Counts one more segment since the main loop had its last turn, and says how many they are. Exec only.
pub fn pass_over() -> u8 {
    let count = passed_over().get().saturating_add(1);
    passed_over().set(count);
    count
}

/// Waits until `ready` gives a value, asking again after each `event`. Thread mode only.
///
/// Nothing but what `ready` keeps is kept, so none of these is an `async fn`: each would keep its arguments as well.
pub fn wait<R>(event: Event, ready: impl FnMut() -> Option<R>) -> impl Future<Output = R> {
    wait_in(event as u8, ready)
}

/// The same after each byte that any port has sent, for the task that waits for this one.
pub fn wait_transmitted<R>(port: u8, ready: impl FnMut() -> Option<R>) -> impl Future<Output = R> {
    wait_in(transmitted(port), ready)
}

/// Has the main loop wake a task after the next `event`. Thread mode only.
pub fn wake_after(event: Event, waker: &Waker) {
    register(event as u8, waker);
}

/// Has the main loop wake the task that waits for the transmitter of `port`, after the next byte that any port has sent.
/// Thread mode only.
pub fn wake_after_transmitted(port: u8, waker: &Waker) {
    register(transmitted(port), waker);
}

const fn transmitted(port: u8) -> u8 {
    if port == USB { Event::Transmitted as u8 } else { WAITABLE as u8 }
}

fn wait_in<R>(slot: u8, mut ready: impl FnMut() -> Option<R>) -> impl Future<Output = R> {
    poll_fn(move |cx| {
        // An event between the question and the registration sets its bit, which the main loop
        // sees after this poll: nothing is missed.
        if let Some(value) = ready() {
            return Poll::Ready(value);
        }
        register(slot, cx.waker());
        Poll::Pending
    })
}

/// Has the main loop wake this task after the event of a slot. By itself, for each of those who wait would have it.
#[inline(never)]
#[small]
fn register(slot: u8, waker: &Waker) {
    if let Some(slot) = waiters().0.get(usize::from(slot)) {
        slot.set(Some(waker.clone()));
    }
}

/// Waits for the next `event` after the last poll of the task. Thread mode only.
pub fn next(event: Event) -> impl Future<Output = ()> {
    let mut asked = false;
    wait(event, move || core::mem::replace(&mut asked, true).then_some(()))
}

/// Wakes who waits for the events in `bits`. The main loop calls it, in thread mode.
pub fn dispatch(bits: u8) {
    passed_over().set(0);
    let mut left = bits & ((1 << WAITABLE) - 1);
    for slot in waiters().0.iter().take(WAITABLE) {
        if left == 0 {
            break;
        }
        if left & 1 != 0
            && let Some(waker) = slot.take()
        {
            waker.wake();
        }
        left >>= 1;
    }
    if PORTS > 1
        && bits & (1 << Event::Transmitted as u8) != 0
        && let Some(waker) = waiters().0.get(WAITABLE).and_then(Cell::take)
    {
        waker.wake();
    }
    if bits & (1 << Event::Tick as u8) != 0 {
        imp::uart::look();
        imp::time::wake_expired();
    }
}
