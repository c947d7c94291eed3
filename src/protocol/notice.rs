//! What the machine reports without being asked.

#[cfg(feature = "language")]
use crate::protocol::{Machine, Out};
use crate::status::Status;

/// Something to report.
#[derive(Clone, Copy)]
pub enum Notice {
    /// The greeting: what the machine is.
    Greeting(Occasion),
    /// The answer to ENQ: the machine is there.
    Enquiry,
    /// An exception: something has gone wrong.
    Exception(Status),
    /// The result of a probing.
    Probing,
    /// The result of a line that runs at each start: its number, and its status.
    Startup(u8, Status),
    /// A line of a file of the SD card has been refused: its number, and why.
    #[cfg(feature = "sd")]
    FileLine(u32, Status),
    /// A line of G-code that is replayed tells something.
    #[cfg(feature = "language")]
    Said,
    /// A status report.
    Status,
    /// A jog has ended, the queue has been flushed, or both.
    End {
        /// Whether a jog has ended.
        jogged: bool,
        /// Whether the queue has been flushed.
        flushed: bool,
    },
    /// How far the axes are ahead of the spindle in a synchronized pass, measured at an index pulse.
    SyncError,
    /// A line has been waiting for two seconds.
    Busy,
    /// The temperatures, which the sender has asked to get periodically.
    Temperatures,
    /// The progress of an autotune.
    Tuning,
    /// A queue report: the number of free blocks.
    Queue,
}

/// Why the machine sends its greeting.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Occasion {
    /// The memory of settings cannot be read, and the machine has taken the defaults.
    Defaults,
    /// The machine is ready.
    Ready,
}

/// Writes what a line of G-code tells, in characters that need no escape.
#[cfg(feature = "language")]
pub fn put_said(machine: &mut impl Machine, out: &mut impl Out) {
    let mut at = 0;
    while let Some(byte) = machine.said(at) {
        out.put(match byte {
            b'"' | b'\\' => b'\'',
            b' '..=b'~' => byte,
            _ => b'?',
        });
        at += 1;
    }
}
