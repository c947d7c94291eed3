//! The interrupt executor on Cortex-M: `embassy_executor`'s, polled from an interrupt that no peripheral raises.
//!
//! The interrupt controller does what the AVR does by hand: it keeps a request while the interrupt is disabled or
//! runs, and lets interrupts of higher priority in. So the ceiling lock only disables that one interrupt. Critical
//! sections of other crates mask all interrupts.

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

/// Not 0: the executor has been started.
static STARTED: SharedByte = SharedByte::new(0);

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
    NVIC::pend(Software);
}

/// Asks for the executor: one of its tasks was woken.
#[inline(always)]
pub fn woken() {
    pend();
}

/// Starts the interrupt executor: `init` spawns its first tasks, and the result spawns more, from any task. `None` if
/// it has been started before.
///
/// The tasks are polled as soon as interrupts are on. The program sets the priority of the interrupt, below that of
/// all handlers.
pub fn start(init: impl FnOnce(Spawner, Interrupt) + Send) -> Option<SendSpawner> {
    if STARTED.get() != 0 {
        return None;
    }
    STARTED.set(1);
    // SAFETY: this runs once, before the software interrupt is let in. What `init` captures is `Send`; interrupt mode
    // does not run yet, so this code stands for interrupt mode and may have its token.
    let (spawner, level) = unsafe {
        (*CONTEXT.executor.get()).write(Executor::new(pender::INTERRUPT));
        (executor().spawner(), Interrupt::assume())
    };
    init(spawner, level);
    // SAFETY: everything that its handler touches has been made.
    unsafe { NVIC::unmask(Software) };
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

/// Keeps the interrupt executor out. Returns whether it was let in before, for [`open`].
#[inline(always)]
pub fn close() -> bool {
    let before = NVIC::is_enabled(Software);
    NVIC::mask(Software);
    // After these barriers the interrupt cannot come any more, not even if it was on its way.
    dsb();
    isb();
    before
}

/// Undoes [`close`]. If the executor was asked for meanwhile, it runs at once.
#[inline(always)]
pub fn open(before: bool) {
    if before {
        // SAFETY: the interrupt is as it was before.
        unsafe { NVIC::unmask(Software) };
    }
}

/// Keeps the task that waits in [`wait`](super::wait).
pub fn keep(_: Interrupt, waker: &Waker) {
    // SAFETY: interrupt mode runs, and no reference outlives a call of this or `run`'s wake.
    super::keep(unsafe { &mut *CONTEXT.task.get() }, waker);
}

/// Polls the executor. The software interrupt calls it, which is enabled after the executor has been made.
pub(crate) fn run() {
    // SAFETY: as in `keep`; no task runs yet.
    if let Some(task) = unsafe { *CONTEXT.task.get() } {
        wake_task_no_pend(task);
    }
    // SAFETY: only this function polls the executor, and it does not nest.
    unsafe { executor().poll() };
}
