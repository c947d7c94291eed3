//! Which settings, and which row of the tables, last until the next start only: [`Storage`](super::storage::Storage)
//! does not save them.
//!
//! A printing host sets them (M92, M201, M203, M205, M206) and expects them to be stored by M500 alone. What is set
//! otherwise is saved at once and is lent no more. Thread mode. An image without such a dialect has none of this.

use core::cell::Cell;

use crate::config::Setting;
use crate::gcode::tables::TableRow;
use crate::store::kept::ITEMS;
use crate::units::{Length, PerAxis};

/// The row that may be lent: the origin of G54.
pub const LENT: TableRow = TableRow::system(0);
/// Whether there is a dialect that lends, as a number.
const LENDS: usize = cfg!(feature = "dialect-reprap") as usize;
const BYTES: usize = LENDS * (ITEMS as usize).div_ceil(8);

/// What is lent.
pub struct Lent {
    /// Whether the machine lends what is set.
    on: [Cell<bool>; LENDS],
    /// The numbers of settings, as bits.
    settings: [Cell<u8>; BYTES],
    row: [Cell<Option<PerAxis<Length>>>; LENDS],
}

#[small]
impl Lent {
    pub const fn new() -> Self {
        Self {
            on: [const { Cell::new(false) }; LENDS],
            settings: [const { Cell::new(0) }; BYTES],
            row: [const { Cell::new(None) }; LENDS],
        }
    }

    /// Whether the machine lends what is set from now on.
    #[cfg(feature = "dialect-reprap")]
    pub fn lend(&self, on: bool) {
        if let Some(lends) = self.on.first() {
            lends.set(on);
        }
    }

    fn is_on(&self) -> bool {
        self.on.first().is_some_and(Cell::get)
    }

    /// Notes that settings may have changed. Returns whether they are lent. A single setting that is not lent is the
    /// machine's own again. Many are those whose limits may have been lowered: while the machine lends, these are the
    /// velocities.
    #[inline(never)]
    pub fn notes(&self, from: u8, count: u8) -> bool {
        let lends = self.is_on();
        if LENDS == 0 || (!lends && count != 1) {
            return false;
        }
        for number in from..from.saturating_add(count) {
            if count == 1 || lends && Setting::from_number(number).is_some_and(Setting::is_velocity)
            {
                self.set(number, lends);
            }
        }
        lends
    }

    fn set(&self, number: u8, lent: bool) {
        if let Some(bits) = self.settings.get(usize::from(number / 8)) {
            let bit = 1 << (number % 8);
            bits.set(if lent { bits.get() | bit } else { bits.get() & !bit });
        }
    }

    /// Whether a setting is lent.
    pub fn has(&self, number: u8) -> bool {
        self.settings
            .get(usize::from(number / 8))
            .is_some_and(|bits| bits.get() >> (number % 8) & 1 != 0)
    }

    /// Returns a setting that is lent, which is not from now on.
    #[cfg(feature = "dialect-reprap")]
    #[inline(never)]
    pub fn take(&self) -> Option<Setting> {
        let number = (0..ITEMS).find(|number| self.has(*number))?;
        self.set(number, false);
        Setting::from_number(number)
    }

    /// Makes all settings the machine's own. Returns whether any was lent.
    pub fn clear(&self) -> bool {
        self.settings.iter().fold(false, |any, bits| any | (bits.replace(0) != 0))
    }

    /// Returns the values of [`LENT`], if they are lent.
    pub fn row(&self) -> Option<PerAxis<Length>> {
        self.row.first().and_then(Cell::get)
    }

    /// Sets the values of [`LENT`] that are lent.
    pub fn put_row(&self, values: Option<PerAxis<Length>>) {
        if let Some(row) = self.row.first() {
            row.set(values);
        }
    }

    /// Takes a change of [`LENT`]. Returns whether its values are lent.
    pub fn put(&self, values: PerAxis<Length>) -> bool {
        let lends = self.is_on();
        self.put_row(Some(values).filter(|_| lends));
        lends
    }
}
