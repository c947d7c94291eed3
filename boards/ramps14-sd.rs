//! RAMPS 1.4 as [`RAMPS14`], with an SD card: its image speaks the dialect of printing hosts alone. What `ramps14` has kept in EEPROM it goes by.

use super::{Board, RAMPS14};

/// RAMPS 1.4 with an SD card.
pub const RAMPS14_SD: Board = Board {
    name: "ramps14-sd",
    features: &["dialect-reprap", "probing", "printer", "corexy", "sd", "bed-plane"],
    ..RAMPS14
};
