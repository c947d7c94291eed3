//! Runs sessions in parallel, a few at once.
//!
//! A simulated board uses a whole core of the computer, and drivers limit the time of their steps by the wall clock.
//! With more sessions than cores the total time is the same, but each step takes longer: with ten at once on two
//! cores homing took a minute.

use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Returns how many sessions run at once: one for each core, and one more for the time in which a sender starts and
/// its board is idle.
pub fn at_once() -> usize {
    thread::available_parallelism().map_or(1, NonZero::get) + 1
}

/// Calls a function with each of `items`, at most `at_once` at a time, in their order. Results are in the order of
/// the items.
pub fn run<T: Copy + Sync, R: Send>(
    items: &[T],
    at_once: usize,
    one: &(impl Fn(T) -> R + Sync),
) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let n = next.fetch_add(1, Ordering::Relaxed);
            let Some(&item) = items.get(n) else { return done };
            done.push((n, one(item)));
        }
    };
    let mut done: Vec<_> = thread::scope(|scope| {
        let workers: Vec<_> = (0..at_once.max(1)).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("no item panics")).collect()
    });
    done.sort_by_key(|(n, _)| *n);
    done.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_are_done_in_order_and_no_more_at_once() {
        let (running, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let twice = &|n: u32| {
            most.fetch_max(running.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
            thread::yield_now();
            running.fetch_sub(1, Ordering::SeqCst);
            2 * n
        };
        let items: Vec<_> = (0..100).collect();
        let doubled: Vec<_> = items.iter().map(|n| 2 * n).collect();
        assert_eq!(run(&items, 3, twice), doubled);
        assert!(most.load(Ordering::SeqCst) <= 3);
        assert_eq!(run(&items[..1], 0, twice), [0]);
        assert!(run(&[], 3, twice).is_empty());
    }
}
