//! In place of the language in an image without it: lines with parameters and expressions are refused with
//! [`Status::NotBuiltIn`].

use super::command::Commands;
use super::interpreter::{Info, Interpreter};
use super::setup::Setup;
use crate::status::Status;
use crate::units::{Length, PerAxis};

/// Nothing.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Language;

/// How the firmware keeps it.
pub type Placed = Language;

impl Language {
    /// Returns nothing.
    pub const fn new() -> Self {
        Self
    }
}

impl Default for Language {
    fn default() -> Self {
        Self::new()
    }
}

/// Whether a line is for the language: no.
#[inline(always)]
pub fn is_needed(_line: &[u8]) -> bool {
    false
}

/// Returns the status with which a line is refused that is no valid one.
#[inline(never)]
#[small]
pub fn refusal(line: &[u8], status: Status) -> Status {
    let is_meant = line.iter().any(|byte| matches!(byte, b'#' | b'['));
    let is_unread = matches!(status, Status::MalformedCommand | Status::BadNumber);
    if is_meant && is_unread { Status::NotBuiltIn } else { status }
}

impl<T, L> Interpreter<T, L> {
    /// Does nothing.
    #[inline(always)]
    pub fn note_probe(&mut self, _place: &PerAxis<Length>, _contact: bool) {}

    /// Does nothing.
    #[inline(always)]
    pub fn hush(&mut self) {}

    /// Returns no.
    #[inline(always)]
    pub(super) fn has_flow(&self) -> bool {
        false
    }

    /// Returns no.
    #[inline(always)]
    pub(super) fn takes_all(&self) -> bool {
        false
    }

    /// Returns no.
    #[inline(always)]
    pub fn is_replay(&self) -> bool {
        false
    }

    /// Returns no.
    #[inline(always)]
    pub fn is_telling(&self) -> bool {
        false
    }

    /// Does nothing.
    #[inline(always)]
    pub fn end_flow(&mut self) {}

    /// Never called.
    #[inline(always)]
    pub(super) fn computed(
        &mut self,
        _line: &[u8],
        _setup: &impl Setup,
        _out: &mut Commands,
    ) -> Result<Info, Status> {
        Err(Status::NotBuiltIn)
    }
}
