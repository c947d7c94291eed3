//! The interrupt executor: its tasks preempt those of thread mode, and every short interrupt preempts them.
//!
//! It is polled from a software interrupt, which [`pend`] raises and which runs with interrupts on. Two things keep it
//! out: itself, while it runs, and [`lock`], with which thread mode touches what it shares with its tasks (a priority
//! ceiling). Either way the request is remembered and served right after.
//!
//! Its tasks may use all of Embassy: a `Signal`, a `Channel` or a `Waker` reaches them from thread mode, and them to thread
//! mode. Handlers of other interrupts wake none of these: they [`pend`], and the task that [`wait`]s asks again. A task's
//! `Timer` is looked at by the main loop: it comes as late as the longest poll of a thread-mode task.
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

#[cfg(all(target_arch = "arm", target_os = "none"))]
mod cortex_m;
#[cfg(all(target_arch = "arm", target_os = "none"))]
use cortex_m as imp;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub use cortex_m::start;
#[cfg(all(target_arch = "arm", target_os = "none"))]
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

#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod prompt;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub(crate) use prompt::is_prompt;

/// Whether a task of the prompt executor has been woken: this chip has none.
#[cfg(not(all(target_arch = "arm", target_os = "none")))]
#[inline(always)]
pub(crate) fn is_prompt(_context: *mut ()) -> bool {
    false
}

/// Asks for the interrupt executor to run. Any level. Cost: 3 cycles.
///
/// In thread mode it runs before the next instruction but one; above, when the handlers that run have ended. However often it was
/// asked for by then, it runs once.
#[inline(always)]
pub fn pend() {
    imp::pend();
}

/// Asks for the interrupt executor to run when thread mode has nothing left to do: for work that may wait. Interrupt mode.
pub fn pend_when_idle() {
    imp::pend_when_idle();
}

/// [`was_idle`] is to say whether thread mode has had nothing left to do from now on. Interrupt mode.
pub fn note_idle() {
    imp::note_idle();
}

/// Whether thread mode has had nothing left to do since [`pend_when_idle`] or [`note_idle`]. Interrupt mode.
pub fn was_idle() -> bool {
    imp::was_idle()
}

/// Runs `critical` while the interrupt executor cannot run; everything else goes on. It nests. Cost: 13 cycles, and the
/// interrupt executor may come as much later as `critical` takes.
#[inline(always)]
pub fn lock<R>(_: Thread, critical: impl FnOnce(&Ceiling) -> R) -> R {
    let before = imp::close();
    let result = critical(&Ceiling::new());
    imp::open(before);
    result
}

/// Waits until `ready` gives a value, asking now and each time the executor is pended: how a handler reaches a task.
///
/// One task waits so. If another does too, both go on asking, and the executor runs without end: use Embassy's ways between tasks.
pub fn wait<R>(level: Interrupt, mut ready: impl FnMut() -> Option<R>) -> impl Future<Output = R> {
    poll_fn(move |cx| match ready() {
        Some(value) => Poll::Ready(value),
        None => {
            imp::keep(level, cx.waker());
            Poll::Pending
        }
    })
}

/// What a slot of [`wait`] is to hold from now on: this task. Another one that it held is woken, and comes back.
fn keep(kept: &mut Option<TaskRef>, waker: &Waker) {
    let task = task_from_waker(waker);
    if *kept != Some(task)
        && let Some(before) = kept.replace(task)
    {
        wake_task(before);
    }
}
