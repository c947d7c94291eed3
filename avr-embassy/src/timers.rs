//! A short list of the times that tasks wait for.
//!
//! A task has one entry, its earliest time. When it is woken then, it registers the times that it still waits for. If
//! more than `N` tasks wait, a task beyond that number is woken at once, checks its timer and registers again. This
//! costs cycles and sleep, but no time is missed. Times are milliseconds since reset, modulo 2^32; a task that waits
//! for more than 24 days is woken early, and registers again.
//!
//! Embassy's own queue keeps an entry of 16 bytes in every task. Here the list takes 6 bytes for each of `N` tasks.

use core::task::Waker;

use embassy_executor::raw::{TaskRef, task_from_waker, wake_task};
use heapless::Vec;

/// How many tasks of a program can wait for a time at once without polling: 4, or as a feature says. A program that
/// counts its own waiting tasks can check that number against this one at compile time.
pub const TIMERS: usize = match (cfg!(feature = "timers-8"), cfg!(feature = "timers-16")) {
    (_, true) => 16,
    (true, _) => 8,
    _ => 4,
};

struct Entry {
    at: u32,
    task: TaskRef,
}

/// The list.
pub struct Timers<const N: usize>(Vec<Entry, N>);

impl<const N: usize> Timers<N> {
    /// Makes an empty list.
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    /// Keeps a task until the time `at`, in milliseconds. The task is woken then, or earlier.
    ///
    /// # Panics
    /// If the waker is not that of a task of Embassy's executors.
    pub fn schedule(&mut self, at: u64, waker: &Waker) {
        let (at, task) = (at as u32, task_from_waker(waker));
        if let Some(entry) = self.0.iter_mut().find(|entry| entry.task == task) {
            if is_after(entry.at, at) {
                entry.at = at;
            }
        } else if self.0.push(Entry { at, task }).is_err() {
            wake_task(task);
        }
    }

    /// Takes a task whose time has come out of the list, to be woken. `None` if there is no such task.
    pub fn take_expired(&mut self, now: u32) -> Option<TaskRef> {
        let expired = self.0.iter().position(|entry| !is_after(entry.at, now))?;
        Some(self.0.swap_remove(expired).task)
    }
}

/// Whether a time is after another, by less than 2^31 ms.
fn is_after(time: u32, other: u32) -> bool {
    (other.wrapping_sub(time) as i32) < 0
}

impl<const N: usize> Default for Timers<N> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::Runtime;
    use core::future::poll_fn;
    use core::task::Poll;
    use std::cell::{Cell, RefCell};
    use std::rc::Rc;
    use std::vec::Vec;

    type Shared<const N: usize> = Rc<RefCell<Timers<N>>>;

    /// Spawns a task that waits for several times at once, and counts how often it is woken.
    fn task<const N: usize>(
        runtime: &Runtime,
        timers: &Shared<N>,
        times: &'static [u64],
    ) -> Rc<Cell<u32>> {
        let (timers, polls) = (timers.clone(), Rc::new(Cell::new(0)));
        let count = polls.clone();
        runtime.spawn(poll_fn(move |cx| {
            if polls.get() == 0 {
                times.iter().for_each(|at| timers.borrow_mut().schedule(*at, cx.waker()));
            }
            polls.set(polls.get() + 1);
            Poll::<()>::Pending
        }));
        runtime.settle(|_| ());
        count
    }

    /// Sets the time to `now`. Returns how often the task has been woken by then.
    fn at<const N: usize>(
        runtime: &Runtime,
        timers: &Shared<N>,
        now: u32,
        polls: &Cell<u32>,
    ) -> u32 {
        let take = || timers.borrow_mut().take_expired(now);
        while let Some(task) = take() {
            wake_task(task);
        }
        runtime.settle(|_| ());
        polls.get() - 1
    }

    #[test]
    fn a_task_is_woken_once_at_its_earliest_time() {
        let (runtime, timers) = (Runtime::new(), Shared::<4>::default());
        let polls = task(&runtime, &timers, &[20, 10, 30]);
        let woken = [9, 10, 11, 30].map(|now| at(&runtime, &timers, now, &polls));
        assert_eq!(woken, [0, 1, 1, 1]);
    }

    #[test]
    fn a_time_may_lie_beyond_the_wrap_of_the_count() {
        let (runtime, timers) = (Runtime::new(), Shared::<4>::default());
        let polls = task(&runtime, &timers, &[(1 << 32) + 10, (1 << 32) + 30]);
        let times = [u32::MAX - 2_000, u32::MAX, 0, 9, 10, 30];
        let woken = times.map(|now| at(&runtime, &timers, now, &polls));
        assert_eq!(woken, [0, 0, 0, 0, 1, 1]);
    }

    #[test]
    fn one_too_many_is_not_forgotten() {
        let (runtime, timers) = (Runtime::new(), Shared::<4>::default());
        let tasks: Vec<_> = (0..5).map(|_| task(&runtime, &timers, &[10])).collect();
        let woken = |now| -> Vec<_> {
            tasks.iter().map(|polls| at(&runtime, &timers, now, polls)).collect()
        };
        assert_eq!(woken(9), [0, 0, 0, 0, 1]);
        assert_eq!(woken(10), [1, 1, 1, 1, 1]);
    }
}
