//! Names of the rows of the interpreter's tables: `g54` to `g59`, `g591` to `g593` (G59.1 to G59.3), `g28`, `g30`,
//! `tt1` to `tt10`. Names of their values: `g54x`, `tt10z`.

use super::name::{Name, axis_letter};
use crate::gcode::tables::{ROWS, STORED, SYSTEMS, TableRow};

/// Returns the name of a row. Spelled out in code, because a table of text would be in RAM.
pub fn row_name(row: TableRow) -> Name {
    const FIRST_TOOL: u8 = SYSTEMS + STORED;
    let named = |bytes: &[u8]| Name::new().with(bytes).unwrap_or_default();
    match row.number() {
        row @ 0..6 => named(&[b'g', b'5', b'4' + row]),
        row @ 6..9 => named(&[b'g', b'5', b'9', b'1' + row - 6]),
        row @ 9..11 => named(&[b'g', b'2' + row - 9, if row == 9 { b'8' } else { b'0' }]),
        row @ FIRST_TOOL.. => match row - FIRST_TOOL + 1 {
            tool @ ..10 => named(&[b't', b't', b'0' + tool]),
            tool => named(&[b't', b't', b'0' + tool / 10, b'0' + tool % 10]),
        },
    }
}

/// Returns the name of one value of a row.
pub fn value_name(row: TableRow, axis: u8) -> Name {
    let name = row_name(row);
    name.with(&[axis_letter(axis)]).unwrap_or(name)
}

/// Returns the row of that name; `None` if there is none. About 5,000 cycles on AVR for a name that begins with `g`
/// or `t`.
#[small]
pub fn find_row(name: &Name) -> Option<TableRow> {
    if !matches!(name.first(), b'g' | b't') {
        return None;
    }
    (0..ROWS).filter_map(TableRow::from_number).find(|row| row_name(*row) == *name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_names() {
        let name = |row, axis| {
            std::string::String::from_utf8(value_name(row, axis).bytes().to_vec()).unwrap()
        };
        let tool = |number| TableRow::tool(number).unwrap();
        for (row, axis, expected) in [
            (TableRow::system(0), 0, "g54x"),
            (TableRow::system(0), 5, "g54c"),
            (TableRow::system(1), 0, "g55x"),
            (TableRow::system(6), 0, "g591x"),
            (TableRow::system(8), 5, "g593c"),
            (TableRow::stored(0), 0, "g28x"),
            (TableRow::stored(1), 5, "g30c"),
            (tool(1), 0, "tt1x"),
            (tool(2), 2, "tt2z"),
            (tool(10), 2, "tt10z"),
        ] {
            assert_eq!(name(row, axis), expected);
        }
    }

    #[test]
    fn rows_are_found_by_their_names() {
        for row in (0..ROWS).filter_map(TableRow::from_number) {
            assert_eq!(find_row(&row_name(row)), Some(row));
        }
        for name in ["g53", "g594", "tt0", "tt11", "g", "tt", ""] {
            assert_eq!(find_row(&Name::new().with(name.as_bytes()).unwrap()), None, "{name}");
        }
    }
}
