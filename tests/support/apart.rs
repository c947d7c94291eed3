//! Runs a further machine beside the one of the test's own thread.

use std::thread;

/// Runs `job` on a thread of its own. On the host each machine needs its own thread.
pub fn apart<T: Send>(job: impl FnOnce() -> T + Send) -> T {
    thread::scope(|scope| scope.spawn(job).join().expect("no panic"))
}
