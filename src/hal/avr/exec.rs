//! Level 2: the exec executor, polled from a software interrupt.
//!
//! The interrupt is USART3's data-register-empty: that transmitter never sends, so its condition
//! always holds, and setting or clearing the enable bit raises or withdraws the interrupt. It runs
//! with interrupts on, so the step interrupt and the short ones go on.
//!
//! Two things keep it out: itself, while it runs, and [`lock`], with which thread mode touches what
//! exec reads (a priority ceiling). Either way the request is remembered and served right after.

use core::cell::Cell;
use core::future::poll_fn;
use core::task::{Poll, Waker};

use embassy_executor::raw::Executor;

use crate::hal::byte::SharedByte;
use crate::hal::ring::Ceiling;

const UCSR3B: *mut u8 = 0x131 as *mut u8;
const TXEN3: u8 = 1 << 3;
const UDRIE3: u8 = 1 << 5;

/// Exec runs, or may not run.
static CLOSED: SharedByte = SharedByte::new(1);
/// Exec was asked for meanwhile.
static MISSED: SharedByte = SharedByte::new(0);

struct Context {
    executor: Cell<Option<&'static Executor>>,
    waker: Cell<Option<Waker>>,
}

// SAFETY: written at start-up, with exec closed, and by exec itself.
unsafe impl Sync for Context {}

static CONTEXT: Context = Context { executor: Cell::new(None), waker: Cell::new(None) };

/// Asks for exec to run. Any level.
#[inline(always)]
pub fn pend() {
    // SAFETY: the register has two values, written whole: no read-modify-write to tear.
    unsafe { UCSR3B.write_volatile(TXEN3 | UDRIE3) };
}

#[inline(always)]
fn withdraw() {
    // SAFETY: as in `pend`.
    unsafe { UCSR3B.write_volatile(TXEN3) };
}

/// Lets exec run from now on.
pub fn start(executor: &'static Executor) {
    CONTEXT.executor.set(Some(executor));
    CLOSED.set(0);
    pend();
}

/// Runs `critical` while exec cannot run. Thread mode only; everything else goes on.
pub fn lock<R>(critical: impl FnOnce(&Ceiling) -> R) -> R {
    CLOSED.set(1);
    let result = critical(&Ceiling(()));
    CLOSED.set(0);
    if MISSED.get() != 0 {
        MISSED.set(0);
        pend();
    }
    result
}

/// Waits until `ready` gives a value, asking again each time exec is pended. For the exec task.
pub async fn wait<R>(mut ready: impl FnMut() -> Option<R>) -> R {
    poll_fn(|cx| match ready() {
        Some(value) => Poll::Ready(value),
        None => {
            CONTEXT.waker.set(Some(cx.waker().clone()));
            Poll::Pending
        }
    })
    .await
}

#[avr_device::interrupt(atmega2560)]
fn USART3_UDRE() {
    withdraw();
    if CLOSED.get() != 0 {
        MISSED.set(1);
        return;
    }
    CLOSED.set(1);
    loop {
        MISSED.set(0);
        // SAFETY: this handler cannot nest: `CLOSED` is set.
        unsafe { avr_device::interrupt::enable() };
        poll();
        avr_device::interrupt::disable();
        if MISSED.get() == 0 {
            break;
        }
    }
    CLOSED.set(0);
}

#[inline(never)]
fn poll() {
    if let Some(waker) = CONTEXT.waker.take() {
        waker.wake();
    }
    if let Some(executor) = CONTEXT.executor.get() {
        // SAFETY: the only place that polls it, and it does not nest.
        unsafe { executor.poll() };
    }
}
