//! Tables of values that stay from program to program: coordinate systems, stored positions, tools.
//!
//! The interpreter does not hold the tables. Its state contains the values in force, and a line that needs another
//! [`TableRow`] asks [`Tables`] for it. In the firmware the tables are in the log in EEPROM (`tasks::storage`),
//! elsewhere they are in [`Ram`]. A line changes one row at most. The change is an [`Edit`], which is applied only
//! after nothing on the line can fail any more.

use crate::status::Status;
use crate::units::{AXES, Length, PerAxis};

/// The number of coordinate systems, G54 to G59.3.
pub const SYSTEMS: u8 = 9;
/// The number of stored positions, of G28 and G30.
pub const STORED: u8 = 2;
/// The number of tools with offsets. Tools are numbered from 1.
pub const TOOLS: u8 = 10;
/// The highest tool number. Tools above [`TOOLS`] have no offsets, and their length counts as 0.
pub const NUMBERED: u8 = 99;
/// The number of all rows: systems, stored positions, tools.
pub const ROWS: u8 = SYSTEMS + STORED + TOOLS;

/// The axes along which a tool has an offset: Z for a mill, X and Z for a lathe. Along the other axes its row is 0.
pub const TOOL_AXES: [u8; 2] = [0, 2];

/// The number of a row.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TableRow(u8);

#[small]
impl TableRow {
    /// Returns the row of the origin of a coordinate system, in machine coordinates. `number` counts from 0.
    pub const fn system(number: u8) -> Self {
        Self(if number < SYSTEMS { number } else { 0 })
    }

    /// Returns the row of the position of G28 (0) or G30 (1), in machine coordinates.
    pub const fn stored(which: u8) -> Self {
        Self(SYSTEMS + if which < STORED { which } else { 0 })
    }

    /// Returns the row of the offsets of a tool. Tools count from 1. `None` if the tables do not have the tool.
    pub const fn tool(number: u8) -> Option<Self> {
        match number {
            1..=TOOLS => Some(Self(SYSTEMS + STORED + number - 1)),
            _ => None,
        }
    }

    /// Returns the number of the row among all [`ROWS`].
    pub const fn number(self) -> u8 {
        self.0
    }

    /// Returns the row with this number. `None` from [`ROWS`] on.
    pub const fn from_number(number: u8) -> Option<Self> {
        if number < ROWS { Some(Self(number)) } else { None }
    }

    /// Whether the row is a stored position. G28.1 and G30.1 set it to the present position.
    pub const fn is_stored(self) -> bool {
        self.0 >= SYSTEMS && self.0 < SYSTEMS + STORED
    }

    /// Whether the row belongs to a tool.
    pub const fn is_tool(self) -> bool {
        self.0 >= SYSTEMS + STORED
    }

    /// Whether the row has a value for an axis.
    pub fn has(self, axis: u8) -> bool {
        usize::from(axis) < AXES && (!self.is_tool() || TOOL_AXES.contains(&axis))
    }
}

/// A change of one row.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Edit {
    /// The row.
    pub row: TableRow,
    /// The new values of the row.
    pub values: PerAxis<Length>,
}

/// Storage for the rows.
pub trait Tables {
    /// Returns the values of a row. On AVR this searches the log: up to 2 ms, and 3.4 ms more while a byte is written.
    fn row(&self, row: TableRow) -> PerAxis<Length>;

    /// Whether a stored position was ever stored. A storage that does not record this returns true.
    fn is_stored(&self, _row: TableRow) -> bool {
        true
    }

    /// Whether a change of a row can be taken now. If not, the line that makes the change is refused with
    /// [`Status::Again`], and the caller tries it again later.
    fn takes(&self, row: TableRow) -> bool;

    /// Takes a change. The caller has checked [`Self::takes`].
    fn apply(&mut self, edit: &Edit);
}

#[small]
impl Edit {
    /// Returns a change that can be taken now, or [`Status::Again`].
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

/// Tables in RAM, 504 bytes. For tools and tests on the host.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Ram([PerAxis<Length>; ROWS as usize]);

#[small]
impl Ram {
    /// Returns tables whose values are all 0.
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
