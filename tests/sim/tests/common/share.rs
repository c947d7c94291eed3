//! Which of many cases of one kind a test runs: a share of them, or all with `KERF_LONG=1`, which `cargo xtask test --long`
//! sets.
//!
//! `KERF_COMMIT` is a number that chooses the share. `cargo xtask test` takes it from the hash of the commit, and prints it.
//! A share is never empty, and the shares of consecutive numbers together are all cases.

use std::ops::Range;

use crate::seeds::{self, wanted};

/// How many times as many random cases run with `KERF_LONG`.
const MORE: u64 = 10;

/// Returns and prints the seeds of random cases: a share of `least` of the first `all` seeds, or ten times as many as
/// all. `KERF_SEED` and `KERF_CASES` replace its first seed and their number.
pub fn share_of_seeds(all: u64, least: u64) -> Range<u64> {
    seeds::seeds_of(if is_long() { 0..all * MORE } else { part(all, least, number()) })
}

/// Returns a share of the cases of a list, spread over the list: each `every`th.
pub fn share_of<T>(list: &[T], every: usize) -> impl Iterator<Item = &T> {
    let (first, every) = spread(every.min(list.len()), is_long(), number());
    list.iter().skip(first).step_by(every)
}

/// Returns a share of the numbers below `all`: each `every`th.
pub fn share(all: u64, every: usize) -> impl Iterator<Item = u64> {
    let (first, every) = spread(every.min(all as usize), is_long(), number());
    (0..all).skip(first).step_by(every)
}

pub fn is_long() -> bool {
    wanted("KERF_LONG").is_some_and(|long| long > 0)
}

fn number() -> u64 {
    wanted("KERF_COMMIT").unwrap_or(0)
}

/// Returns the first case of a share, and the distance to the next one.
fn spread(every: usize, long: bool, number: u64) -> (usize, usize) {
    match every {
        0 | 1 => (0, 1),
        _ if long => (0, 1),
        _ => ((number % every as u64) as usize, every),
    }
}

/// Returns a share of `all` seeds.
fn part(all: u64, least: u64, number: u64) -> Range<u64> {
    let least = least.clamp(1, all);
    let first = (number % all.div_ceil(least) * least).min(all - least);
    first..first + least
}

#[test]
fn shares_are_all_cases_together_and_none_is_empty() {
    for (all, least) in [(1, 1), (7, 1), (7, 3), (8, 4), (5, 9), (3, 0), (500, 150)] {
        let mut tried = vec![false; all as usize];
        for number in 41..41 + all {
            let share = part(all, least, number);
            assert!(!share.is_empty() && share.end <= all, "{share:?} of {all}");
            share.for_each(|case| tried[case as usize] = true);
        }
        assert!(tried.iter().all(|tried| *tried), "{all} {least}: {tried:?}");
    }
    for every in 0..9 {
        let firsts: std::collections::BTreeSet<_> =
            (77..77 + 9).map(|number| spread(every, false, number).0).collect();
        assert!(firsts.iter().copied().eq(0..every.max(1)), "{every}: {firsts:?}");
        assert_eq!(spread(every, true, 5), (0, 1));
    }
}
