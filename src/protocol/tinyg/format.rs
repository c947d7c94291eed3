//! How output is written: as JSON or text, how much is shown, and with which phrases.

use super::variation::Variation;
use crate::capability::Capability;
use crate::config::Settings;

/// How to write, and the position in the current object. Kept from step to step.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Format {
    pub(super) flags: u8,
    pub(super) variation: Variation,
}

pub(super) const STRICT: u8 = 1;
pub(super) const COMMA: u8 = 2;
pub(super) const PLAIN: u8 = 4;
/// Flag: lines end in LF CR.
pub(super) const EXPAND: u8 = 8;
/// Flag: lines are written into a JSON string.
pub(super) const WRAPPED: u8 = 16;
/// Flags: names and values, messages, or frames are not shown.
pub(super) const HUSHED: u8 = 32;
pub(super) const MUTE: u8 = 64;
pub(super) const SILENT: u8 = 128;

impl Format {
    /// Returns the format for JSON, with the style of the settings.
    #[inline(never)]
    pub fn json(settings: &Settings) -> Format {
        let strict = if settings.json_strict() { STRICT } else { 0 };
        let plain = Format::plain(settings);
        Format { flags: plain.flags & !PLAIN | strict, ..plain }
    }

    /// Returns the format for a JSON response. The verbosity shows: at 0 nothing, at 1 frames, at 2 also messages,
    /// above that everything. For a sender that counts characters names and values are shown from 1 on.
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

    /// Returns the format for a JSON announcement: everything is shown, unless the verbosity is 0.
    pub fn announcement(settings: &Settings) -> Format {
        let format = Format::json(settings);
        let hidden = if settings.json_verbosity() == 0 { SILENT | MUTE | HUSHED } else { 0 };
        Format { flags: format.flags | hidden, ..format }
    }

    /// Returns the format for text: `key:value,key:value`.
    #[inline(never)]
    pub fn plain(settings: &Settings) -> Format {
        let expand = if settings.expand_line_feeds() { EXPAND } else { 0 };
        Format { flags: PLAIN | expand, variation: Variation::of(settings) }
    }

    /// Whether output is text.
    pub fn is_plain(self) -> bool {
        Capability::Text.is_built_in() && self.flags & PLAIN != 0
    }

    /// Whether lines are written into a JSON string.
    pub fn is_wrapped(self) -> bool {
        Capability::Text.is_built_in() && self.flags & WRAPPED != 0
    }

    /// Returns whose phrases are used.
    pub fn variation(self) -> Variation {
        self.variation
    }

    /// Starts or ends writing lines into a JSON string.
    pub fn wrap(&mut self, on: bool) {
        self.flags = if on { self.flags | WRAPPED } else { self.flags & !WRAPPED };
    }
}
