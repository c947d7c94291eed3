//! The interrupt executor on AVR.

use core::arch::asm;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::task::Waker;

use embassy_executor::raw::{Executor, TaskRef, wake_task_no_pend};
use embassy_executor::{SendSpawner, Spawner};

use crate::assembly::{CLOSED, FLAGS, HELD, HOLD, MISSED, NOT_STARTED, PEND, PENDED};
use crate::chip::{self, WITHDRAWN};
use crate::{Interrupt, pender};

pub use super::asked::{idle, note_idle, pend_when_idle, was_idle};

struct Context {
    executor: UnsafeCell<MaybeUninit<Executor>>,
    /// The task that waits for [`pend`](super::pend).
    task: UnsafeCell<Option<TaskRef>>,
}

// SAFETY: `start` writes the executor before it lets the software interrupt in; only that interrupt touches the rest.
unsafe impl Sync for Context {}

static CONTEXT: Context =
    Context { executor: UnsafeCell::new(MaybeUninit::uninit()), task: UnsafeCell::new(None) };

#[inline(always)]
pub fn pend() {
    // SAFETY: the register has two values, written whole: no read-modify-write to tear.
    unsafe { (PEND as *mut u8).write_volatile(PENDED) };
}

/// Records that one of the executor's tasks was woken. The ceiling is closed now, so the executor runs when the ceiling
/// opens.
#[inline(always)]
pub fn woken() {
    MISSED.set(1);
}

/// Starts the interrupt executor: `init` spawns its first tasks, and the result spawns more, from any task. `None` if
/// it has been started before, or if called within [`lock`](super::lock).
///
/// Call it before [`Executor::run`](crate::Executor::run): the tasks are polled as soon as interrupts are on.
#[inline(always)]
pub fn start(init: impl FnOnce(Spawner, Interrupt) + Send) -> Option<SendSpawner> {
    if CLOSED.get() != NOT_STARTED {
        return None;
    }
    chip::link();
    // SAFETY: this runs once, before the software interrupt is let in. What `init` captures is `Send`; interrupt mode
    // does not run yet, so this code stands for interrupt mode and may have its token.
    let (spawner, level) = unsafe {
        (*CONTEXT.executor.get()).write(Executor::new(pender::INTERRUPT));
        (executor().spawner(), Interrupt::assume())
    };
    init(spawner, level);
    CLOSED.set(0);
    pend();
    Some(spawner.make_send())
}

/// # Safety
/// The executor has been made.
#[inline(always)]
unsafe fn executor() -> &'static Executor {
    // SAFETY: the caller says so.
    unsafe { (*CONTEXT.executor.get()).assume_init_ref() }
}

/// Keeps the interrupt executor out. Returns the previous value of [`CLOSED`], for [`open`].
#[inline(always)]
pub fn close() -> u8 {
    let before = CLOSED.get();
    CLOSED.set(1);
    before
}

/// Undoes [`close`]. Lets the executor in at once if it was asked for meanwhile.
#[inline(always)]
pub fn open(before: u8) {
    CLOSED.set(before);
    if before == 0 && MISSED.get() != 0 {
        MISSED.set(0);
        pend();
    }
}

struct CeilingSection;
critical_section::set_impl!(CeilingSection);

// SAFETY: critical sections (the executors' run queues, Embassy's channels) are entered by thread mode and by
// interrupt mode, and by no other interrupt. Keeping interrupt mode out while thread mode is in a critical section
// keeps the two apart. While interrupt mode runs, or before it has been started, `CLOSED` is set anyway.
unsafe impl critical_section::Impl for CeilingSection {
    unsafe fn acquire() -> u8 {
        close()
    }

    unsafe fn release(before: u8) {
        open(before);
    }
}

/// Keeps the task that waits in [`wait`](super::wait).
pub fn keep(_: Interrupt, waker: &Waker) {
    // SAFETY: interrupt mode runs, and no reference outlives a call of this or `poll`'s wake.
    super::keep(unsafe { &mut *CONTEXT.task.get() }, waker);
}

/// The software interrupt: polls the executor, with interrupts on.
///
/// Interrupts are off for 14 cycles on the way in and 17 on the way out, 25 if it comes again at once.
///
/// # Safety
/// It is the handler of that interrupt, and nothing else calls it.
#[inline(always)]
pub unsafe fn handler() -> ! {
    // SAFETY: it restores what it changes and what a called function may change, and returns by
    // `reti`. `CLOSED` keeps it from nesting while interrupts are on.
    unsafe {
        asm!(
            "push r24",
            "ldi  r24, {withdrawn}",
            "sts  {pend}, r24",
            // If the interrupt comes again before `CLOSED` is set, the second one runs first and this one after it.
            "sei",
            "in   r24, 0x3F",
            // Interrupts stay off from `out` to `reti`: an interrupt that comes again at once must not pile up on the
            // stack.
            "andi r24, 0x7F",
            "push r24",
            "sbic {flags}, {hold}",
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
            // The executor was asked for meanwhile: it comes again at once.
            "3:",
            "ldi  r24, {pended}",
            "sts  {pend}, r24",
            "ldi  r24, 0",
            "rjmp 1b",
            // The executor must not run now: remember the request.
            "8:",
            "sbi  {flags}, {held}",
            "rjmp 2b",
            "9:",
            "ldi  r24, 1",
            "sts  {missed}, r24",
            "rjmp 2b",
            flags = const FLAGS,
            pend = const PEND,
            withdrawn = const WITHDRAWN,
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

/// Polls the executor. The software interrupt calls it.
extern "C" fn poll() {
    // Requests up to now are served by this poll.
    MISSED.set(0);
    // SAFETY: as in `keep`; no task runs yet.
    if let Some(task) = unsafe { *CONTEXT.task.get() } {
        wake_task_no_pend(task);
    }
    // SAFETY: only this function polls the executor, and it does not nest; `CLOSED` was open, so the executor has
    // been made.
    unsafe { executor().poll() };
}
