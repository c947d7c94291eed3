//! Variations: differences between machines that speak this dialect. One table, no branches elsewhere.
//!
//! | | setting | footer | senders |
//! |---|---|---|---|
//! | [`Variation::Lines`] | default | `[1,status,free line slots]` | count responses |
//! | [`Variation::Characters`] | `rxm` 0 | `[1,status,length,checksum]` | count characters: TinyG 0.97 |
//! | [`Variation::G2core`] | `dia` 1 | `[1,status,length]` | take the machine for a g2core |
//!
//! The length is that of the answered line, its line end included; 0 if no line is answered (1 for g2core). The first
//! two variations share TinyG's status codes and texts. The third has other codes and texts for some statuses
//! (`CHANGES`), and other prompts.

use super::{number, status_text};
use crate::config::Settings;
use crate::progmem;
use crate::progmem::Text;
use crate::status::Status;
use crate::text;

/// What kind of machine the sender expects.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Variation {
    /// The sender counts lines.
    Lines,
    /// The sender counts characters.
    Characters,
    /// The sender knows g2core.
    G2core,
}

/// The phrases of a variation.
#[derive(Clone, Copy)]
pub struct Phrases {
    /// The text before the units in a prompt. `ok` or `err` follows the units.
    pub prompt: Text,
    /// The text after the units if all is well.
    pub ok: Text,
    /// The text after the units if the line has failed.
    pub err: Text,
    /// The text behind the status code in a prompt. If it is empty, the code is left out.
    pub code: Text,
    /// The length in a footer that answers no line.
    pub no_line: u8,
}

const TINYG: Phrases = Phrases {
    prompt: text!("tinyg ["),
    ok: text!("] ok> "),
    err: text!("] err: "),
    code: text!(""),
    no_line: 0,
};

progmem! {
    static PHRASES: [Phrases; 3] = [
        TINYG,
        TINYG,
        Phrases {
            prompt: text!("g2core["),
            err: text!("] err["),
            code: text!("]: "),
            no_line: 1,
            ..TINYG
        },
    ];

    /// Statuses with another code or text on g2core: the status, its code, its text.
    static CHANGES: [(Status, u8, Text); 32] = [
        (Status::Noop, 3, text!("No operation performed")),
        (Status::BufferFull, 13, text!("Buffer full non-fatal")),
        (Status::NotAccepted, 106, text!("Command not accepted")),
        (Status::JsonTooManyPairs, 112, text!("JSON has too many pairs")),
        (Status::AxisInvalid, 136, text!("Axis invalid for this command")),
        (Status::AxisDisabled, 137, text!("Axis disabled")),
        (Status::AxisTargetMissing, 138, text!("Axis target position missing")),
        (Status::PlaneMissing, 140, text!("Selected plane missing")),
        (Status::SWordMissing, 178, text!("S word missing")),
        (Status::SWordInvalid, 179, text!("S word invalid")),
        (Status::SpindleMustTurn, 152, text!("Spindle must be turning for this command")),
        (Status::ArcSpecification, 153, text!("Arc specification error")),
        (Status::PWordMissing, 160, text!("P word missing")),
        (Status::PWordInvalid, 161, text!("P word invalid")),
        (Status::PWordNegative, 163, text!("P word negative")),
        (Status::ToolInvalid, 165, text!("P word not a valid tool number")),
        (Status::HWordMissing, 170, text!("H word missing")),
        (Status::HWordInvalid, 171, text!("H word invalid")),
        (Status::LWordMissing, 172, text!("L word missing")),
        (Status::LWordInvalid, 173, text!("L word invalid")),
        (Status::QWordMissing, 174, text!("Q word missing")),
        (Status::QWordInvalid, 175, text!("Q word invalid")),
        (Status::RWordMissing, 176, text!("R word missing")),
        (Status::RWordInvalid, 177, text!("R word invalid")),
        (Status::TWordMissing, 180, text!("T word missing")),
        (Status::TWordInvalid, 181, text!("T word invalid")),
        (Status::Alarmed, 204, text!("Command rejected by ALARM [$clear to reset]")),
        (Status::LimitHit, 203, text!("Limit hit [$clear to reset, $lim=0 to override]")),
        (Status::SoftLimit, 220, text!("Soft limit")),
        (Status::HomingAxis, 241, text!("Homing Err - Bad or no axis specified")),
        (Status::HomingSwitches, 246, text!("Homing Err - Homing input is misconfigured")),
        (Status::ProbeTooShort, 251, text!("Probe travel is too small")),
    ];
}

impl Variation {
    /// Returns the variation that the settings select.
    pub fn of(settings: &Settings) -> Self {
        match (settings.is_g2core(), settings.counts_characters()) {
            (true, _) => Variation::G2core,
            (false, true) => Variation::Characters,
            (false, false) => Variation::Lines,
        }
    }

    /// Returns the phrases of the variation.
    pub fn phrases(self) -> Phrases {
        PHRASES.at(self as usize).unwrap_or(TINYG)
    }

    /// Returns the number of a status.
    pub fn code(self, status: Status) -> u8 {
        self.change(status).map_or_else(|| number(status), |(code, _)| code)
    }

    /// Returns the text of a status; `None` for a status that is shown as its number.
    pub fn status_text(self, status: Status) -> Option<Text> {
        self.change(status).map(|(_, text)| text).or_else(|| status_text(status))
    }

    fn change(self, status: Status) -> Option<(u8, Text)> {
        if self != Variation::G2core {
            return None;
        }
        let find = |i| CHANGES.at(i).filter(|(changed, _, _)| *changed == status);
        (0..CHANGES.len()).find_map(find).map(|(_, code, text)| (code, text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::string::String;

    #[test]
    fn each_status_is_changed_once() {
        let statuses: HashSet<u8> = CHANGES.get().iter().map(|change| number(change.0)).collect();
        assert_eq!(statuses.len(), CHANGES.len());
        let text = |status| -> String {
            Variation::G2core.status_text(status).unwrap().bytes().map(char::from).collect()
        };
        assert_eq!(Variation::G2core.code(Status::LimitHit), 203);
        assert_eq!(text(Status::Alarmed), "Command rejected by ALARM [$clear to reset]");
        assert_eq!(text(Status::ReadOnly), "Parameter is read-only");
        assert_eq!(Variation::Characters.code(Status::LimitHit), 204);
    }
}
