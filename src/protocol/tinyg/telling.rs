//! Sends a notice in this dialect.

use super::Mode;
use super::notice::{Banner, Exception, Probing, acknowledge, jog_ended};
use super::prompt::put_ready_prompt;
use super::report::{Report, queue_report, receive_report, sync_report};
use crate::capability::Capability;
#[cfg(feature = "language")]
use crate::plain;
#[cfg(feature = "language")]
use crate::protocol::notice::put_said;
use crate::protocol::{Machine, Notice, Occasion, Out, Tells, Value};

/// A notice that is being sent, and the mode of the port.
pub struct Telling {
    part: Part,
    mode: Mode,
}

/// What is being sent.
enum Part {
    Greeting(Banner, Occasion),
    Enquiry,
    Exception(Exception),
    Probing(Probing),
    Status(Option<Report>),
    End {
        jogged: bool,
        flushed: bool,
    },
    SyncError,
    #[cfg(feature = "language")]
    Said,
    /// The queue report, with the number of free blocks that it has told.
    Queue(usize),
}

#[small]
impl Telling {
    /// Starts to send a notice about the present state of the machine.
    #[inline(never)]
    pub(super) fn begin(notice: Notice, mode: Mode, machine: &mut impl Machine) -> Self {
        let settings = machine.settings();
        let part = match notice {
            Notice::Greeting(occasion) => {
                Part::Greeting(Banner::begin(occasion, settings), occasion)
            }
            Notice::Enquiry => Part::Enquiry,
            Notice::Exception(status) => Part::Exception(Exception::begin(status, settings)),
            #[cfg(feature = "sd")]
            Notice::FileLine(line, status) => {
                Part::Exception(Exception::of_line(line, status, settings))
            }
            Notice::Probing => Part::Probing(Probing::begin(settings)),
            #[cfg(feature = "language")]
            Notice::Said => Part::Said,
            // This dialect has neither start-up lines nor these reports.
            Notice::Startup(..) | Notice::Busy | Notice::Temperatures | Notice::Tuning => {
                Part::Status(None)
            }
            Notice::Status => Part::Status(Report::begin(mode, machine)),
            Notice::End { jogged, flushed } => Part::End { jogged, flushed },
            Notice::SyncError if Capability::Lathe.is_built_in() => Part::SyncError,
            Notice::SyncError => Part::Status(None),
            Notice::Queue => Part::Queue(0),
        };
        Self { part, mode }
    }
}

#[small]
impl Tells for Telling {
    #[inline(never)]
    fn step(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool {
        let mode = self.mode;
        match &mut self.part {
            Part::Greeting(banner, occasion) => {
                let more = banner.step(machine, out);
                if !more && *occasion == Occasion::Ready && mode.is_text() {
                    put_ready_prompt(machine, out);
                }
                more
            }
            Part::Enquiry => {
                acknowledge(machine.settings(), out);
                false
            }
            Part::Exception(exception) => exception.step(machine, out),
            Part::Probing(probing) => probing.step(machine, out),
            Part::Status(report) => report.as_mut().is_some_and(|report| report.step(machine, out)),
            Part::End { jogged, flushed } => {
                if core::mem::take(jogged) {
                    jog_ended(machine.settings(), out);
                    *flushed
                } else {
                    queue_report(mode, machine, out);
                    receive_report(mode, machine, out);
                    false
                }
            }
            Part::SyncError => {
                if Capability::Lathe.is_built_in() {
                    sync_report(mode, machine, out);
                }
                false
            }
            #[cfg(feature = "language")]
            Part::Said => {
                out.put_plain(plain!("{\"msg\":\""));
                put_said(machine, out);
                out.put_plain(plain!("\"}\n"));
                false
            }
            Part::Queue(free) => {
                *free = machine.value(Value::QueueFree) as usize;
                queue_report(mode, machine, out);
                false
            }
        }
    }

    #[inline(never)]
    fn split(&mut self, out: &mut impl Out) -> bool {
        match &mut self.part {
            Part::Status(Some(report)) => report.split(out),
            _ => false,
        }
    }

    fn blocks_free(&self) -> usize {
        if let Part::Queue(free) = self.part { free } else { 0 }
    }
}
