//! Selects the random conversations. Each has a seed, which is printed, and a seed always gives the same
//! conversation.
//!
//! `KERF_SEED` is the first seed, 0 by default, and `KERF_CASES` the number of seeds.

use std::fmt::Debug;
use std::io::{Write, stderr};
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

use proptest::strategy::Strategy;
use proptest::test_runner::{Config, RngAlgorithm, TestCaseError, TestError, TestRng, TestRunner};

/// Returns and prints the seeds; `count` is the default number.
pub fn seeds(count: u64) -> Range<u64> {
    seeds_of(0..count)
}

/// Returns and prints the seeds; these are the default.
pub fn seeds_of(usual: Range<u64>) -> Range<u64> {
    let first = wanted("KERF_SEED").unwrap_or(usual.start);
    let seeds = first..first + wanted("KERF_CASES").unwrap_or(usual.end - usual.start);
    tell(&format!("random conversations: seeds {} to {}", seeds.start, seeds.end - 1));
    seeds
}

/// Number of failures after which a test ends, unless `KERF_TOLD` has another number.
const TOLD: usize = 3;
/// Number of cases between two lines of progress.
const PROGRESS: u64 = 5_000;

/// Tries the cases of so many seeds, as [`try_each`] does.
#[allow(dead_code)]
pub fn try_all(count: u64, try_seed: impl Fn(u64) -> Result<(), String> + Sync) {
    try_each(seeds(count), try_seed);
}

/// Tries the case of each seed, on all cores or on as many as `KERF_CORES` says. Reports the first failures.
#[allow(dead_code)]
pub fn try_each(seeds: Range<u64>, try_seed: impl Fn(u64) -> Result<(), String> + Sync) {
    let (next, failed) = (AtomicU64::new(seeds.start), Mutex::new(Vec::new()));
    let told = wanted("KERF_TOLD").map_or(TOLD, |n| n as usize);
    let work = || {
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if !seeds.contains(&seed) || failed.lock().unwrap().len() >= told {
                return;
            }
            if let Err(why) = try_seed(seed) {
                failed.lock().unwrap().push(format!("seed {seed}: {why}"));
            }
            let done = seed + 1 - seeds.start;
            if done.is_multiple_of(PROGRESS) {
                tell(&format!("{done} cases, to seed {seed}"));
            }
        }
    };
    let cores = wanted("KERF_CORES").map_or_else(cores, |n| n as usize);
    thread::scope(|scope| {
        (0..cores).for_each(|_| {
            scope.spawn(work);
        });
    });
    let failed = failed.into_inner().unwrap();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

fn cores() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// Returns the number in a variable of the environment.
pub fn wanted(name: &str) -> Option<u64> {
    std::env::var(name).ok().and_then(|n| n.parse().ok())
}

/// Prints a text even if the test passes.
pub fn tell(what: &str) {
    let _ = writeln!(stderr(), "{what}");
}

/// Returns the runner that makes the case of a seed, and that shrinks it if it fails.
fn runner(seed: u64) -> TestRunner {
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    let config = Config { failure_persistence: None, ..Config::default() };
    TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &bytes))
}

/// Returns the case of a seed, and the runner that shrinks it if it fails.
pub fn case<S: Strategy>(seed: u64, strategy: &S) -> (S::Tree, TestRunner) {
    let mut runner = runner(seed);
    let tree = strategy.new_tree(&mut runner).expect("a strategy without filters");
    (tree, runner)
}

/// Plays the case of a seed. A case that fails is shrunk as far as possible and reported.
#[allow(dead_code, reason = "each test uses a part")]
pub fn smallest<S: Strategy>(
    seed: u64,
    strategy: &S,
    play: impl Fn(S::Value) -> Result<(), String>,
) -> Result<(), String>
where
    S::Value: Debug,
{
    let (tree, mut runner) = case(seed, strategy);
    match runner.run_one(tree, |value| play(value).map_err(TestCaseError::fail)) {
        Ok(_) => Ok(()),
        Err(TestError::Fail(why, value)) => Err(format!("{value:?}\n{why}")),
        Err(TestError::Abort(why)) => Err(why.to_string()),
    }
}
