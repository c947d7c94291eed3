//! What a row of the settings table contains, and the constructors for rows. The rows themselves are in
//! [`groups`](super::groups).
//!
//! A row takes 17 bytes of program memory, and a default four bytes for each motor or axis.

use super::groups::{axis, motor, system};
use super::machines;
use super::name::token;
use super::shape;
use crate::boards::{ACTIVE, MOTORS};
use crate::units::AXES;
use crate::{named, progmem};

/// How the value of a setting is kept.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Kind {
    /// Not kept: its default is its value.
    Constant,
    /// In one byte of RAM; an integer.
    Small,
    /// In 32 bits of RAM, fixed point.
    Large,
    /// Not kept: a fixed text, the name of the board or Kerf's version.
    Text,
    /// In EEPROM only, fixed point. For settings that are rarely read.
    Cold,
    /// In EEPROM only; 32 bits, written as hexadecimal.
    Data,
    /// In 32 bits of RAM until the next reset, written as hexadecimal.
    Job,
}

/// A length, which is converted from and to inches with G20. Never on a rotary axis.
pub const UNIT: u8 = 1;
/// A value out of range is a range error, not a minimum or maximum error.
pub const RANGE: u8 = 2;
/// A value out of range is set to the nearest limit.
pub const CLAMP: u8 = 4;
/// In millions: a value over a million is divided by a million.
pub const JERK: u8 = 8;
/// Only rotary axes have this setting. It is a length even there.
pub const RADIUS: u8 = 16;
/// Only axes that home have this setting: X Y Z A.
pub const HOMING: u8 = 32;
/// The axis mode. A linear axis does not have the last value.
pub const MODE: u8 = 64;
/// The setting is refused while anything moves. This holds for all settings of motors as well.
pub const IDLE: u8 = 128;

/// One setting, or the same setting of all motors or axes.
#[derive(Clone, Copy)]
pub struct SettingRow {
    /// The name of the setting without its group, padded with zeros.
    pub token: [u8; 4],
    /// The index of the setting among the small or large ones of its owner (the system, a motor, an axis). For a
    /// setting that is not in RAM: its row.
    pub slot: u8,
    /// How the value is kept.
    pub kind: Kind,
    /// Flags: see the constants above.
    pub flags: u8,
    /// The number of decimals that are kept.
    pub stored: u8,
    /// The number of decimals that are shown.
    pub shown: u8,
    /// Lower limit, scaled as stored.
    pub min: i32,
    /// Upper limit, scaled as stored.
    pub max: i32,
}

named! { SettingRow, 4 }

impl SettingRow {
    /// The row of no setting. All zeros, so that it needs no memory.
    pub const NONE: SettingRow = constant(0);

    pub(super) const fn with(mut self, flags: u8) -> SettingRow {
        self.flags |= flags;
        self
    }

    /// Whether the row has all of `flags`.
    pub const fn is(&self, flags: u8) -> bool {
        self.flags & flags == flags
    }

    /// Whether the row has this kind and slot. Owners share slot numbers, so the caller has to check the owner.
    pub(super) fn is_place(&self, kind: Kind, slot: u8) -> bool {
        self.kind == kind && self.slot == slot
    }
}

/// The minimum of a setting without a lower limit.
pub(super) const ANY: i32 = -i32::MAX;
/// The minimum of a setting that has to be above 0.
pub(super) const POSITIVE: i32 = 1;

/// A row for an integer of one byte.
pub(super) const fn int(min: i32, max: i32) -> SettingRow {
    let (kind, flags, stored, shown) = (Kind::Small, RANGE, 0, 0);
    SettingRow { token: [0; 4], slot: 0, kind, flags, stored, shown, min, max }
}

/// A row for a fixed-point number of `stored` decimals, of which `shown` are shown.
pub(super) const fn fixed(stored: u8, shown: u8, min: i32) -> SettingRow {
    let (kind, flags, max) = (Kind::Large, 0, i32::MAX);
    SettingRow { token: [0; 4], slot: 0, kind, flags, stored, shown, min, max }
}

/// A row for a number from 0 on with three decimals, in EEPROM only.
pub(super) const fn cold(shown: u8) -> SettingRow {
    let (kind, flags, stored, min, max) = (Kind::Cold, 0, 3, 0, i32::MAX);
    SettingRow { token: [0; 4], slot: 0, kind, flags, stored, shown, min, max }
}

/// A row for seconds with four decimals, in EEPROM only.
pub(super) const fn seconds(most: i32) -> SettingRow {
    let mut row = up_to(cold(4), most).with(RANGE);
    row.stored = 4;
    row
}

/// A row for the frequency of a resonance, in EEPROM only; 0 for none.
pub(super) const fn frequency() -> SettingRow {
    up_to(cold(1), shape::HERTZ.1 as i32 * 100).with(IDLE)
}

/// A row for a damping ratio, in EEPROM only.
pub(super) const fn damping() -> SettingRow {
    up_to(cold(2), shape::DAMPING_MOST as i32 * 10).with(IDLE)
}

/// A row for the current of a driver, in amperes with three decimals, in EEPROM only.
#[cfg(feature = "drivers")]
pub(super) const fn current() -> SettingRow {
    let mut row = up_to(cold(3), 1_400).with(RANGE);
    row.min = 50;
    row
}

/// A row for yes or no, in EEPROM only.
pub(super) const fn choice() -> SettingRow {
    whole(cold(0), 1)
}

