//! Sends a notice: the greeting, alarms and messages, results of probing.
//!
//! Queue and status reports are not sent here, because grbl's senders ask for them.

use super::lists;
use super::report::{SLEEPS, sync_error};
use super::status::{PROBE_CLOSED, alarm_number, error_number};
use super::write::{close, int, line_end, message, text};
use crate::boards::inputs;
use crate::capability::Capability;
use crate::gcode::modal::MotionMode;
use crate::machine::Doing;
use crate::plain;
#[cfg(feature = "language")]
use crate::protocol::notice::put_said;
use crate::protocol::{Machine, Notice, Occasion, Out, Tells, Value};
use crate::status::Status;
use crate::text;

/// What is being sent, and how far.
pub enum Telling {
    /// Nothing.
    Nothing,
    /// The greeting, and whether its first line has been written.
    Greeting(bool),
    /// An alarm, or a message.
    Exception(Status),
    /// `[PRB:]`, from this part on.
    Probing(u8),
    /// The result of a start-up line.
    Startup(u8, Status),
    /// A line of a file that was refused: its number, and the status.
    #[cfg(feature = "sd")]
    FileLine(u32, Status),
    /// `[Se:]`.
    SyncError,
    /// `[MSG:]` with what G-code tells.
    #[cfg(feature = "language")]
    Said,
}

#[small]
impl Telling {
    /// Starts to send a notice about the present state of the machine.
    #[inline(never)]
    pub(super) fn begin(notice: Notice, machine: &mut impl Machine) -> Self {
        match notice {
            Notice::Greeting(Occasion::Ready) => {
                machine.memory().grbl.note(SLEEPS, false);
                Self::Greeting(false)
            }
            Notice::Exception(status) => Self::Exception(status),
            Notice::Startup(line, status) => Self::Startup(line, status),
            #[cfg(feature = "sd")]
            Notice::FileLine(line, status) => Self::FileLine(line, status),
            Notice::Probing => Self::Probing(lists::PROBING),
            #[cfg(feature = "language")]
            Notice::Said => Self::Said,
            Notice::SyncError if Capability::Lathe.is_built_in() => Self::SyncError,
            _ => Self::Nothing,
        }
    }
}

#[small]
impl Tells for Telling {
    #[inline(never)]
    fn step(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool {
        match self {
            Self::Nothing => false,
            Self::Greeting(false) => {
                out.put_plain(plain!("\r\nGrbl 1.1h ['$' for help]\r\n"));
                let alarmed = matches!(machine.doing(), Doing::Alarm(_));
                *self = Self::Greeting(true);
                alarmed
            }
            Self::Greeting(true) => {
                message(out, text!("'$H'|'$X' to unlock"));
                false
            }
            Self::Exception(status) => {
                exception(*status, machine, out);
                false
            }
            Self::Startup(line, status) => {
                started(*line, *status, machine, out);
                false
            }
            #[cfg(feature = "sd")]
            Self::FileLine(line, status) => {
                text(out, text!("[MSG:error:"));
                int(out, error_number(*status).into());
                text(out, text!(" in line "));
                int(out, line.cast_signed());
                text(out, text!(" of the file"));
                close(out);
                false
            }
            Self::Probing(at) => match lists::offsets(*at, machine, out) {
                Some(next) => {
                    *at = next;
                    true
                }
                None => false,
            },
            #[cfg(feature = "language")]
            Self::Said => {
                text(out, text!("[MSG:"));
                put_said(machine, out);
                close(out);
                false
            }
            Self::SyncError => {
                if Capability::Lathe.is_built_in() {
                    text(out, text!("[Se:"));
                    sync_error(machine, out);
                    close(out);
                }
                false
            }
        }
    }
}

/// Writes `>G54:ok`. All on one line, so that no sender takes the `ok` for an answer.
#[inline(never)]
#[small]
fn started(line: u8, status: Status, machine: &mut impl Machine, out: &mut impl Out) {
    out.put(b'>');
    lists::startup_text(line, machine, out);
    let number = error_number(status);
    text(out, if number == 0 { text!(":ok") } else { text!(":error:") });
    if number != 0 {
        int(out, number.into());
    }
    line_end(out);
}

/// Writes `ALARM:N`, or a message for the user.
#[inline(never)]
#[small]
fn exception(status: Status, machine: &mut impl Machine, out: &mut impl Out) {
    if let Some(number) = alarm_number(status) {
        let closed = status == Status::ProbeFailed && is_contact(machine);
        let number = if closed { PROBE_CLOSED } else { number };
        text(out, text!("ALARM:"));
        int(out, number.into());
        line_end(out);
        if matches!(status, Status::ShutDown | Status::Panicked | Status::LimitHit) {
            message(out, text!("Reset to continue"));
        }
        return;
    }
    match status {
        Status::EndOfFile => message(out, text!("Pgm End")),
        Status::BufferFull => message(out, text!("Buffer full")),
        Status::ProgramStopped => message(out, text!("Program stopped [~ to resume]")),
        Status::NoToolLength => message(out, text!("Tool has no length - 0 in force")),
        Status::StepsLate => message(out, text!("Steps came late")),
        Status::Initializing => message(out, text!("Settings unreadable - defaults in force")),
        lost if Capability::Lathe.is_built_in() => spindle(lost, out),
        _ => {}
    }
}

/// Writes a message about a thread.
#[inline(never)]
#[small]
fn spindle(status: Status, out: &mut impl Out) {
    match status {
        Status::PulseMisfit => message(out, text!("Spindle pulses do not fit")),
        Status::SpindleLost => message(out, text!("Spindle lost in a thread")),
        Status::SpindleError => message(out, text!("Thread too far off")),
        Status::WrongWay => message(out, text!("Spindle turns the wrong way")),
        Status::NotReversed => message(out, text!("Spindle did not turn round")),
        Status::SpindleMustTurn => message(out, text!("Spindle stands still")),
        _ => {}
    }
}

/// Whether the probe is in the state that the probing waits for.
#[small]
fn is_contact(machine: &mut impl Machine) -> bool {
    let leaves = machine.value(Value::MotionMode) == MotionMode::ProbeAway as i32;
    machine.value(Value::Input(inputs::PROBE as u8)) == i32::from(!leaves)
}
