//! How output is written: as JSON or text, how much of it, and in whose words.

use super::variation::Variation;
use crate::config::Settings;

/// How to write, and where in an object we are. Kept from step to step.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Format {
    pub(super) flags: u8,
    pub(super) variation: Variation,
}

pub(super) const STRICT: u8 = 1;
pub(super) const COMMA: u8 = 2;
pub(super) const PLAIN: u8 = 4;
/// Lines end in LF CR.
pub(super) const EXPAND: u8 = 8;
/// Lines are written into a string.
pub(super) const WRAPPED: u8 = 16;
/// What is not shown: names and values, messages, frames.
pub(super) const HUSHED: u8 = 32;
pub(super) const MUTE: u8 = 64;
pub(super) const SILENT: u8 = 128;

impl Format {
    /// JSON, as the settings say.
    #[inline(never)]
    pub fn json(settings: &Settings) -> Format {
        let strict = if settings.json_strict() { STRICT } else { 0 };
        let plain = Format::plain(settings);
        Format { flags: plain.flags & !PLAIN | strict, ..plain }
    }

    /// JSON of which the verbosity lets through: 0 nothing, 1 frames, 2 messages, else all. A sender that counts
    /// characters knows names and values to show from 1 on.
    pub fn response(settings: &Settings) -> Format {
        let format = Format::json(settings);
        let hidden = match settings.json_verbosity() {
            0 => SILENT | MUTE | HUSHED,
            1 => MUTE | HUSHED,
            2 => HUSHED,
            _ => 0,
        };
        let shown = match format.variation {
            Variation::Characters if hidden & SILENT == 0 => HUSHED,
            _ => 0,
        };
        Format { flags: format.flags | hidden & !shown, ..format }
    }

    /// How JSON is written for an announcement: every part of it, unless the verbosity is 0.
    pub fn announcement(settings: &Settings) -> Format {
        let format = Format::json(settings);
        let hidden = if settings.json_verbosity() == 0 { SILENT | MUTE | HUSHED } else { 0 };
        Format { flags: format.flags | hidden, ..format }
    }

    /// Text: `key:value,key:value`.
    #[inline(never)]
    pub fn plain(settings: &Settings) -> Format {
        let expand = if settings.expand_line_feeds() { EXPAND } else { 0 };
        Format { flags: PLAIN | expand, variation: Variation::of(settings) }
    }

    /// Whether it is text.
    pub fn is_plain(self) -> bool {
        self.flags & PLAIN != 0
    }

    /// Whether lines are parts of a string.
    pub fn is_wrapped(self) -> bool {
        self.flags & WRAPPED != 0
    }

    /// Whose words are used.
    pub fn variation(self) -> Variation {
        self.variation
    }

    /// From here on lines are parts of a string, or no longer.
    pub fn wrap(&mut self, on: bool) {
        self.flags = if on { self.flags | WRAPPED } else { self.flags & !WRAPPED };
    }
}
