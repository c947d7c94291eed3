//! What stays from program to program: coordinate systems, stored positions, tools.
//!
//! The interpreter has none of it: what is in force is in its state, and a line that needs another [`TableRow`] asks
//! [`Tables`] for it. In the firmware that is the log in EEPROM (`tasks::storage`), elsewhere [`Ram`]. A line
//! changes one row at most, and only after nothing on it can fail any more: an [`Edit`] says which.

use crate::status::Status;
use crate::units::{AXES, Length, PerAxis};

/// Coordinate systems, G54 to G59.3.
pub const SYSTEMS: u8 = 9;
/// Stored positions, of G28 and G30.
pub const STORED: u8 = 2;
/// Tools with offsets, from number 1.
pub const TOOLS: u8 = 10;
/// Tools may have numbers up to this one; those above [`TOOLS`] are as long as none.
pub const NUMBERED: u8 = 99;
/// All rows: systems, stored positions, tools.
pub const ROWS: u8 = SYSTEMS + STORED + TOOLS;

/// The axes along which a tool has an offset: Z for a mill, X and Z for a lathe. Along the others its row is 0.
pub const TOOL_AXES: [u8; 2] = [0, 2];

/// The number of a row.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TableRow(u8);

#[small]
impl TableRow {
    /// The origin of a coordinate system, from 0; machine coordinates.
    pub const fn system(number: u8) -> Self {
        Self(if number < SYSTEMS { number } else { 0 })
    }

    /// The position of G28 (0) or G30 (1), machine coordinates.
    pub const fn stored(which: u8) -> Self {
        Self(SYSTEMS + if which < STORED { which } else { 0 })
    }

    /// The offsets of a tool, from 1.
    pub const fn tool(number: u8) -> Option<Self> {
        match number {
            1..=TOOLS => Some(Self(SYSTEMS + STORED + number - 1)),
            _ => None,
        }
    }

    /// The number of the row among all [`ROWS`].
    pub const fn number(self) -> u8 {
        self.0
    }

    /// The row of that number.
    pub const fn from_number(number: u8) -> Option<Self> {
        if number < ROWS { Some(Self(number)) } else { None }
    }

    /// Whether it is a stored position, which is set by being there.
    pub const fn is_stored(self) -> bool {
        self.0 >= SYSTEMS && self.0 < SYSTEMS + STORED
    }

    /// Whether it is of a tool.
    pub const fn is_tool(self) -> bool {
        self.0 >= SYSTEMS + STORED
    }

    /// Whether it has a value for an axis.
    pub fn has(self, axis: u8) -> bool {
        usize::from(axis) < AXES && (!self.is_tool() || TOOL_AXES.contains(&axis))
    }
}

/// A change of one row.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Edit {
    /// Which one.
    pub row: TableRow,
    /// What it is to be.
    pub values: PerAxis<Length>,
}

/// Who keeps the rows.
pub trait Tables {
    /// What a row is. On AVR a search of the log: up to 2 ms, and 3.4 more while a byte is written.
    fn row(&self, row: TableRow) -> PerAxis<Length>;

    /// Whether a stored position was ever stored. What has no memory of that says that it was.
    fn is_stored(&self, _row: TableRow) -> bool {
        true
    }

    /// Whether a change of a row can be taken now. If not, the line that makes it is refused with [`Status::Again`]
    /// and is to be tried again later.
    fn takes(&self, row: TableRow) -> bool;

    /// Takes a change; [`Self::takes`] has been asked.
    fn apply(&mut self, edit: &Edit);
}

#[small]
impl Edit {
    /// A change that can be taken now.
    pub fn new(
        row: TableRow,
        values: PerAxis<Length>,
        tables: &impl Tables,
    ) -> Result<Self, Status> {
        if !tables.takes(row) {
            return Err(Status::Again);
        }
        Ok(Self { row, values })
    }
}

/// Tables in RAM, 504 bytes: for whatever is no firmware.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Ram([PerAxis<Length>; ROWS as usize]);

#[small]
impl Ram {
    /// All zeros.
    pub const fn new() -> Self {
        Self([[Length::ZERO; AXES]; ROWS as usize])
    }
}

#[small]
impl Default for Ram {
    fn default() -> Self {
        Self::new()
    }
}

#[small]
impl Tables for Ram {
    fn row(&self, row: TableRow) -> PerAxis<Length> {
        self.0.get(usize::from(row.number())).copied().unwrap_or_default()
    }

    fn takes(&self, _row: TableRow) -> bool {
        true
    }

    fn apply(&mut self, edit: &Edit) {
        if let Some(row) = self.0.get_mut(usize::from(edit.row.number())) {
            *row = edit.values;
        }
    }
}