/// Makes `row` a whole number up to `max`.
pub(super) const fn whole(row: SettingRow, max: i32) -> SettingRow {
    let mut row = up_to(row, max).with(RANGE);
    row.stored = 0;
    row
}

/// A row for the sensor of a heater (0 hot end, 1 bed). A MAX6675 is a choice if the board has a pin to select it,
/// and always on the host, which has no board.
pub(super) const fn sensor(heater: usize) -> SettingRow {
    let has_max6675 = cfg!(feature = "std") || ACTIVE.has_max6675(heater);
    whole(cold(0), if has_max6675 { 6 } else { 5 })
}

/// A row for a length of either sign, in EEPROM only.
pub(super) const fn shift(most: i32) -> SettingRow {
    let mut row = up_to(cold(3), most).with(UNIT);
    (row.stored, row.min) = (4, -most);
    row
}

/// A row for 32 bits.
pub(super) const fn bits(kind: Kind) -> SettingRow {
    let (flags, stored, shown, min, max) = (0, 0, 0, i32::MIN, i32::MAX);
    SettingRow { token: [0; 4], slot: 0, kind, flags, stored, shown, min, max }
}

/// A row for a number that never changes.
pub(super) const fn constant(decimals: u8) -> SettingRow {
    let (kind, flags) = (Kind::Constant, 0);
    let (stored, shown, min, max) = (decimals, decimals, 0, 0);
    SettingRow { token: [0; 4], slot: 0, kind, flags, stored, shown, min, max }
}

/// A row for a fixed text: the name of the board, or Kerf's version. The version is marked by a maximum of 1.
pub(super) const fn fixed_text(is_version: bool) -> SettingRow {
    let mut row = constant(0);
    row.kind = Kind::Text;
    row.max = is_version as i32;
    row
}

pub(super) const fn up_to(mut row: SettingRow, max: i32) -> SettingRow {
    row.max = max;
    row
}

/// Gives a row its name.
pub(super) const fn named(mut row: SettingRow, name: &str) -> SettingRow {
    row.token = token(name);
    row
}

/// Gives rows their slots. In RAM the settings that some owners lack come last.
pub(super) const fn numbered<const N: usize>(mut rows: [SettingRow; N]) -> [SettingRow; N] {
    let mut row = 0;
    while row < N {
        rows[row].slot = match rows[row].kind {
            Kind::Small | Kind::Large | Kind::Job => rows_before(&rows, row) as u8,
            _ => row as u8,
        };
        row += 1;
    }
    rows
}

/// Returns how many rows of the same kind have lower slots than this one.
const fn rows_before(rows: &[SettingRow], row: usize) -> usize {
    let (this, mut before, mut other) = (&rows[row], 0, 0);
    while other < rows.len() {
        let is_alike = rows[other].kind as u8 == this.kind as u8;
        let comes_first = match (rows[other].is(HOMING), this.is(HOMING)) {
            (false, true) => true,
            (true, false) => false,
            _ => other < row,
        };
        before += (is_alike && comes_first) as usize;
        other += 1;
    }
    before
}

/// Returns how many rows are of a kind: those that every owner has, and those with [`HOMING`].
pub(super) const fn count(rows: &[SettingRow], kind: Kind) -> [usize; 2] {
    let (mut counts, mut row) = ([0; 2], 0);
    while row < rows.len() {
        if rows[row].kind as u8 == kind as u8 {
            counts[rows[row].is(HOMING) as usize] += 1;
        }
        row += 1;
    }
    counts
}

/// Returns the slot of the row with that name.
pub(super) const fn slot(rows: &[SettingRow], name: &str) -> u8 {
    rows[row_of(rows, name) as usize].slot
}

/// Returns the number of the row with that name.
///
/// Panics, and so fails the build, if there is none.
pub(super) const fn row_of(rows: &[SettingRow], name: &str) -> u8 {
    let mut row = 0;
    while !is_called(&rows[row].token, name.as_bytes()) {
        row += 1;
        assert!(row < rows.len(), "there is no setting of this name");
    }
    row as u8
}

const fn is_called(token: &[u8; 4], name: &[u8]) -> bool {
    let mut i = 0;
    while i < token.len() {
        let letter = if i < name.len() { name[i] } else { 0 };
        if token[i] != letter {
            return false;
        }
        i += 1;
    }
    name.len() <= token.len()
}

/// Values of the settings, scaled as stored.
pub(super) struct Values {
    pub(super) system: [i32; system::COUNT],
    pub(super) motor: [[i32; MOTORS]; motor::COUNT],
    pub(super) axis: [[i32; AXES]; axis::COUNT],
}

/// TinyG's defaults, and Kerf's own defaults for settings that TinyG lacks and that no profile sets.
const PLAIN: Values = Values { system: system::PLAIN, motor: motor::PLAIN, axis: axis::PLAIN };

/// The values of the careful machine, from which the other profiles differ.
pub(super) const CAREFUL: Values = PLAIN.with(machines::CAREFUL.entries);

/// The values of the profile that the image is built for: the defaults.
pub(super) const DEFAULT: Values = CAREFUL.on(machines::ACTIVE);

progmem! {
    /// The values of the first four constants of the group `sys` while the machine identifies itself as a g2core.
    pub static G2CORE: [i32; 4] = [10_103, 990, 3, 0];
}
