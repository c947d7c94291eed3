//! TinyG's dialect: JSON lines for programs, and a text mode for people.
//!
//! Pure and synchronous: the tasks own the bytes and do the waiting. A line becomes a [`Request`], which is stepped;
//! [`Report`] and the [`notice`]s are stepped in the same way. Tables and texts are in program memory.
//!
//! Wire format: TinyG 0.97 build 440.20, by default with the three-element footer `[1,status,free line slots]`. See
//! [`variation`] for the alternatives.

mod amend;
mod apply;
mod block;
#[cfg(feature = "sd")]
mod card;
mod command;
mod control;
mod defaults;
mod ending;
mod format;
mod help;
mod json;
mod listing;
pub mod notice;
mod pairs;
mod place;
mod program;
mod prompt;
mod remark;
mod report;
mod request;
mod screen;
mod state;
mod status;
mod stop;
mod telling;
mod token;
mod value;
pub mod variation;
mod wrapped;
mod write;

use super::{CHUNK, Dialect, Ending, Machine, Notice, Out};
use crate::capability::Capability;
use crate::config::Settings;
use crate::machine::Alarm;
use crate::status::Status;

pub use format::Format;
pub use report::{LONGEST_REPORT, Report, StatusReport};
pub use request::Request;
pub use status::{number, status_text};
pub use telling::Telling;
pub use token::Token;
#[cfg(feature = "std")]
pub use token::names;
pub use variation::Variation;

/// The dialect.
pub struct Tinyg;

impl Dialect for Tinyg {
    type Speech = Mode;
    type Request = Request;
    type Telling = Telling;
    type Memory = StatusReport;

    fn speech(settings: &Settings) -> Mode {
        if settings.starts_in_json() { Mode::Json } else { Mode::Text }
    }

    /// JSON, and lines that only TinyG's text mode knows: a `$` followed by text with a lower-case letter.
    fn is_decided_by(line: &[u8]) -> bool {
        let line = line.trim_ascii();
        // Noise may begin like such a line.
        let is_text = line.iter().all(|byte| matches!(byte, b' '..=b'~' | b'\t'));
        is_text
            && match line {
                [b'{', b'}'] => true,
                // In other lines braces are those of a remark.
                [b'{', names @ .., b'}'] => names.contains(&b':'),
                [b'$', rest @ ..] => {
                    let mut code = rest.iter().take_while(|byte| !matches!(byte, b'(' | b';'));
                    code.any(u8::is_ascii_lowercase)
                }
                _ => false,
            }
    }

    fn may_be_decided_by(first: u8) -> bool {
        matches!(first, b'{' | b'$')
    }

    #[inline(always)]
    fn begin(line: &[u8], length: u16, mode: &mut Mode, settings: &Settings) -> Option<Request> {
        Request::begin(line, length, mode, settings)
    }

    #[inline(always)]
    fn refuse(
        status: Status,
        line: &[u8],
        length: u16,
        mode: &mut Mode,
        settings: &Settings,
    ) -> Request {
        Request::refused(status, line, length, *mode, settings)
    }

    #[inline(always)]
    fn tell(notice: Notice, mode: Mode, machine: &mut impl Machine) -> Telling {
        Telling::begin(notice, mode, machine)
    }

    #[inline(always)]
    fn brief(mode: Mode, settings: &Settings) -> Option<bool> {
        if mode.is_text() {
            return None;
        }
        let numbered = block::is_brief(settings, true);
        (numbered || block::is_brief(settings, false)).then_some(numbered)
    }

    #[inline(always)]
    fn put_brief(settings: &Settings, ending: Ending, out: &mut impl Out) {
        block::put_brief(settings, ending, out);
    }

    #[inline(always)]
    fn put_line_end(settings: &Settings, out: &mut impl Out) {
        write::put_line_end(settings, out);
    }

    /// In text mode an empty line is answered with a prompt.
    #[inline(always)]
    fn answers_empty(mode: Mode) -> bool {
        mode.is_text()
    }

    #[inline(always)]
    fn may_be_control(first: u8) -> bool {
        control::may_be(first)
    }

    #[inline(always)]
    fn is_control(line: &[u8]) -> bool {
        control::is(line)
    }

    #[inline(always)]
    fn asks_alarm(line: &[u8]) -> Option<Alarm> {
        stop::asks_alarm(line)
    }

    #[inline(always)]
    fn ends_alarm(line: &[u8]) -> bool {
        stop::ends_alarm(line)
    }
}

/// How the port is spoken to: in the mode of its last line.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Mode {
    /// JSON.
    #[default]
    Json,
    /// Text, with prompts.
    Text,
}

impl Mode {
    /// Whether answers are text. Never in an image without text mode.
    #[inline(always)]
    fn is_text(self) -> bool {
        Capability::Text.is_built_in() && self == Mode::Text
    }

    /// Returns the format of automatic reports.
    fn format(self, machine: &impl Machine) -> Format {
        match self.is_text() {
            false => Format::json(machine.settings()),
            true => Format::plain(machine.settings()),
        }
    }
}

#[cfg(test)]
mod any_line;
#[cfg(test)]
mod fake;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod text_tests;
