//! The tables of the interpreter in the log. Each value of a row is an item. A value that has always been 0 takes no
//! room.

use super::{Log, Memory, record};
use crate::config::rows::value_name;
use crate::gcode::tables::TableRow;
use crate::units::{AXES, Length, PerAxis};

/// Returns the values of a row; 0 for one that was never stored. Cost on AVR: see [`Log::search`].
#[inline(never)]
#[small]
pub fn row<M: Memory>(log: &Log, memory: &M, row: TableRow) -> PerAxis<Length> {
    let mut values = PerAxis::default();
    find(log, memory, row, &mut values);
    values
}

/// Sets those of the values that were ever stored. Returns which, as bits.
#[inline(never)]
#[small]
fn find<M: Memory>(log: &Log, memory: &M, row: TableRow, values: &mut PerAxis<Length>) -> u8 {
    let mut keys = [0; AXES];
    set_keys(row, &mut keys);
    log.search(memory, &keys, |axis, value| {
        if let Some(kept) = values.get_mut(axis) {
            *kept = Length(value);
        }
    })
}

/// Not inlined, because the deepest stack goes through it.
#[inline(never)]
#[small]
fn set_keys(row: TableRow, keys: &mut [u16; AXES]) {
    for (axis, key) in (0..).zip(keys) {
        *key = self::key(row, axis);
    }
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
    find(log, memory, row, &mut PerAxis::default()) != 0
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
