//! The tables of the interpreter in the log. Each value of a row is an item. A value that has always been 0 takes no
//! room.

use super::{Log, Memory, record};
use crate::config::rows::value_name;
use crate::gcode::tables::TableRow;
use crate::units::{AXES, Length, PerAxis};

/// Returns the values of a row; 0 for one that was never stored. Cost on AVR: see [`Log::find`].
#[inline(never)]
#[small]
pub fn row<M: Memory>(log: &Log, memory: &M, row: TableRow) -> PerAxis<Length> {
    find(log, memory, row).map(|value| Length(value.unwrap_or(0)))
}

#[inline(never)]
#[small]
fn find<M: Memory>(log: &Log, memory: &M, row: TableRow) -> [Option<i32>; AXES] {
    let mut keys = [0; AXES];
    for (axis, key) in (0..).zip(&mut keys) {
        *key = self::key(row, axis);
    }
    log.find(memory, &keys)
}

/// Returns one value of a row; 0 if it was never stored.
#[inline(never)]
#[small]
pub fn value<M: Memory>(log: &Log, memory: &M, row: TableRow, axis: u8) -> Length {
    Length(log.newest(memory, key(row, axis)).unwrap_or(0))
}

/// Whether any value of a row was ever stored.
#[inline(never)]
#[small]
pub fn is_stored<M: Memory>(log: &Log, memory: &M, row: TableRow) -> bool {
    find(log, memory, row).iter().any(Option::is_some)
}

/// Returns the key of one value of a row.
#[inline(never)]
#[small]
pub fn key(row: TableRow, axis: u8) -> u16 {
    record::key(value_name(row, axis).bytes())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::gcode::tables::ROWS;

    /// The keys of all values.
    pub fn keys() -> impl Iterator<Item = u16> {
        let rows = (0..ROWS).filter_map(TableRow::from_number);
        rows.flat_map(|row| (0..AXES as u8).map(move |axis| key(row, axis)))
    }
}
