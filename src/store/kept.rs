//! Which settings are kept: all but constants and the rate of the line.
//!
//! An [`Item`] is one of them. In memory its name stands for it; the numbers of items are of this firmware alone.

use super::{Log, Memory, record};
use crate::config::{Setting, Settings};

/// A setting that is kept.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Item(Setting);

/// How many numbers there are; some settings have no item.
pub const ITEMS: u8 = Setting::NUMBERS;

impl Item {
    /// The item of that number, if there is one.
    pub fn from_number(number: u8) -> Option<Self> {
        Setting::from_number(number).filter(|setting| setting.is_kept()).map(Item)
    }

    /// The key of its records.
    #[inline(never)]
    pub fn key(self) -> u16 {
        record::key(self.0.name().bytes())
    }

    /// What it is now, and what it is if it was never put away.
    pub fn value(self, settings: &Settings) -> (i32, i32) {
        (settings.get(self.0), self.0.default_value())
    }

    /// Takes a value over; not one that the setting could not have.
    fn set(self, settings: &mut Settings, value: i32) {
        if self.0.accepts(value) {
            settings.store(self.0, value);
        }
    }
}

/// What stands for no item among the keys.
const NO_KEY: u16 = u16::MAX;

/// Takes over whatever memory holds of them. At start-up: 10 ms on AVR, and up to 70 more with a full log; 600 bytes of stack.
#[inline(never)]
pub fn load<M: Memory>(log: &Log, memory: &M, settings: &mut Settings) {
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
            item.set(settings, record.value);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::super::tables;
    use super::*;
    use crate::gcode::tables::ROWS;
    use crate::units::AXES;
    use std::collections::HashMap;

    #[test]
    fn no_two_items_have_one_key() {
        let mut keys = HashMap::new();
        for item in (0..ITEMS).filter_map(Item::from_number) {
            assert_eq!(keys.insert(item.key(), item), None, "{item:?}");
            assert_ne!(item.key(), NO_KEY, "{item:?}");
        }
        assert_eq!(keys.len(), 132);
        for key in tables::tests::keys() {
            assert_eq!(keys.insert(key, Item(Setting::from_number(0).unwrap())), None);
            assert_ne!(key, NO_KEY);
        }
        assert_eq!(keys.len(), 132 + usize::from(ROWS) * AXES);
    }
}
