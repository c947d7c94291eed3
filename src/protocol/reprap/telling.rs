//! Sends a notice: the greeting, exceptions, temperatures, and that a line takes long.

use super::status::reason;
use super::write::{line_end, text};
use super::{report, tuning};
use crate::capability::Capability;
use crate::protocol::{Machine, Notice, Occasion, Out, Tells};
use crate::status::Status;
use crate::text;

/// What is being sent.
pub enum Telling {
    /// Nothing.
    Nothing,
    /// `start`.
    Greeting,
    /// An exception: something has gone wrong, or has ended.
    Exception(Status),
    /// A line takes long.
    Busy,
    /// Temperatures, from this part on.
    Temperatures(u8),
    /// The progress of an autotune, from this part on.
    Tuning(u8),
}

#[small]
impl Telling {
    /// Starts to send a notice about the present state of the machine.
    #[inline(never)]
    pub(super) fn begin(notice: Notice, machine: &mut impl Machine) -> Self {
        match notice {
            Notice::Greeting(Occasion::Ready) => {
                machine.memory().reprap.retracted = false;
                Self::Greeting
            }
            // The answer of the line that homes tells it.
            Notice::Exception(status)
                if status.names_axis() && core::mem::take(&mut machine.memory().reprap.homes) =>
            {
                Self::Nothing
            }
            Notice::Exception(status) => Self::Exception(status),
            Notice::Busy => Self::Busy,
            Notice::Temperatures => Self::Temperatures(0),
            Notice::Tuning => Self::Tuning(0),
            _ => Self::Nothing,
        }
    }
}

#[small]
impl Tells for Telling {
    #[inline(never)]
    fn step(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool {
        match self {
            Self::Nothing => {}
            Self::Greeting => text(out, text!("start\n")),
            Self::Busy => text(out, text!("echo:busy: processing\n")),
            Self::Exception(status) => exception(*status, out),
            Self::Temperatures(at) => match report::temperatures(*at, machine, out) {
                Some(next) => {
                    *at = next;
                    return true;
                }
                None => line_end(out),
            },
            Self::Tuning(at) => {
                if let Some(next) = tuning::put(*at, machine, out) {
                    *at = next;
                    return true;
                }
            }
        }
        false
    }
}

#[inline(never)]
#[small]
fn exception(status: Status, out: &mut impl Out) {
    match status {
        Status::ProgramStopped => {
            text(out, text!("//action:paused\necho:busy: paused for user\n"));
        }
        Status::EndOfFile if Capability::Sd.is_built_in() => {
            text(out, text!("Done printing file\n"));
        }
        Status::EndOfFile | Status::ProgramChecked | Status::NoToolLength => {}
        Status::StepsLate => text(out, text!("echo:steps came late\n")),
        Status::BufferFull => text(out, text!("echo:bytes were lost\n")),
        Status::Initializing => text(out, text!("Error:settings unreadable, defaults in force\n")),
        status => {
            text(out, text!("Error:"));
            text(out, reason(status));
            line_end(out);
        }
    }
}
