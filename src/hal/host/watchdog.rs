//! The watchdog: when it was fed last, and why the machine has started.

use super::{Local, now};
use crate::hal::resets::Cause;

machine_static! {
    fn last() -> Local<u64> = Local::new(0);
}

machine_static! {
    fn started() -> Local<Cause> = Local::new(Cause::PowerOn);
}

/// Why the machine has started.
pub fn cause() -> Cause {
    started().get()
}

/// Has the next machine of this thread start so.
pub fn set_cause(cause: Cause) {
    started().set(cause);
}

/// All is well.
pub fn feed() {
    last().set(now());
}

/// When it was fed last, in CPU cycles.
pub fn fed() -> u64 {
    last().get()
}
