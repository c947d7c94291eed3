//! The interrupt executor on Cortex-M: `embassy_executor`'s, polled from an interrupt that no peripheral raises.
//!
//! The controller of interrupts does what the AVR does by hand: it keeps a request while the interrupt is disabled or runs, and lets those
//! of higher priority in. So the ceiling lock disables that one interrupt. Other crates' critical sections mask all.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::task::Waker;

use cortex_m::asm::{dsb, isb};
use cortex_m::peripheral::NVIC;
use embassy_executor::raw::{Executor, TaskRef, wake_task_no_pend};
use embassy_executor::{SendSpawner, Spawner};

use crate::byte::SharedByte;
use crate::chip::Software;
use crate::{Interrupt, pender};

pub use super::asked::{idle, note_idle, pend_when_idle, was_idle};

/// Not 0: it has been started.
static STARTED: SharedByte = SharedByte::new(0);

struct Context {
    executor: UnsafeCell<MaybeUninit<Executor>>,
    /// The task that waits for [`pend`](super::pend).
    task: UnsafeCell<Option<TaskRef>>,
}

// SAFETY: `start` writes the executor before it lets the software interrupt in; the rest is touched by that only.
unsafe impl Sync for Context {}

static CONTEXT: Context =
    Context { executor: UnsafeCell::new(MaybeUninit::uninit()), task: UnsafeCell::new(None) };

#[inline(always)]
pub fn pend() {
    NVIC::pend(Software);
}

/// A task of it was woken.
#[inline(always)]
pub fn woken() {
    pend();
}

/// Starts the interrupt executor: `init` spawns its first tasks, and the result spawns more, from any task. `None` if it
/// has been started before.
///
/// Its tasks are polled as soon as interrupts are on; its priority is the program's to set, below that of all handlers.
pub fn start(init: impl FnOnce(Spawner, Interrupt) + Send) -> Option<SendSpawner> {
    if STARTED.get() != 0 {
        return None;
    }
    STARTED.set(1);
    // SAFETY: once, before the software interrupt is let in. What `init` takes along is `Send`; interrupt mode does not
    // run yet, so the token stands for it.
    let (spawner, level) = unsafe {
        (*CONTEXT.executor.get()).write(Executor::new(pender::INTERRUPT));
        (executor().spawner(), Interrupt::assume())
    };
    init(spawner, level);
    // SAFETY: what its handler touches has been made.
    unsafe { NVIC::unmask(Software) };
    pend();
    Some(spawner.make_send())
}

/// # Safety
/// It has been made.
#[inline(always)]
unsafe fn executor() -> &'static Executor {
    // SAFETY: the caller says so.
    unsafe { (*CONTEXT.executor.get()).assume_init_ref() }
}

/// Keeps the interrupt executor out. Whether it was let in before, for [`open`].
#[inline(always)]
pub fn close() -> bool {
    let before = NVIC::is_enabled(Software);
    NVIC::mask(Software);
    // From here on it cannot come, not even if it was on its way.
    dsb();
    isb();
    before
}

/// Takes that back; one that was asked for meanwhile comes at once.
#[inline(always)]
pub fn open(before: bool) {
    if before {
        // SAFETY: as it was before.
        unsafe { NVIC::unmask(Software) };
    }
}

/// Keeps the task that waits.
pub fn keep(_: Interrupt, waker: &Waker) {
    // SAFETY: interrupt mode runs, and no reference outlives a call of this or `run`'s wake.
    super::keep(unsafe { &mut *CONTEXT.task.get() }, waker);
}

/// What the interrupt runs. It is enabled once the executor has been made.
pub(crate) fn run() {
    // SAFETY: as in `keep`; no task runs yet.
    if let Some(task) = unsafe { *CONTEXT.task.get() } {
        wake_task_no_pend(task);
    }
    // SAFETY: the only place that polls it, and it does not nest.
    unsafe { executor().poll() };
}
