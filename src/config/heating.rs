//! The state of the heaters, against which lines are checked. Kept beside the settings, because the interpreter reads
//! it.

use crate::boards::ACTIVE;
use crate::capability::Capability;
use crate::status::Status;

/// The number of printers: 1 in an image that can print, else 0.
pub const PRINTERS: usize = Capability::Printer.is_built_in() as usize;

/// The state of the heaters, against which lines are checked. Arrays have the hot end first. The heat task keeps the
/// values up to date.
#[derive(Clone, Copy, Debug)]
pub struct Heating {
    /// The highest temperature allowed for each heater, in eighths of a degree; 0 if the heater does not exist.
    pub hottest: [u16; 2],
    /// Why no heater may be switched on, or `Ok`.
    pub refused: Status,
    /// Whether the A axis is an extruder: the board has heaters, or a printing host has sent a line.
    pub extruder: bool,
    /// Whether the hot end is hot enough to move filament.
    pub warm: bool,
    /// Whether filament may be moved at any temperature, until the next start.
    pub allows_cold: bool,
    /// The pressure advance K in force, 0.1 ms.
    pub advance: u16,
}

impl Heating {
    /// All heaters cold, and none available.
    pub const NONE: Self = Self {
        hottest: [0; 2],
        refused: Status::Ok,
        extruder: ACTIVE.heaters.is_some(),
        warm: false,
        allows_cold: false,
        advance: 0,
    };

    /// Whether the A axis may be moved now.
    pub fn extrudes(&self) -> bool {
        !self.extruder || self.warm || self.allows_cold
    }
}
