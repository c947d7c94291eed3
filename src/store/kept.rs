//! Which settings are stored: all but constants, the rate of the serial line, and the sender's data about its job.
//!
//! Most kept settings are in RAM as well; each of them is an [`Item`]. The rest are rarely read and are found here
//! ([`value`]). In memory an item is identified by its name, because the numbers of items differ between firmware
//! versions.

use super::{Log, Memory, record};
use crate::config::{Setting, Settings};
use crate::gcode::tables::ROWS;
use crate::units::AXES;

/// A setting that is kept and in RAM.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Item(Setting);

/// The range of item numbers. Some numbers in it have no item.
pub const ITEMS: u8 = Setting::WARM;

#[small]
impl Item {
    /// Returns the item with that number; `None` if there is none.
    pub fn from_number(number: u8) -> Option<Self> {
        Setting::from_number(number).filter(|setting| setting.is_kept()).map(Item)
    }

    /// Returns the key of the item's records.
    #[inline(never)]
    pub fn key(self) -> u16 {
        key(self.0)
    }

    /// Returns the item's value, and its default.
    pub fn value(self, settings: &Settings) -> (i32, i32) {
        (settings.get(self.0), self.0.default_value())
    }

    /// Sets the item's value, unless the setting cannot have it.
    fn set(self, settings: &mut Settings, value: i32) {
        if self.0.accepts(value) {
            settings.store(self.0, value);
        }
    }
}

/// Returns the key of a setting's records.
#[small]
pub fn key(setting: Setting) -> u16 {
    record::key(setting.name().bytes())
}

/// Returns the value of a setting that is in EEPROM only: the newest stored value, or the default if nothing was
/// stored or the setting cannot have that value.
#[inline(never)]
#[small]
pub fn value<M: Memory>(log: &Log, memory: &M, setting: Setting) -> i32 {
    let kept = log.newest(memory, key(setting)).filter(|value| setting.accepts(*value));
    kept.unwrap_or_else(|| setting.default_value())
}

/// The number of keys that the log may have to hold: one per kept setting, one per value of the tables, and that of
/// [`Change`].
pub const KEYS: u16 = Setting::KEPT + ROWS as u16 * AXES as u16 + 1;

/// The key of a number without an item.
const NO_KEY: u16 = u16::MAX;

/// See [`Change`]. More than the number of a machine.
const OFFSETS: i32 = 64;

/// A change of many settings at once: to the profile of a machine, or to the defaults.
///
/// Its record is written before the settings, and another one, [`Change::NONE`], behind them. A change that has no such
/// end was cut short by a power failure: it is made again at the start. Settings that have been stored since keep their
/// values.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Change(
    /// 0: none. Else the machine's number + 1; negative if all settings change, with [`OFFSETS`] added before if the
    /// coordinate systems change, too.
    i32,
);

#[small]
impl Change {
    /// No change, or its end.
    pub const NONE: Self = Self(0);

    /// Returns the change to the profile of these settings; with `all`, of all other settings to their defaults, too;
    /// with `offsets`, also of the coordinate systems to 0.
    pub fn to(settings: &Settings, all: bool, offsets: bool) -> Self {
        let machine = settings.get(Setting::MACHINE) + 1 + if offsets { OFFSETS } else { 0 };
        Self(if all { -machine } else { machine })
    }

    /// Returns the value of the change's record.
    pub fn value(self) -> i32 {
        self.0
    }

    /// Whether all settings change, those in EEPROM alone, too.
    pub fn is_of_all(self) -> bool {
        self.0 < 0
    }

    /// Whether the coordinate systems change, too.
    pub fn is_of_offsets(self) -> bool {
        self.0 < -OFFSETS
    }

    /// Makes the change.
    fn make(self, settings: &mut Settings) {
        if self.is_of_all() {
            settings.set_defaults();
        }
        let machine = (self.0.unsigned_abs() as u8 & (OFFSETS - 1) as u8).wrapping_sub(1);
        if Setting::MACHINE.accepts(machine.into()) {
            settings.take_over(machine);
        }
    }
}

/// Copies the stored values of all items into `settings`. Returns the change that was cut short, if one was. At
/// start-up: 10 ms on AVR, and up to 70 more with a full log; 600 bytes of stack.
#[inline(never)]
#[small]
pub fn load<M: Memory>(log: &Log, memory: &M, settings: &mut Settings) -> Change {
    if log.is_empty() {
        return Change::NONE;
    }
    let change = log.newest(memory, record::CHANGE).map_or(Change::NONE, Change);
    let mut keys = [NO_KEY; ITEMS as usize];
    for (number, key) in (0..).zip(&mut keys) {
        *key = Item::from_number(number).map_or(NO_KEY, Item::key);
    }
    log.replay(memory, |record| {
        if record.key == record::CHANGE && record.value == change.0 {
            return change.make(settings);
        }
        let number =
            (0..).zip(&keys).find(|(_, key)| **key == record.key).map(|(number, _)| number);
        if let Some(item) = number.and_then(Item::from_number) {
            item.set(settings, record.value);
        }
    });
    change
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
        for key in tables::tests::keys().chain(cold).chain([record::CHANGE]) {
            assert_eq!(keys.insert(key, Item(Setting::from_number(0).unwrap())), None);
            assert_ne!(key, NO_KEY);
        }
        let heaters = if Capability::Printer.is_built_in() { 16 } else { 0 };
        let drivers = if Capability::Drivers.is_built_in() { 15 } else { 0 };
        let shaping = if Capability::Shaping.is_built_in() { 5 } else { 0 };
        assert!(keys.len() <= usize::from(KEYS));
        let cold = 10 + 9 + 2 + 17 + heaters + drivers + shaping;
        let cold = cold + usize::from(keys.contains_key(&record::CHANGE));
        assert_eq!(keys.len(), items + usize::from(ROWS) * AXES + cold);
    }
}
