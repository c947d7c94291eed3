//! Which settings are kept: all but constants, the rate of the line, and what senders say of their job.
//!
//! Most are in RAM, too; the rest, which are seldom asked for, are found here ([`value`]). An [`Item`] is one of them. In memory its name stands for it; the numbers of items are of this firmware alone.

use super::{Log, Memory, record};
use crate::config::{Setting, Settings};
use crate::gcode::tables::ROWS;
use crate::units::AXES;

/// A setting that is kept and in RAM.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Item(Setting);

/// How many numbers there are; some settings have no item.
pub const ITEMS: u8 = Setting::WARM;

#[small]
impl Item {
    /// The item of that number, if there is one.
    pub fn from_number(number: u8) -> Option<Self> {
        Setting::from_number(number).filter(|setting| setting.is_kept()).map(Item)
    }

    /// The key of its records.
    #[inline(never)]
    pub fn key(self) -> u16 {
        key(self.0)
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

/// The key of a setting's records.
#[small]
pub fn key(setting: Setting) -> u16 {
    record::key(setting.name().bytes())
}

/// The value of a setting that is here alone: that which was put away, unless it could not have it; or its default.
#[inline(never)]
#[small]
pub fn value<M: Memory>(log: &Log, memory: &M, setting: Setting) -> i32 {
    let kept = log.newest(memory, key(setting)).filter(|value| setting.accepts(*value));
    kept.unwrap_or_else(|| setting.default_value())
}

/// Keys that the log may have to hold: of every setting that is kept, and of every value of the tables.
pub const KEYS: u16 = Setting::KEPT + ROWS as u16 * AXES as u16;

/// What stands for no item among the keys.
const NO_KEY: u16 = u16::MAX;

/// Takes over whatever memory holds of them. At start-up: 10 ms on AVR, and up to 70 more with a full log; 600 bytes of stack.
#[inline(never)]
#[small]
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
    use crate::capability::Capability;
    use std::collections::HashMap;

    #[test]
    fn no_two_items_have_one_key() {
        let mut keys = HashMap::new();
        for item in (0..ITEMS).filter_map(Item::from_number) {
            assert_eq!(keys.insert(item.key(), item), None, "{item:?}");
            assert_ne!(item.key(), NO_KEY, "{item:?}");
        }
        let items = keys.len();
        let cold = (Setting::WARM..Setting::COLD).filter_map(Setting::from_number).map(key);
        for key in tables::tests::keys().chain(cold) {
            assert_eq!(keys.insert(key, Item(Setting::from_number(0).unwrap())), None);
            assert_ne!(key, NO_KEY);
        }
        let heaters = if Capability::Printer.is_built_in() { 16 } else { 0 };
        let drivers = if Capability::Drivers.is_built_in() { 15 } else { 0 };
        assert!(keys.len() <= usize::from(KEYS));
        let cold = 10 + 9 + 2 + 17 + heaters + drivers;
        assert_eq!(keys.len(), items + usize::from(ROWS) * AXES + cold);
    }
}
