//! Level 2 on the host: the exec executor runs between polls of the main one, never inside them.

use core::cell::Cell;
use core::future::poll_fn;
use core::task::{Poll, Waker};

use super::Local;
use crate::hal::ring::Ceiling;

/// What exec wants of the time when nobody else has anything to do.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Wanted {
    Nothing,
    GoOn,
    Tell,
}

struct Waiting(Cell<Option<Waker>>);

machine_static! {
    fn pended() -> Local<bool> = Local::new(false);
    fn wanted() -> Local<Wanted> = Local::new(Wanted::Nothing);
    fn waiting() -> Waiting = Waiting(Cell::new(None));
}

/// Asks for exec to run.
pub fn pend() {
    pended().set(true);
}

/// Asks for exec to run when thread mode has nothing left to do. Exec only.
pub fn pend_when_idle() {
    wanted().set(Wanted::GoOn);
}

/// [`was_idle`] is to say whether thread mode has had nothing left to do from now on. Exec only.
pub fn note_idle() {
    wanted().set(Wanted::Tell);
}

/// Whether thread mode has had nothing left to do since [`pend_when_idle`] or [`note_idle`]. Exec only.
pub fn was_idle() -> bool {
    wanted().get() == Wanted::Nothing
}

/// Thread mode has nothing left to do. Whether exec runs then.
pub(super) fn idle() -> bool {
    let runs = wanted().get() == Wanted::GoOn;
    wanted().set(Wanted::Nothing);
    if runs {
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
