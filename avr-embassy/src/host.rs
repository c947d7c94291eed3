//! The stand-in for the chip on the host, so that a program's tasks can be tested there.
//!
//! Each thread is a machine of its own: it has its own event bits, waiting tasks and executors. Nothing happens by
//! itself: a test sets events, and [`Runtime::settle`] lets the tasks react. The test provides the time driver, for
//! example the mock of `embassy-time`.

use std::boxed::Box;

use embassy_executor::Spawner;
use embassy_executor::raw::{Executor, TaskStorage};

use crate::event::{self, flags};
use crate::{Interrupt, Thread, interrupt, pender};

/// The thread-mode executor of this thread's machine, beside the one that [`interrupt::start`] makes. Neither is ever
/// freed.
pub struct Runtime(&'static Executor);

impl Runtime {
    /// Returns an executor without tasks.
    #[expect(clippy::new_without_default, reason = "each leaks")]
    pub fn new() -> Self {
        Self(Box::leak(Box::new(Executor::new(pender::THREAD))))
    }

    /// Spawns tasks of thread mode.
    pub fn spawner(&self) -> Spawner {
        self.0.spawner()
    }

    /// Returns the token of thread mode: the thread of the host stands for it.
    pub fn thread(&self) -> Thread {
        // SAFETY: on the host interrupt mode runs between polls of thread mode, never within them.
        unsafe { Thread::assume() }
    }

    /// Returns the token of interrupt mode, for tests that themselves do what tasks of interrupt mode do.
    pub fn interrupt(&self) -> Interrupt {
        // SAFETY: as above.
        unsafe { Interrupt::assume() }
    }

    /// Spawns a future as a task of thread mode.
    pub fn spawn<F: Future + 'static>(&self, future: F) {
        let storage = Box::leak(Box::new(TaskStorage::new()));
        if let Ok(token) = storage.spawn(move || future) {
            self.spawner().spawn(token);
        }
    }

    /// Polls until no task has anything left to do now. `turn` is the one of `Executor::run_with`.
    pub fn settle(&self, mut turn: impl FnMut(u8)) {
        loop {
            if interrupt::take_request() {
                if let Some(executor) = interrupt::executor() {
                    // SAFETY: not called from inside a task.
                    unsafe { executor.poll() };
                }
            } else if flags::all() != 0 {
                let bits = flags::take();
                event::dispatch(self.thread(), bits);
                turn(bits);
                // SAFETY: not called from inside a task.
                unsafe { self.0.poll() };
            } else if !interrupt::idle() {
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Event;
    use std::cell::Cell;
    use std::rc::Rc;
    use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

    const DONE: Event = Event::new::<1>();

    #[test]
    fn a_pended_task_of_interrupt_mode_runs_before_thread_mode_goes_on() {
        let runtime = Runtime::new();
        let runs = &*Box::leak(Box::new(AtomicU8::new(0)));
        let storage = Box::leak(Box::new(TaskStorage::new()));
        let started = interrupt::start(|spawner, level| {
            let token = storage.spawn(move || async move {
                loop {
                    let mut asked = false;
                    let is_asked = || std::mem::replace(&mut asked, true).then_some(());
                    interrupt::wait(level, is_asked).await;
                    runs.fetch_add(1, Relaxed);
                    DONE.set();
                }
            });
            spawner.spawn(token.ok().unwrap());
        });
        assert!(started.is_some() && interrupt::start(|_, _| ()).is_none(), "once");
        let (seen, thread) = (Rc::new(Cell::new(0)), runtime.thread());
        let told = seen.clone();
        runtime.spawn(async move {
            loop {
                DONE.next(thread).await;
                told.set(runs.load(Relaxed));
            }
        });
        runtime.settle(|_| ());
        for n in 1..4 {
            interrupt::pend();
            interrupt::pend();
            runtime.settle(|_| ());
            assert_eq!(seen.get(), n, "two requests merge");
        }
    }

    #[test]
    fn idle_time_is_told_and_used() {
        let runtime = Runtime::new();
        interrupt::note_idle();
        assert!(!interrupt::was_idle());
        runtime.settle(|_| ());
        assert!(interrupt::was_idle());
        interrupt::pend_when_idle();
        assert!(!interrupt::was_idle());
        runtime.settle(|_| ());
        assert!(interrupt::was_idle());
    }

    #[test]
    fn locks_nest() {
        let runtime = Runtime::new();
        let thread = runtime.thread();
        let sum = interrupt::lock(thread, |_| 1 + interrupt::lock(thread, |_| 2));
        assert_eq!(sum, 3);
    }
}
