//! What stays from program to program: coordinate systems, stored positions, tools.
//!
//! A line changes one entry at most, and only after nothing on it can fail any more: an [`Edit`] says which.
//! RAM: 344 bytes.

use crate::status::Status;
use crate::units::{AXES, Length, PerAxis};

/// Coordinate systems, G54 to G59.3.
pub const SYSTEMS: usize = 9;
/// Tools with offsets, from number 1.
pub const TOOLS: usize = 10;

/// The offsets of a tool: those of a mill are along Z, those of a lathe along X and Z.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Tool {
    /// Along X.
    pub x: Length,
    /// Along Z.
    pub z: Length,
}

impl Tool {
    /// No offsets.
    pub const NONE: Self = Self { x: Length::ZERO, z: Length::ZERO };

    /// The same for all axes.
    pub fn offsets(self) -> PerAxis<Length> {
        let mut all = [Length::ZERO; AXES];
        [all[0], all[2]] = [self.x, self.z];
        all
    }
}

/// The tables.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Tables {
    /// Machine coordinates of the origins of G54 to G59.3.
    systems: [PerAxis<Length>; SYSTEMS],
    /// The positions of G28 and G30, machine coordinates.
    stored: [PerAxis<Length>; 2],
    tools: [Tool; TOOLS],
}

/// A change of one entry.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Edit {
    /// None.
    #[default]
    None,
    /// The origin of a coordinate system, from 0.
    System(u8, PerAxis<Length>),
    /// The position of G28 (0) or G30 (1).
    Stored(u8, PerAxis<Length>),
    /// A tool, from 1.
    Tool(u8, Tool),
}

impl Default for Tables {
    fn default() -> Self {
        Self::new()
    }
}

impl Tables {
    /// All zeros.
    pub const fn new() -> Self {
        Self {
            systems: [[Length::ZERO; AXES]; SYSTEMS],
            stored: [[Length::ZERO; AXES]; 2],
            tools: [Tool::NONE; TOOLS],
        }
    }

    /// The origin of a coordinate system, from 0.
    pub fn system(&self, number: u8) -> &PerAxis<Length> {
        self.systems.get(usize::from(number)).unwrap_or(&self.systems[0])
    }

    /// The position of G28 (0) or G30 (1).
    pub fn stored(&self, which: u8) -> &PerAxis<Length> {
        self.stored.get(usize::from(which)).unwrap_or(&self.stored[0])
    }

    /// A tool; number 0 is an empty spindle, which has no offsets. 171 for one that is not in the table.
    pub fn tool(&self, number: u32) -> Result<Tool, Status> {
        let Some(index) = number.checked_sub(1) else { return Ok(Tool::NONE) };
        let tool = usize::try_from(index).ok().and_then(|index| self.tools.get(index));
        tool.copied().ok_or(Status::HWordInvalid)
    }

    /// Changes an entry.
    pub fn apply(&mut self, edit: &Edit) {
        match edit {
            Edit::None => {}
            Edit::System(number, origin) => {
                if let Some(system) = self.systems.get_mut(usize::from(*number)) {
                    *system = *origin;
                }
            }
            Edit::Stored(which, position) => {
                if let Some(stored) = self.stored.get_mut(usize::from(*which)) {
                    *stored = *position;
                }
            }
            Edit::Tool(number, offsets) => {
                if let Some(tool) = self.tools.get_mut(usize::from(number.wrapping_sub(1))) {
                    *tool = *offsets;
                }
            }
        }
    }
}
