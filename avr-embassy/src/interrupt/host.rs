//! The interrupt executor on the host: it runs between polls of the thread-mode executor, never inside them.

use std::boxed::Box;
use std::cell::Cell;
use std::task::Waker;

use embassy_executor::raw::{Executor, TaskRef, wake_task};
use embassy_executor::{SendSpawner, Spawner};

use crate::{Interrupt, pender};

/// The request of interrupt mode for the moment when thread mode has nothing left to do.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Wanted {
    Nothing,
    GoOn,
    Tell,
}

#[derive(Clone, Copy)]
struct State {
    pended: bool,
    wanted: Wanted,
}

std::thread_local! {
    static STATE: Cell<State> = const { Cell::new(State { pended: false, wanted: Wanted::Nothing }) };
    static EXECUTOR: Cell<Option<&'static Executor>> = const { Cell::new(None) };
    static WAITING: Cell<Option<TaskRef>> = const { Cell::new(None) };
}

/// Starts the interrupt executor of this thread's machine: `init` spawns its first tasks, and the result spawns more.
/// `None` if it has been started before.
pub fn start(init: impl FnOnce(Spawner, Interrupt) + Send) -> Option<SendSpawner> {
    if EXECUTOR.get().is_some() {
        return None;
    }
    let executor = &*Box::leak(Box::new(Executor::new(pender::INTERRUPT)));
    EXECUTOR.set(Some(executor));
    // SAFETY: what `init` spawns are tasks of interrupt mode, which may have the token.
    init(executor.spawner(), unsafe { Interrupt::assume() });
    pend();
    Some(executor.spawner().make_send())
}

/// Returns the executor that `start` has made; `None` before.
pub fn executor() -> Option<&'static Executor> {
    EXECUTOR.get()
}

fn change(change: impl FnOnce(&mut State)) {
    let mut state = STATE.get();
    change(&mut state);
    STATE.set(state);
}

pub fn pend() {
    change(|state| state.pended = true);
}

pub fn woken() {
    pend();
}

pub fn pend_when_idle() {
    change(|state| state.wanted = Wanted::GoOn);
}

pub fn note_idle() {
    change(|state| state.wanted = Wanted::Tell);
}

pub fn was_idle() -> bool {
    STATE.get().wanted == Wanted::Nothing
}

/// Serves the request: thread mode has nothing left to do. Returns whether the interrupt executor runs now.
pub fn idle() -> bool {
    let runs = STATE.get().wanted == Wanted::GoOn;
    change(|state| state.wanted = Wanted::Nothing);
    if runs {
        pend();
    }
    runs
}

/// Whether the executor was asked for. Withdraws the request, and wakes the task that waits.
pub fn take_request() -> bool {
    if !STATE.get().pended {
        return false;
    }
    if let Some(task) = WAITING.get() {
        wake_task(task);
    }
    change(|state| state.pended = false);
    true
}

pub fn close() -> bool {
    false
}

pub fn open(_: bool) {}

pub fn keep(_: Interrupt, waker: &Waker) {
    let mut kept = WAITING.get();
    super::keep(&mut kept, waker);
    WAITING.set(kept);
}
