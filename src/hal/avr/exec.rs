//! Level 2: the exec executor, polled from a software interrupt.
//!
//! The interrupt is USART2's data-register-empty: that transmitter never sends, so its condition
//! always holds, and setting or clearing the enable bit raises or withdraws the interrupt. It runs
//! with interrupts on, so the step interrupt and the short ones go on.
//!
//! Two things keep it out: itself, while it runs, and [`lock`], with which thread mode touches what
//! exec reads (a priority ceiling). Either way the request is remembered and served right after.

use core::arch::asm;
use core::cell::{Cell, UnsafeCell};
use core::future::poll_fn;
use core::task::{Poll, Waker};

use embassy_executor::raw::Executor;

use crate::hal::byte::SharedByte;
use crate::hal::ring::Ceiling;

const UCSR2B: *mut u8 = 0xD1 as *mut u8;
const TXEN2: u8 = 1 << 3;
const UDRIE2: u8 = 1 << 5;
/// What raises the interrupt.
pub(super) const PENDED: u8 = TXEN2 | UDRIE2;
/// Bit of general-purpose register 0: an interrupt is under way that exec must not delay. Its twin is
/// [`HELD`]. Neither is ever seen set in thread mode.
pub(super) const HOLD: u8 = 5;
/// Exec was asked for meanwhile; that interrupt will pend it at its end.
pub(super) const HELD: u8 = 6;

/// Exec runs, or may not run.
pub(super) static CLOSED: SharedByte = SharedByte::new(1);
/// Exec was asked for meanwhile.
pub(super) static MISSED: SharedByte = SharedByte::new(0);

/// What exec has asked for last, for when nobody else has anything to do: a number, and whether to go on then
/// ([`GO_ON`]). Written by exec only.
static ASKED: SharedByte = SharedByte::new(0);
const GO_ON: u8 = 1;
const NEXT: u8 = 2;
/// What of that thread mode, the only writer, has seen with nothing left to do.
static SEEN: SharedByte = SharedByte::new(0);

struct Context {
    executor: Cell<Option<&'static Executor>>,
    /// Of the exec task, the only one; from its first wait on.
    waker: UnsafeCell<Option<Waker>>,
}

// SAFETY: written at start-up, with exec closed, and by exec itself.
unsafe impl Sync for Context {}

static CONTEXT: Context = Context { executor: Cell::new(None), waker: UnsafeCell::new(None) };

/// Asks for exec to run. Any level.
#[inline(always)]
pub fn pend() {
    // SAFETY: the register has two values, written whole: no read-modify-write to tear.
    unsafe { UCSR2B.write_volatile(PENDED) };
}

/// Asks for exec to run when thread mode has nothing left to do. Exec only.
pub fn pend_when_idle() {
    ASKED.set(ASKED.get().wrapping_add(NEXT) | GO_ON);
}

/// [`was_idle`] is to say whether thread mode has had nothing left to do from now on. Exec only.
pub fn note_idle() {
    ASKED.set(ASKED.get().wrapping_add(NEXT) & !GO_ON);
}

/// Whether thread mode has had nothing left to do since [`pend_when_idle`] or [`note_idle`]. Exec only.
pub fn was_idle() -> bool {
    SEEN.get() == ASKED.get()
}

/// Thread mode has nothing left to do.
#[inline(always)]
pub(super) fn idle() {
    // Exec may ask for something else in between: it is seen the next time.
    let asked = ASKED.get();
    if SEEN.get() != asked {
        SEEN.set(asked);
        if asked & GO_ON != 0 {
            pend();
        }
    }
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
    open();
    result
}

/// Lets exec in again, at once if it was asked for meanwhile.
#[inline(always)]
fn open() {
    CLOSED.set(0);
    if MISSED.get() != 0 {
        MISSED.set(0);
        pend();
    }
}

struct CeilingSection;
critical_section::set_impl!(CeilingSection);

