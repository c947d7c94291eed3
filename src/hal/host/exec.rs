//! Level 2 on the host: the exec executor runs between polls of the main one, never inside them.

use core::cell::Cell;
use core::future::poll_fn;
use core::task::{Poll, Waker};

use super::Local;
use crate::hal::ring::Ceiling;

struct Waiting(Cell<Option<Waker>>);

machine_static! {
    fn pended() -> Local<bool> = Local::new(false);
    fn patient() -> Local<bool> = Local::new(false);
    fn waiting() -> Waiting = Waiting(Cell::new(None));
}

/// Asks for exec to run.
pub fn pend() {
    pended().set(true);
}

/// Asks for exec to run when thread mode has nothing left to do. Exec only.
pub fn pend_when_idle() {
    patient().set(true);
}

/// Thread mode has nothing left to do. Whether exec runs then.
pub(super) fn idle() -> bool {
    let runs = patient().get();
    if runs {
        patient().set(false);
        pend();
    }
    runs
}

/// Whether exec was asked for; withdraws the request and wakes the exec task.
pub(super) fn take_request() -> bool {
    if !pended().get() {
        return false;
    }
    if let Some(waker) = waiting().0.take() {
        waker.wake();
    }
    pended().set(false);
    true
}

/// Runs `critical` while exec cannot run.
pub fn lock<R>(critical: impl FnOnce(&Ceiling) -> R) -> R {
    critical(&Ceiling(()))
}

/// Waits until `ready` gives a value, asking again each time exec is pended. For the exec task.
pub fn wait<R>(mut ready: impl FnMut() -> Option<R>) -> impl Future<Output = R> {
    poll_fn(move |cx| match ready() {
        Some(value) => Poll::Ready(value),
        None => {
            waiting().0.set(Some(cx.waker().clone()));
            Poll::Pending
        }
    })
}
