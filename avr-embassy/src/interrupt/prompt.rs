//! The prompt executor, on a software interrupt of its own: its tasks preempt those of thread mode and of interrupt
//! mode.
//!
//! It is for tasks of a driver that answer the hardware, such as those of USB. They may use all of Embassy, but not
//! what thread mode and interrupt mode share by the ceiling lock: that lock does not hold them off.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use cortex_m::peripheral::NVIC;
use embassy_executor::Spawner;
use embassy_executor::raw::Executor;

use crate::byte::SharedByte;
use crate::chip::Prompt;

/// The context by which the pender recognizes tasks of this executor.
const CONTEXT: *mut () = core::ptr::without_provenance_mut(2);

/// Not 0: the executor has been started.
static STARTED: SharedByte = SharedByte::new(0);

struct Place(UnsafeCell<MaybeUninit<Executor>>);

// SAFETY: `start` writes it before it lets the interrupt in; from then on only the interrupt touches it.
unsafe impl Sync for Place {}

static EXECUTOR: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));

/// Asks for the executor to run if the woken task is one of its own. Returns whether it is.
#[inline(always)]
pub(crate) fn is_prompt(context: *mut ()) -> bool {
    let is_own = context == CONTEXT;
    if is_own {
        NVIC::pend(Prompt);
    }
    is_own
}

/// Starts the executor: `init` spawns its tasks. Does nothing if it has been started before. The program sets the
/// priority of the interrupt.
pub fn start(init: impl FnOnce(Spawner)) {
    if STARTED.get() != 0 {
        return;
    }
    STARTED.set(1);
    // SAFETY: this runs once, before the interrupt is let in.
    unsafe {
        (*EXECUTOR.0.get()).write(Executor::new(CONTEXT));
        init(executor().spawner());
        NVIC::unmask(Prompt);
    }
    NVIC::pend(Prompt);
}

/// # Safety
/// The executor has been made.
unsafe fn executor() -> &'static Executor {
    // SAFETY: the caller says so.
    unsafe { (*EXECUTOR.0.get()).assume_init_ref() }
}

/// Polls the executor. The software interrupt calls it, which is enabled after the executor has been made.
pub(crate) fn run() {
    // SAFETY: only this function polls the executor, and it does not nest.
    unsafe { executor().poll() };
}
