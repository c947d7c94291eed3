//! The times that tasks wait for: a short list, walked in thread mode at each tick.
//!
//! Owned by the time driver of `imp`. A task has one entry, its earliest time: woken then, it asks again for
//! what it still waits for. With more than [`TIMERS`] tasks waiting, one is woken at once, looks at its
//! timer and asks again: it costs cycles, and no time is missed. Times are milliseconds since reset, modulo 2^32;
//! a task that waits for more than 24 days is woken early, and asks again.
//!
//! embassy's own queue keeps an entry of 16 bytes in every task; of ours, few wait for a time.

use core::cell::RefCell;
use core::task::Waker;

use heapless::Vec;

/// Tasks that can wait for a time: reporter, power, storage, and whoever changes the rate of the line.
const TIMERS: usize = 4;

struct Entry {
    at: u32,
    waker: Waker,
}

/// The list.
pub struct Timers(RefCell<Vec<Entry, TIMERS>>);

// SAFETY: thread mode alone touches it (`imp::time`).
unsafe impl Sync for Timers {}

impl Timers {
    /// Nobody waits.
    pub const fn new() -> Self {
        Self(RefCell::new(Vec::new()))
    }

    /// Wakes a task at a time, or before.
    pub fn schedule(&self, at: u64, waker: &Waker) {
        let Ok(mut list) = self.0.try_borrow_mut() else { return waker.wake_by_ref() };
        let at = at as u32;
        if let Some(entry) = list.iter_mut().find(|entry| entry.waker.will_wake(waker)) {
            if is_after(entry.at, at) {
                entry.at = at;
            }
        } else if list.push(Entry { at, waker: waker.clone() }).is_err() {
            waker.wake_by_ref();
        }
    }

    /// Wakes the tasks whose time has come.
    pub fn wake_expired(&self, now: u32) {
        let Ok(mut list) = self.0.try_borrow_mut() else { return };
        list.retain(|entry| {
            let waits = is_after(entry.at, now);
            if !waits {
                entry.waker.wake_by_ref();
            }
            waits
        });
    }
}

/// Whether a time is after another, by less than 2^31 ms.
fn is_after(time: u32, other: u32) -> bool {
    (other.wrapping_sub(time) as i32) < 0
}

impl Default for Timers {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
    use std::task::Wake;

    #[derive(Default)]
    struct Task(AtomicU32);

    impl Wake for Task {
        fn wake(self: Arc<Self>) {
            self.0.fetch_add(1, Relaxed);
        }
    }

    fn task() -> (Arc<Task>, Waker) {
        let task = Arc::new(Task::default());
        (task.clone(), task.into())
    }

    #[test]
    fn a_task_is_woken_once_at_its_earliest_time() {
        let timers = Timers::new();
        let (task, waker) = task();
        timers.schedule(20, &waker);
        timers.schedule(10, &waker);
        timers.schedule(30, &waker);
        let woken = [9, 10, 11, 30].map(|now| {
            timers.wake_expired(now);
            task.0.load(Relaxed)
        });
        assert_eq!(woken, [0, 1, 1, 1]);
    }

    #[test]
    fn a_time_may_lie_beyond_the_wrap_of_the_count() {
        let timers = Timers::new();
        let (task, waker) = task();
        timers.schedule((1 << 32) + 10, &waker);
        timers.schedule((1 << 32) + 30, &waker);
        let woken = [u32::MAX - 2_000, u32::MAX, 0, 9, 10, 30].map(|now| {
            timers.wake_expired(now);
            task.0.load(Relaxed)
        });
        assert_eq!(woken, [0, 0, 0, 0, 1, 1]);
    }

    #[test]
    fn one_too_many_is_not_forgotten() {
        let timers = Timers::new();
        let tasks: Vec<_, 5> = (0..5).map(|_| task()).collect();
        tasks.iter().for_each(|(_, waker)| timers.schedule(10, waker));
        let woken = || tasks.iter().map(|(task, _)| task.0.load(Relaxed)).collect::<Vec<_, 5>>();
        assert_eq!(woken(), [0, 0, 0, 0, 1]);
        timers.wake_expired(10);
        assert_eq!(woken(), [1, 1, 1, 1, 1]);
    }
}
