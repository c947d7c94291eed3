//! What the machine tells unasked.

use crate::status::Status;

/// Something to tell.
#[derive(Clone, Copy)]
pub enum Notice {
    /// Who the machine is.
    Greeting(Occasion),
    /// Somebody is there: the answer to ENQ.
    Enquiry,
    /// Something has gone wrong.
    Exception(Status),
    /// What probing has found.
    Probing,
    /// What has become of a line that is carried out after a start.
    Startup(u8, Status),
    /// How the machine stands: a status report.
    Status,
    /// A jog has ended, or the queue has been flushed, or both.
    End {
        /// The first.
        jogged: bool,
        /// The second.
        flushed: bool,
    },
    /// How far the axes are ahead of the spindle in a pass, at an index.
    SyncError,
    /// A line has been waiting for two seconds.
    Busy,
    /// Temperatures, which the sender wants to be told of again and again.
    Temperatures,
    /// How far an autotune is.
    Tuning,
    /// How many blocks are free: a queue report.
    Queue,
}

/// Why the machine says who it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Occasion {
    /// Nobody can read its memory of settings: it has taken the defaults.
    Defaults,
    /// The machine is ready.
    Ready,
}
