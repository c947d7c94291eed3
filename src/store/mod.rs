//! What survives a power cut, in EEPROM: settings, coordinate systems, stored positions and tools.
//!
//! ```text
//! a setting is stored -> Storage (which items to look at) -> storage task
//! G10, G28.1          -> Storage (the row on its way)      -> storage task
//!     -> kept, tables (key, value) -> Log (which slot next) -> Memory, a byte each 3.4 ms
//! reset -> Log::open -> kept::load -> Settings
//! a line that asks for a row -> Storage, else tables::row -> Log::search
//! ```
//! Most settings are in RAM as well. The others (PWM, user data) and the tables of the interpreter are in EEPROM
//! only.
//!
//! The EEPROM is a ring of records. Each record holds the value of one item ([`record`]), and the newest record of an
//! item is the valid one. A new record goes into a slot whose content is no longer needed, and becomes valid with its
//! last byte. So at any power failure an item has either its old or its new value. Writing goes round the ring, so that
//! all cells wear alike. Records that are still valid are copied to another slot before their own slot is overwritten.
//!
//! A change of many settings at once has a record before them and one behind them ([`kept::Change`]). If power fails
//! between these, the next start makes the change again.
//!
//! Behind the log is a program of the user ([`program`]).
//!
//! Items are known by their names, not by their places in a table. Firmware with more settings, or with other settings,
//! finds the items that it knows and uses its defaults for the others. An item whose value has always been the default
//! takes no room. Values are checked when they are read, as if they had been sent.

pub mod kept;
pub mod log;
pub mod program;
pub mod record;
pub mod tables;

pub use log::Log;

/// A non-volatile memory of bytes, which is slow to write.
pub trait Memory {
    /// The size of the memory, in bytes.
    const SIZE: u16;
    /// The size of the log, in bytes, from the start of the memory. The rest is for a program.
    const LOG: u16 = Self::SIZE;
    /// Returns the byte at an address. Waits for a write that is in progress.
    fn read(&self, at: u16) -> u8;
    /// As [`Memory::read`], but inlined: for loops over all slots.
    #[inline(always)]
    fn read_here(&self, at: u16) -> u8 {
        self.read(at)
    }
    /// Whether some bytes could not be read at the start.
    #[inline(always)]
    fn is_lost(&self) -> bool {
        false
    }
    /// Whether a byte is being written.
    fn is_busy(&self) -> bool;
    /// Whether a byte may be written to an address at once. While the memory is busy this is `true` only if the
    /// memory can combine the byte with the one that is being written.
    #[inline(always)]
    fn takes(&self, _at: u16) -> bool {
        !self.is_busy()
    }
    /// Begins to write a byte. Requires [`takes`](Memory::takes).
    fn write(&mut self, at: u16, byte: u8);
}
