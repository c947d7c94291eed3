//! Level 2 on the host: the exec executor runs between polls of the main one, never inside them.

use core::cell::Cell;
use core::future::poll_fn;
use core::task::{Poll, Waker};

use super::Local;
use crate::hal::ring::Ceiling;

struct Waiting(Cell<Option<Waker>>);

machine_static! {
    fn pended() -> Local<bool> = Local::new(false);
    fn waits() -> Local<bool> = Local::new(false);
    fn may_run() -> Local<bool> = Local::new(false);
    fn waiting() -> Waiting = Waiting(Cell::new(None));
}

/// Asks for exec to run.
pub fn pend() {
    pended().set(true);
}

/// Whether thread mode has had nothing left to do since this was asked last; else exec is pended when that is so.
/// Exec only.
pub fn when_idle() -> bool {
    let done = may_run().get();
    may_run().set(false);
    waits().set(!done);
    done
}

/// Thread mode has nothing left to do. Whether exec runs then.
pub(super) fn idle() -> bool {
    let runs = waits().get();
    if runs {
        waits().set(false);
        may_run().set(true);
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
pub async fn wait<R>(mut ready: impl FnMut() -> Option<R>) -> R {
    poll_fn(|cx| match ready() {
        Some(value) => Poll::Ready(value),
        None => {
            waiting().0.set(Some(cx.waker().clone()));
            Poll::Pending
        }
    })
    .await
}
