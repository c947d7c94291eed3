//! A machine more than the one of the test's own thread.

use std::thread;

/// Does something on a thread of its own, as each machine needs.
pub fn apart<T: Send>(job: impl FnOnce() -> T + Send) -> T {
    thread::scope(|scope| scope.spawn(job).join().expect("no panic"))
}
