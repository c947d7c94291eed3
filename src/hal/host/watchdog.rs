//! The watchdog: when it was fed last, and why the machine has started.

use super::{Local, now};
use crate::hal::resets::Cause;

machine_static! {
    fn last() -> Local<u64> = Local::new(0);
}

machine_static! {
    fn started() -> Local<Cause> = Local::new(Cause::PowerOn);
}

/// Returns why the machine has started.
pub fn cause() -> Cause {
    started().get()
}

/// Sets the cause with which the next machine of this thread starts.
pub fn set_cause(cause: Cause) {
    started().set(cause);
}

/// Restarts the timeout of the watchdog.
pub fn feed() {
    last().set(now());
}

/// Returns when the watchdog was fed last, in CPU cycles.
pub fn fed() -> u64 {
    last().get()
}
