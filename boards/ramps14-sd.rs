//! RAMPS 1.4 as [`RAMPS14`], with an SD card. Its image has only the dialect of printing hosts. It uses the settings
//! that `ramps14` has kept in EEPROM.

use super::{Board, RAMPS14};

/// RAMPS 1.4 with an SD card.
pub const RAMPS14_SD: Board = Board {
    name: "ramps14-sd",
    features: &["dialect-reprap", "probing", "printer", "corexy", "sd", "bed-plane"],
    ..RAMPS14
};
