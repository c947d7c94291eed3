//! What is still to be told because of what the machine has done. Whoever has done it writes, the reporter takes; one of
//! each, and the newest counts.

use core::cell::Cell;

use crate::status::Status;

/// What nobody has begun to tell.
#[derive(Default)]
pub struct Notices {
    /// An exception, to whoever feeds the machine.
    pub exception: Cell<Option<Status>>,
    /// A jog has ended.
    pub jogged: Cell<bool>,
    /// The queue has been flushed.
    pub flushed: Cell<bool>,
    /// The limits that were hit first, as bits of the ends: of the alarm that is on.
    pub limits_hit: Cell<u8>,
}
