//! The TinyG protocol: JSON lines in, responses and reports out.
//!
//! Pure and synchronous; the tasks own the bytes and the waiting. A line becomes a [`Request`],
//! which the parser task steps until it is done; [`Report`] and the [`notice`]s are stepped alike.
//! No step puts more than [`CHUNK`] bytes, keeps a reference, allocates or recurses. Tables and
//! texts are in program memory.
//!
//! Wire format: TinyG 0.97 build 440.20, by default with the three-element footer `[1,status,free line slots]`;
//! [`dialect`] has what can be chosen instead.

/// Bytes that one step puts at most.
pub const CHUNK: usize = 64;

mod amend;
mod apply;
mod block;
mod checksum;
mod command;
mod defaults;
pub mod dialect;
mod ending;
mod format;
mod help;
mod json;
mod listing;
mod machine;
pub mod notice;
mod pairs;
mod place;
mod program;
mod prompt;
mod report;
mod request;
mod screen;
mod status_text;
mod stop;
mod token;
mod value;
mod wrapped;
mod write;

pub use block::{is_brief, put_brief};
pub use checksum::Checksum;
pub use dialect::Dialect;
pub use format::Format;
pub use help::asks_help;
pub use json::Span;
pub use machine::{Machine, Store, Warning};
pub use prompt::put_ready_prompt;
pub use report::{LONGEST_REPORT, Report, StatusReport, queue_report, receive_report};
pub use request::{Next, Request};
pub use status_text::status_text;
pub use stop::{STOP_MAX, asks_alarm};
pub use token::Token;
#[cfg(feature = "std")]
pub use token::names;
pub use value::{Value, thousandths};
pub use write::{Ending, Out, put_line_end};

/// How the host wants to be spoken to: as it spoke last.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Mode {
    /// In JSON.
    Json,
    /// In text, with prompts.
    Text,
}

impl Mode {
    /// The format of unasked reports.
    fn format(self, machine: &impl Machine) -> Format {
        match self {
            Mode::Json => Format::json(machine.settings()),
            Mode::Text => Format::plain(machine.settings()),
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
