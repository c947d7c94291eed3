//! What stays from program to program: coordinate systems, stored positions, tools.
//!
//! A line changes one entry at most, and only after nothing on it can fail any more: an [`Edit`] says which.
//! RAM: 344 bytes.

use crate::status::Status;
use crate::units::{AXES, Length, PerAxis};

/// Coordinate systems, G54 to G59.3.
pub const SYSTEMS: usize = 9;
/// Stored positions, of G28 and G30.
pub const STORED: usize = 2;
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
    stored: [PerAxis<Length>; STORED],
    tools: [Tool; TOOLS],
}

/// Numbers in all tables: systems, stored positions, tools; axis by axis.
pub const VALUES: usize = (SYSTEMS + STORED) * AXES + 2 * TOOLS;

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

impl Edit {
    /// The first of the [`VALUES`] that it changes, and how many.
    pub fn values(&self) -> Option<(u8, u8)> {
        let axes = AXES as u8;
        match *self {
            Edit::None => None,
            Edit::System(number, _) => Some((number * axes, axes)),
            Edit::Stored(which, _) => Some(((SYSTEMS as u8 + which) * axes, axes)),
            Edit::Tool(number, _) => {
                let first = (SYSTEMS + STORED) as u8 * axes;
                Some((first + number.wrapping_sub(1) * 2, 2))
            }
        }
    }
}

impl Tables {
    /// All zeros.
    pub const fn new() -> Self {
        Self {
            systems: [[Length::ZERO; AXES]; SYSTEMS],
            stored: [[Length::ZERO; AXES]; STORED],
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

    /// Value `index` of [`VALUES`].
    pub fn value(&self, index: u8) -> Length {
        let index = usize::from(index);
        let (row, axis) = (index / AXES, index % AXES);
        let mut vectors = self.systems.iter().chain(&self.stored);
        if row < SYSTEMS + STORED {
            return vectors.nth(row).and_then(|all| all.get(axis)).copied().unwrap_or_default();
        }
        let index = index - (SYSTEMS + STORED) * AXES;
        let tool = self.tools.get(index / 2).copied().unwrap_or(Tool::NONE);
        if index.is_multiple_of(2) { tool.x } else { tool.z }
    }

    /// Sets value `index` of [`VALUES`].
    pub fn set(&mut self, index: u8, value: Length) {
        if let Some(place) = self.place(index) {
            *place = value;
        }
    }

    fn place(&mut self, index: u8) -> Option<&mut Length> {
        let index = usize::from(index);
        let (row, axis) = (index / AXES, index % AXES);
        if row < SYSTEMS {
            return self.systems.get_mut(row)?.get_mut(axis);
        }
        if row < SYSTEMS + STORED {
            return self.stored.get_mut(row - SYSTEMS)?.get_mut(axis);
        }
        let index = index - (SYSTEMS + STORED) * AXES;
        let tool = self.tools.get_mut(index / 2)?;
        Some(if index.is_multiple_of(2) { &mut tool.x } else { &mut tool.z })
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
