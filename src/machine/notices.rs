//! Notices: things that the machine has done and that still have to be reported. The task that causes a notice writes
//! it, and the reporter takes it. There is one notice of each kind, and the newest replaces an older one.

use core::cell::Cell;

use crate::status::Status;

/// The notices that the reporter has not taken yet.
#[derive(Default)]
pub struct Notices {
    /// An exception, to be reported to the port that feeds the machine.
    pub exception: Cell<Option<Status>>,
    /// A jog has ended.
    pub jogged: Cell<bool>,
    /// The queue has been flushed.
    pub flushed: Cell<bool>,
    /// The ends of axes whose limits were hit first in the present alarm, as bits.
    pub limits_hit: Cell<u8>,
}
