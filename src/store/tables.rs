//! The tables of the interpreter in the log: each value of a row is an item. One that is 0 and was never anything
//! else takes no room.

use super::{Log, Memory, record};
use crate::config::name::{Name, axis_letter};
use crate::gcode::tables::{Row, STORED, SYSTEMS};
use crate::units::{AXES, Length, PerAxis};

/// What a row is. Cost on AVR: see [`Log::find`].
#[inline(never)]
pub fn row<M: Memory>(log: &Log, memory: &M, row: Row) -> PerAxis<Length> {
    let mut keys = [0; AXES];
    for (axis, key) in (0..).zip(&mut keys) {
        *key = self::key(row, axis);
    }
    log.find(memory, &keys).map(|value| Length(value.unwrap_or(0)))
}

/// The key of a value of a row.
#[inline(never)]
pub fn key(row: Row, axis: u8) -> u16 {
    record::key(name(row, axis).bytes())
}

/// What a value is called: `g54x`, `g591z`, `g28a`, `tt10z`. Spelled out, for text in a table would be in RAM.
fn name(row: Row, axis: u8) -> Name {
    const FIRST_TOOL: u8 = SYSTEMS + STORED;
    let named = |bytes: &[u8]| Name::new().with(bytes).unwrap_or_default();
    let letter = axis_letter(axis);
    match row.number() {
        row @ 0..6 => named(&[b'g', b'5', b'4' + row, letter]),
        row @ 6..9 => named(&[b'g', b'5', b'9', b'1' + row - 6, letter]),
        9 => named(&[b'g', b'2', b'8', letter]),
        10 => named(&[b'g', b'3', b'0', letter]),
        row @ FIRST_TOOL.. => match row - FIRST_TOOL + 1 {
            tool @ ..10 => named(&[b't', b't', b'0' + tool, letter]),
            tool => named(&[b't', b't', b'0' + tool / 10, b'0' + tool % 10, letter]),
        },
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::gcode::tables::TOOLS;

    /// The keys of all values.
    pub fn keys() -> impl Iterator<Item = u16> {
        let systems = (0..SYSTEMS).map(Row::system);
        let tools = (1..=TOOLS).filter_map(Row::tool);
        let rows = systems.chain((0..STORED).map(Row::stored)).chain(tools);
        rows.flat_map(|row| (0..AXES as u8).map(move |axis| key(row, axis)))
    }

    #[test]
    fn values_have_names() {
        let name = |row, axis| std::string::String::from_utf8(name(row, axis).bytes().to_vec());
        let tool = |number| Row::tool(number).unwrap();
        for (row, axis, expected) in [
            (Row::system(0), 0, "g54x"),
            (Row::system(0), 5, "g54c"),
            (Row::system(1), 0, "g55x"),
            (Row::system(6), 0, "g591x"),
            (Row::system(8), 5, "g593c"),
            (Row::stored(0), 0, "g28x"),
            (Row::stored(1), 5, "g30c"),
            (tool(1), 0, "tt1x"),
            (tool(2), 2, "tt2z"),
            (tool(10), 2, "tt10z"),
        ] {
            assert_eq!(name(row, axis).unwrap(), expected);
        }
    }
}
