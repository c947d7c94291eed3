//! The interrupt executor: its tasks preempt those of thread mode, and every short interrupt preempts them.
//!
//! The executor is polled from a software interrupt, which [`pend`] raises and which runs with interrupts on. Two
//! things keep that interrupt out: its own handler while it runs, and [`lock`], with which thread mode touches what
//! it shares with interrupt mode (a priority ceiling). In both cases the request is remembered and served right
//! after.
//!
//! Its tasks may use all of Embassy: a `Signal`, a `Channel` or a `Waker` works between thread mode and these tasks,
//! in both directions. Handlers of other interrupts must not use them: they call [`pend`], and the task that
//! [`wait`]s asks again. The main loop serves the `Timer` of a task, so it comes as late as the longest poll of a
//! thread-mode task.
//!
//! | | cycles |
//! |---|---|
//! | from [`pend`] to the task that [`wait`]s | 221 |
//! | interrupts off on the way in and out | 14, 17; 25 if it comes again at once |

use core::future::poll_fn;
use core::task::{Poll, Waker};

use embassy_executor::raw::{TaskRef, task_from_waker, wake_task};

use crate::{Ceiling, Interrupt, Thread};

#[cfg(target_os = "none")]
mod asked;

#[cfg(target_arch = "avr")]
mod avr;
#[cfg(target_arch = "avr")]
use avr as imp;
#[cfg(target_arch = "avr")]
pub use avr::start;
#[cfg(target_arch = "avr")]
pub(crate) use avr::{handler, idle};

#[cfg(feature = "_cortex-m")]
mod cortex_m;
#[cfg(feature = "_cortex-m")]
use cortex_m as imp;
#[cfg(feature = "_cortex-m")]
pub use cortex_m::start;
#[cfg(feature = "_cortex-m")]
pub(crate) use cortex_m::{idle, run};

#[cfg(not(target_os = "none"))]
mod host;
#[cfg(not(target_os = "none"))]
use host as imp;
#[cfg(not(target_os = "none"))]
pub use host::start;
#[cfg(not(target_os = "none"))]
pub(crate) use host::{executor, idle, take_request};

pub(crate) use imp::woken;

#[cfg(feature = "_cortex-m")]
pub mod prompt;
#[cfg(feature = "_cortex-m")]
pub(crate) use prompt::is_prompt;

/// Whether a task of the prompt executor has been woken: always false, because this chip has no such executor.
#[cfg(not(feature = "_cortex-m"))]
#[inline(always)]
pub(crate) fn is_prompt(_context: *mut ()) -> bool {
    false
}

/// Asks for the interrupt executor to run. Any level. Cost: 3 cycles.
///
/// If thread mode calls it, the executor runs before the next instruction but one; if a handler does, the executor
/// runs when all handlers that run have ended. Requests that have come by then merge into one run.
#[inline(always)]
pub fn pend() {
    imp::pend();
}

/// Asks for the interrupt executor to run when thread mode has nothing left to do: for work that may wait. Interrupt
/// mode.
pub fn pend_when_idle() {
    imp::pend_when_idle();
}

/// From now on [`was_idle`] records whether thread mode has had nothing left to do. Interrupt mode.
pub fn note_idle() {
    imp::note_idle();
}

/// Whether thread mode has had nothing left to do since [`pend_when_idle`] or [`note_idle`]. Interrupt mode.
pub fn was_idle() -> bool {
    imp::was_idle()
}

/// Runs `critical` while the interrupt executor cannot run; all other interrupts go on. Locks nest. Cost: 13 cycles;
/// the interrupt executor may come later by the time that `critical` takes.
#[inline(always)]
pub fn lock<R>(_: Thread, critical: impl FnOnce(&Ceiling) -> R) -> R {
    let before = imp::close();
    let result = critical(&Ceiling::new());
    imp::open(before);
    result
}

/// Waits until `ready` returns a value. Asks now, and each time the executor is pended. This is how a handler reaches
/// a task.
///
/// Only one task may wait in this way. If a second one does, both go on asking and the executor runs without end: use
/// Embassy's means between tasks.
pub fn wait<R>(level: Interrupt, mut ready: impl FnMut() -> Option<R>) -> impl Future<Output = R> {
    poll_fn(move |cx| match ready() {
        Some(value) => Poll::Ready(value),
        None => {
            imp::keep(level, cx.waker());
            Poll::Pending
        }
    })
}

/// From now on a slot of [`wait`] holds this task. A task that the slot held before is woken; it asks again and is
/// stored again.
fn keep(kept: &mut Option<TaskRef>, waker: &Waker) {
    let task = task_from_waker(waker);
    if *kept != Some(task)
        && let Some(before) = kept.replace(task)
    {
        wake_task(before);
    }
}