// SAFETY: critical sections (the executors' run queues) are entered by thread mode and by exec, and by
// no other interrupt: keeping exec out while thread mode is in one keeps them apart. While exec runs,
// or before it has been started, `CLOSED` is set anyway.
unsafe impl critical_section::Impl for CeilingSection {
    unsafe fn acquire() -> bool {
        let closed = CLOSED.get() != 0;
        CLOSED.set(1);
        closed
    }

    unsafe fn release(closed: bool) {
        if !closed {
            open();
        }
    }
}

/// Waits until `ready` gives a value, asking again each time exec is pended. For the exec task.
pub fn wait<R>(mut ready: impl FnMut() -> Option<R>) -> impl Future<Output = R> {
    poll_fn(move |cx| match ready() {
        Some(value) => Poll::Ready(value),
        None => {
            keep(cx.waker());
            Poll::Pending
        }
    })
}

/// Keeps the exec task's waker, which is the same each time.
fn keep(waker: &Waker) {
    // SAFETY: exec runs, and no reference outlives a call of this or `poll`'s wake.
    let kept = unsafe { &mut *CONTEXT.waker.get() };
    if kept.is_none() {
        *kept = Some(waker.clone());
    }
}

/// USART2_UDRE: runs exec, with interrupts on.
///
/// Interrupts are off for 14 cycles on the way in and 17 on the way out, 25 if it comes again at once.
#[unsafe(no_mangle)]
extern "C" fn __vector_52() -> ! {
    // SAFETY: it restores what it changes and what a called function may change, and returns by
    // `reti`. `CLOSED` keeps it from nesting while interrupts are on.
    unsafe {
        asm!(
            "push r24",
            "ldi  r24, {idle}",
            "sts  0xD1, r24",
            // Should it come again before `CLOSED` is set, then it runs first and this one after it.
            "sei",
            "in   r24, 0x3F",
            // Interrupts stay off from `out` to `reti`: one that comes again at once must not pile up.
            "andi r24, 0x7F",
            "push r24",
            "sbic 0x1E, {hold}",
            "rjmp 8f",
            "lds  r24, {closed}",
            "tst  r24",
            "brne 9f",
            "inc  r24",
            "sts  {closed}, r24",
            "push r0",
            "push r1",
            "push r18",
            "push r19",
            "push r20",
            "push r21",
            "push r22",
            "push r23",
            "push r25",
            "push r26",
            "push r27",
            "push r30",
            "push r31",
            "clr  r1",
            "sts  {missed}, r1",
            "call {poll}",
            "pop  r31",
            "pop  r30",
            "pop  r27",
            "pop  r26",
            "pop  r25",
            "pop  r23",
            "pop  r22",
            "pop  r21",
            "pop  r20",
            "pop  r19",
            "pop  r18",
            "pop  r1",
            "pop  r0",
            "cli",
            "lds  r24, {missed}",
            "tst  r24",
            "brne 3f",
            "1:",
            "sts  {closed}, r24",
            "2:",
            "pop  r24",
            "out  0x3F, r24",
            "pop  r24",
            "reti",
            // Asked for meanwhile: it comes again at once.
            "3:",
            "ldi  r24, {pended}",
            "sts  0xD1, r24",
            "ldi  r24, 0",
            "rjmp 1b",
            // Not now: remember it.
            "8:",
            "sbi  0x1E, {held}",
            "rjmp 2b",
            "9:",
            "ldi  r24, 1",
            "sts  {missed}, r24",
            "rjmp 2b",
            idle = const TXEN2,
            pended = const PENDED,
            hold = const HOLD,
            held = const HELD,
            closed = sym CLOSED,
            missed = sym MISSED,
            poll = sym poll,
            options(noreturn),
        );
    }
}

/// What the interrupt runs.
extern "C" fn poll() {
    // SAFETY: as in `keep`; the task does not run yet.
    if let Some(waker) = unsafe { &*CONTEXT.waker.get() } {
        waker.wake_by_ref();
    }
    if let Some(executor) = CONTEXT.executor.get() {
        // SAFETY: the only place that polls it, and it does not nest.
        unsafe { executor.poll() };
    }
}
