//! grbl's dialect, version 1.1: responses `ok` and `error:N`, status reports on request, settings by number.
//!
//! Pure and synchronous, in thread mode, as every dialect. A line becomes a [`Request`], a notice of the machine a
//! [`Telling`]. Only [`Reports`] is state. The settings are views of Kerf's own ([`settings`]), in grbl's units.
//!
//! | module | contents |
//! |---|---|
//! | [`command`] | recognizes which command a line is |
//! | [`request`] | answers a line |
//! | [`settings`] | `$$` and `$x=v` |
//! | [`lists`] | `$#`, `$G`, `$I`, `$N` |
//! | [`report`] | the status report, `<Idle|MPos:..>` |
//! | [`status`] | the numbers of errors and alarms |
//! | [`telling`] | the greeting, alarms, results of probing |
//! | [`write`](mod@write) | numbers and texts |
//!
//! Lines are answered in the order in which they arrive, control lines included, because senders that count
//! characters rely on it. Output lines end in CR LF. A step costs at most 15,000 cycles, or 3 ms with a setting that
//! is in EEPROM. Malformed lines are answered with an error. No buffer here can overflow.

#[cfg(feature = "sd")]
mod card;
mod command;
mod lists;
mod report;
mod request;
mod settings;
mod status;
mod telling;
mod write;

use super::{Dialect, Ending, Machine, Notice, Out};
use crate::config::Settings;
use crate::machine::Alarm;
use crate::plain;
use crate::status::Status;

pub use report::Reports;
pub use request::Request;
pub use status::{alarm_number, error_number};
pub use telling::Telling;

/// The value of the setting `dia` with which every port begins in this dialect.
const CHOSEN: u8 = 3;

/// The dialect.
pub struct Grbl;

impl Dialect for Grbl {
    type Speech = ();
    type Request = Request;
    type Telling = Telling;
    type Memory = Reports;

    /// Real-time bytes are taken out of lines wherever they stand, and lines are answered in order.
    const IN_ORDER: bool = true;

    fn speech(_settings: &Settings) {}

    fn is_chosen(settings: &Settings, port: u8) -> bool {
        settings.dialect_of(port) == CHOSEN
    }

    fn is_decided_by(line: &[u8]) -> bool {
        command::is_own(line)
    }

    fn may_be_decided_by(first: u8) -> bool {
        first == b'$'
    }

    fn jog(block: &[u8]) -> Option<&[u8]> {
        command::jog(block)
    }

    fn begin(line: &[u8], _length: u16, _speech: &mut (), _settings: &Settings) -> Option<Request> {
        Some(Request::begin(line))
    }

    fn question() -> Option<Request> {
        Some(Request::question())
    }

    fn refuse(
        status: Status,
        line: &[u8],
        _length: u16,
        _speech: &mut (),
        _settings: &Settings,
    ) -> Request {
        // A dropped jog, or a dropped empty line, is answered with `ok`, as grbl's senders expect. A dropped line of
        // G-code is answered with an error.
        let is_gcode = !command::is_empty(line) && command::jog(line).is_none();
        let drops_gcode = is_gcode && status == Status::Terminated;
        Request::refused(if drops_gcode { Status::Alarmed } else { status })
    }

    #[inline(always)]
    fn tell(notice: Notice, _speech: (), machine: &mut impl Machine) -> Telling {
        Telling::begin(notice, machine)
    }

    #[inline(always)]
    fn brief(_speech: (), _settings: &Settings) -> Option<bool> {
        Some(true)
    }

    #[inline(always)]
    fn put_brief(_settings: &Settings, _ending: Ending, out: &mut impl Out) {
        out.put_plain(plain!("ok\r\n"));
    }

    #[inline(always)]
    fn put_line_end(_settings: &Settings, out: &mut impl Out) {
        out.put_plain(plain!("\r\n"));
    }

    #[inline(always)]
    fn answers_empty(_speech: ()) -> bool {
        true
    }

    /// No line may overtake another, because all lines are answered in order.
    #[inline(always)]
    fn may_be_control(_first: u8) -> bool {
        false
    }

    #[inline(always)]
    fn is_control(_line: &[u8]) -> bool {
        false
    }

    #[inline(always)]
    fn asks_alarm(_line: &[u8]) -> Option<Alarm> {
        None
    }

    #[inline(always)]
    fn ends_alarm(_line: &[u8]) -> bool {
        // Its lines are answered in their order, so that the pool asks for `$X` and `$H` itself.
        false
    }
}
