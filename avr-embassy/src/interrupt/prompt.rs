//! One more executor, on a software interrupt of its own: its tasks preempt those of thread mode and of interrupt mode.
//!
//! It is for tasks of a driver that answer the hardware, such as those of USB. They may use all of Embassy, but not what thread mode and
//! interrupt mode share by the ceiling lock, which does not hold them off.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use cortex_m::peripheral::NVIC;
use embassy_executor::Spawner;
use embassy_executor::raw::Executor;

use crate::byte::SharedByte;
use crate::chip::Prompt;

/// What tells the pender its tasks from those of the others.
const CONTEXT: *mut () = core::ptr::without_provenance_mut(2);

/// Not 0: it has been started.
static STARTED: SharedByte = SharedByte::new(0);

struct Place(UnsafeCell<MaybeUninit<Executor>>);

// SAFETY: `start` writes it before it lets the interrupt in, which alone touches it then.
unsafe impl Sync for Place {}

static EXECUTOR: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));

/// A task was woken: asks for the executor if it is one of its own, and says so.
#[inline(always)]
pub(crate) fn is_prompt(context: *mut ()) -> bool {
    let is_own = context == CONTEXT;
    if is_own {
        NVIC::pend(Prompt);
    }
    is_own
}

/// Starts it: `init` spawns its tasks. Start-up; does nothing if it has been started before. The priority of the interrupt is the program's to set.
pub fn start(init: impl FnOnce(Spawner)) {
    if STARTED.get() != 0 {
        return;
    }
    STARTED.set(1);
    // SAFETY: once, before the interrupt is let in.
    unsafe {
        (*EXECUTOR.0.get()).write(Executor::new(CONTEXT));
        init(executor().spawner());
        NVIC::unmask(Prompt);
    }
    NVIC::pend(Prompt);
}

/// # Safety
/// It has been made.
unsafe fn executor() -> &'static Executor {
    // SAFETY: the caller says so.
    unsafe { (*EXECUTOR.0.get()).assume_init_ref() }
}

/// What the interrupt runs. It is enabled once the executor has been made.
pub(crate) fn run() {
    // SAFETY: the only place that polls it, and it does not nest.
    unsafe { executor().poll() };
}
