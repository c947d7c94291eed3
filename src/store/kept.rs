//! What is kept: every setting but constants and the rate of the line, and the tables of the interpreter.
//!
//! An [`Item`] is one number of these. In memory its name stands for it; the numbers of items are of
//! this firmware alone.

use super::{Log, Memory, record};
use crate::config::name::{Name, axis_letter};
use crate::config::{Setting, Settings};
use crate::gcode::tables::{self, Tables};
use crate::units::{AXES, Length};

/// One thing that is kept, by its number: settings first.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Item(u16);

/// Where the tables begin.
const FIRST_TABLE: u16 = Setting::NUMBERS as u16;
/// How many numbers there are; some of the settings' have no item.
pub const ITEMS: u16 = FIRST_TABLE + tables::VALUES as u16;

/// What items are read from and written to.
pub struct Kept<'a> {
    /// The settings.
    pub settings: &'a mut Settings,
    /// The tables.
    pub tables: &'a mut Tables,
}

impl Item {
    /// The item of that number, if there is one.
    pub fn from_number(number: u16) -> Option<Self> {
        let item = Item(number);
        match item.setting() {
            Some(setting) => setting.is_kept().then_some(item),
            None => (FIRST_TABLE..ITEMS).contains(&number).then_some(item),
        }
    }

    /// The number of a setting's item.
    pub fn of_setting(setting: Setting) -> u16 {
        setting.number().into()
    }

    /// The number of the item of a value of the tables.
    pub fn of_table(value: u8) -> u16 {
        FIRST_TABLE + u16::from(value)
    }

    fn setting(self) -> Option<Setting> {
        let number = u8::try_from(self.0).ok().filter(|number| u16::from(*number) < FIRST_TABLE);
        number.and_then(Setting::from_number)
    }

    fn table(self) -> u8 {
        (self.0 - FIRST_TABLE) as u8
    }

    /// The key of its records.
    #[inline(never)]
    pub fn key(self) -> u16 {
        let name = self.setting().map_or_else(|| table_name(self.table()), Setting::name);
        record::key(name.bytes())
    }

    /// What it is now, and what it is if it was never put away.
    pub fn value(self, settings: &Settings, tables: &Tables) -> (i32, i32) {
        match self.setting() {
            Some(setting) => (settings.get(setting), setting.default_value()),
            None => (tables.value(self.table()).0, 0),
        }
    }

    /// Takes a value over; not one that a setting could not have.
    fn set(self, kept: &mut Kept, value: i32) {
        match self.setting() {
            Some(setting) if setting.accepts(value) => kept.settings.store(setting, value),
            Some(_) => {}
            None => kept.tables.set(self.table(), Length(value)),
        }
    }
}

/// What a value of the tables is called: `g54x`, `g591z`, `g28a`, `tt10z`. Spelled out, for text in a table would be
/// in RAM.
fn table_name(value: u8) -> Name {
    let axes = AXES as u8;
    let (row, axis) = (value / axes, value % axes);
    let vectors = (tables::SYSTEMS + tables::STORED) as u8;
    let named = |bytes: &[u8]| Name::new().with(bytes).unwrap_or_default();
    let letter = axis_letter;
    match row {
        0..6 => named(&[b'g', b'5', b'4' + row, letter(axis)]),
        6..9 => named(&[b'g', b'5', b'9', b'1' + row - 6, letter(axis)]),
        9 => named(&[b'g', b'2', b'8', letter(axis)]),
        10 => named(&[b'g', b'3', b'0', letter(axis)]),
        _ => {
            let (tool, axis) = ((value - vectors * axes) / 2 + 1, (value - vectors * axes) % 2 * 2);
            match tool {
                ..10 => named(&[b't', b't', b'0' + tool, letter(axis)]),
                _ => named(&[b't', b't', b'0' + tool / 10, b'0' + tool % 10, letter(axis)]),
            }
        }
    }
}

/// What stands for no item among the keys.
const NO_KEY: u16 = u16::MAX;

/// Takes over whatever memory holds. At start-up: 10 ms on AVR, and up to 70 more with a full log; 700 bytes of stack.
#[inline(never)]
pub fn load<M: Memory>(log: &Log, memory: &M, kept: &mut Kept) {
    if log.is_empty() {
        return;
    }
    let mut keys = [NO_KEY; ITEMS as usize];
    for (number, key) in (0..).zip(&mut keys) {
        *key = Item::from_number(number).map_or(NO_KEY, Item::key);
    }
    log.replay(memory, |record| {
        let number =
            (0..).zip(&keys).find(|(_, key)| **key == record.key).map(|(number, _)| number);
        if let Some(item) = number.and_then(Item::from_number) {
            item.set(kept, record.value);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn no_two_items_have_one_key() {
        let mut keys = HashMap::new();
        for item in (0..ITEMS).filter_map(Item::from_number) {
            assert_eq!(keys.insert(item.key(), item), None, "{item:?}");
            assert_ne!(item.key(), NO_KEY, "{item:?}");
        }
        assert_eq!(keys.len(), 132 + tables::VALUES);
    }

    #[test]
    fn tables_have_names() {
        let name = |value| std::string::String::from_utf8(table_name(value).bytes().to_vec());
        let named =
            [0, 5, 6, 36, 53, 54, 60, 65, 66, 67, 68, 84, 85].map(|value| name(value).unwrap());
        let expected = [
            "g54x", "g54c", "g55x", "g591x", "g593c", "g28x", "g30x", "g30c", "tt1x", "tt1z",
            "tt2x", "tt10x", "tt10z",
        ];
        assert_eq!(named, expected);
    }
}
