//! What lines may ask of heaters: kept beside the settings, for who interprets lines asks there.

use crate::boards::ACTIVE;
use crate::capability::Capability;
use crate::status::Status;

/// How many machines have heaters.
pub const PRINTERS: usize = Capability::Printer.is_built_in() as usize;

/// What lines may ask for, the hot end first. The heat task keeps it up to date.
#[derive(Clone, Copy, Debug)]
pub struct Heating {
    /// How hot each may be made, eighths of a degree; 0 if there is none.
    pub hottest: [u16; 2],
    /// Why none may be switched on, or `Ok`.
    pub refused: Status,
    /// Whether the A axis is an extruder: the board has heaters, or a printing host has been heard.
    pub extruder: bool,
    /// Whether the hot end is hot enough for filament to be moved.
    pub warm: bool,
    /// Whether filament may be moved however cold it is, until the next start.
    pub allows_cold: bool,
    /// Pressure advance: K that is in force, 0.1 ms.
    pub advance: u16,
}

impl Heating {
    /// Nothing is hot, and nothing may be heated.
    pub const NONE: Self = Self {
        hottest: [0; 2],
        refused: Status::Ok,
        extruder: ACTIVE.heaters.is_some(),
        warm: false,
        allows_cold: false,
        advance: 0,
    };

    /// Whether the A axis may be moved.
    pub fn extrudes(&self) -> bool {
        !self.extruder || self.warm || self.allows_cold
    }
}
