//! The dialect of RepRap: one `ok` per line, line numbers and checksums, M codes for everything.
//!
//! Pure and synchronous, in thread mode, as every dialect. A line becomes a [`Request`], a notice of the machine a
//! [`Telling`]. Each port keeps the number of its last line ([`Session`]). The settings are views of Kerf's own
//! ([`settings`]).
//!
//! | module | contents |
//! |---|---|
//! | [`frame`] | `N12 ... *34`: line number, checksum, and the block between them |
//! | [`command`] | recognizes the code of a line, and finds its words |
//! | [`translate`] | translates moves and modes for the interpreter, where E is the A axis |
//! | [`request`] | answers a line |
//! | [`host`] | the codes that query or set something |
//! | [`settings`] | M92, M201 to M206, M503 |
//! | [`names`] | `$name=value`, `$$`: settings by Kerf's own names |
//! | [`bed`] | G29, M420: the plane of the bed |
//! | [`card`] | M20 to M30, M32: the SD card |
//! | `drivers` | M122, M569, M906: the motors' drivers, in an image with them |
//! | [`report`] | M105, M114, M115, M119 |
//! | [`tuning`] | M301, M303, M304 |
//! | [`telling`] | what is reported without being asked |
//! | [`write`](mod@write) | numbers and texts |
//!
//! A line is answered in order, when the planner has taken its motion. M105 and M114 overtake if they have no line
//! number; M108 and M112 always overtake, M24 at a program stop, and M25 during a print from the SD card. A damaged line is never carried out: the sender is asked to send it again.
//! A step costs at most 15,000 cycles, or 3 ms with a setting that is in EEPROM. No buffer here can overflow. A plain
//! move takes none of these steps: [`frame::fast_path`] checks its number and checksum, and the interpreter reads it
//! untranslated.

mod bed;
mod card;
mod command;
#[cfg(feature = "drivers")]
mod drivers;
mod frame;
mod host;
mod names;
mod report;
mod request;
mod settings;
mod shaper;
mod status;
mod telling;
mod translate;
mod tuning;
mod write;

use super::{Dialect, Ending, Intervals, Machine, Notice, Out, Remembers, Rewritten, Span};
use crate::config::Settings;
use crate::machine::Alarm;
use crate::plain;
use crate::status::Status;
use frame::Frame;

pub use frame::Session;
pub use request::Request;
pub use telling::Telling;

/// The value of [`Settings::dialect_of`] for a port that begins in this dialect.
const CHOSEN: u8 = 4;

/// Period of the messages that a line takes long, until M113 sets another, s.
const BUSY_S: u8 = 2;

/// The dialect.
pub struct RepRap;

/// What the dialect remembers of its senders' requests.
pub struct Retraction {
    /// M207 S: how far G10 retracts the filament, in units of a `Length`.
    length: i32,
    /// M208 S: how much farther G11 pushes it back.
    extra: i32,
    /// M207 F: the speed of G10 and G11, mm/min.
    feed: i32,
    /// Whether G10 has retracted the filament, with no G11 since.
    retracted: bool,
    /// M155 S: seconds from one report of temperatures to the next; 0 for none.
    interval_s: u8,
    /// M113 S: seconds from one message that a line takes long to the next; 0 for none.
    busy_s: u8,
    /// Whether a line that homes is to be answered with a failure, of which the port is told as well.
    homes: bool,
}

impl Remembers for Retraction {
    fn new() -> Self {
        Self {
            length: 20_000,
            extra: 0,
            feed: 2_100,
            retracted: false,
            interval_s: 0,
            busy_s: BUSY_S,
            homes: false,
        }
    }

    fn restore(&mut self) {
        *self = Self { retracted: self.retracted, ..Self::new() };
    }

    fn refresh(&mut self) {}
}

impl Dialect for RepRap {
    type Speech = Session;
    type Request = Request;
    type Telling = Telling;
    type Memory = Retraction;

    /// A `!` or a `?` may be part of a text, as in M117.
    const IS_PLAIN: bool = true;

    fn speech(_settings: &Settings) -> Session {
        Session::default()
    }

    fn in_file(_settings: &Settings) -> Session {
        Session::in_file()
    }

    fn is_chosen(settings: &Settings, port: u8) -> bool {
        settings.dialect_of(port) == CHOSEN
    }

    fn is_decided_by(line: &[u8]) -> bool {
        frame::is_own(line)
    }

    fn may_be_decided_by(first: u8) -> bool {
        matches!(first.to_ascii_uppercase(), b'M' | b'N')
    }

    fn begin(
        line: &[u8],
        _length: u16,
        session: &mut Session,
        _settings: &Settings,
    ) -> Option<Request> {
        Some(Request::begin(line, session))
    }

    fn refuse(
        status: Status,
        line: &[u8],
        _length: u16,
        session: &mut Session,
        _settings: &Settings,
    ) -> Request {
        Request::refused(status, line, session)
    }

    fn rewrite<'a>(block: &[u8], out: &'a mut Rewritten) -> Result<&'a [u8], Status> {
        translate::block(block, out)
    }

    fn tell(notice: Notice, _session: Session, machine: &mut impl Machine) -> Telling {
        Telling::begin(notice, machine)
    }

    /// None, because [`Dialect::fast_path`] has to check the line's checksum first.
    #[inline(always)]
    fn brief(_session: Session, _settings: &Settings) -> Option<bool> {
        None
    }

    #[inline(always)]
    fn fast_path(line: &[u8], session: &mut Session) -> Option<Span> {
        frame::fast_path(line, session)
    }

    #[inline(always)]
    fn put_brief(_settings: &Settings, _ending: Ending, out: &mut impl Out) {
        out.put_plain(plain!("ok\n"));
    }

    #[inline(always)]
    fn put_line_end(_settings: &Settings, out: &mut impl Out) {
        out.put_plain(plain!("\n"));
    }

    #[inline(always)]
    fn answers_empty(_session: Session) -> bool {
        true
    }

    #[inline(always)]
    fn may_be_control(first: u8) -> bool {
        matches!(first, b'M' | b'm' | b'N' | b'n')
    }

    #[inline(always)]
    fn is_control(line: &[u8]) -> bool {
        command::overtakes(&Frame::of(line), line)
    }

    #[inline(always)]
    fn asks_alarm(line: &[u8]) -> Option<Alarm> {
        let frame = Frame::of(line);
        let stops = command::is_stop(&frame, line);
        stops.then_some(Alarm::Shutdown)
    }

    #[inline(always)]
    fn ends_alarm(line: &[u8]) -> bool {
        command::is_clear(&Frame::of(line), line)
    }

    fn intervals(kept: &Retraction) -> Intervals {
        Intervals { temperatures_s: kept.interval_s, busy_s: kept.busy_s }
    }

    fn activity(session: Session) -> Option<u8> {
        Some(session.lines)
    }
}
