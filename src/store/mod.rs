//! What survives a power cut: settings, coordinate systems, stored positions and tools, in EEPROM.
//!
//! ```text
//! a setting is stored -> Storage (which items to look at) -> storage task
//! G10, G28.1          -> Storage (the row on its way)      -> storage task
//!     -> kept, tables (key, value) -> Log (which slot next) -> Memory, a byte each 3.4 ms
//! reset -> Log::open -> kept::load -> Settings
//! a line that asks for a row -> Storage, else tables::row -> Log::find
//! ```
//! Most settings are in RAM, too; the others (PWM, user data) and the tables of the interpreter are here alone.
//!
//! The EEPROM is a ring of records, each of which says what one item is ([`record`]); the newest record of an
//! item counts. A new record goes into a slot that holds nothing of worth, and counts only when its last byte has
//! been written: whenever power fails, an item is what it was or what it was to be. Writing goes round
//! the ring, so that all cells wear alike; records that still count are moved out of the way.
//!
//! Behind the log is a program of the user's ([`program`]).
//!
//! Items are known by their names, not by their places in a table: firmware with more settings, or others,
//! finds those that it knows and takes its defaults for the rest. An item that has its default and never had
//! another takes no room. Values are checked when they are read, as if they had been sent.

pub mod kept;
pub mod log;
pub mod program;
pub mod record;
pub mod tables;

pub use log::Log;

/// A memory of bytes that keeps them without power, slowly written.
pub trait Memory {
    /// How many bytes it has.
    const SIZE: u16;
    /// How many of them, from the first, are the log's; the rest is for a program.
    const LOG: u16 = Self::SIZE;
    /// The byte at an address; waits for a write under way.
    fn read(&self, at: u16) -> u8;
    /// As [`Memory::read`], without a call: where all slots are looked through.
    #[inline(always)]
    fn read_here(&self, at: u16) -> u8 {
        self.read(at)
    }
    /// Whether a byte is being written.
    fn is_busy(&self) -> bool;
    /// Whether a byte may be written to an address at once: not while busy, unless the memory keeps it together with the one that is being written.
    #[inline(always)]
    fn takes(&self, _at: u16) -> bool {
        !self.is_busy()
    }
    /// Begins to write a byte, which it [`takes`](Memory::takes).
    fn write(&mut self, at: u16, byte: u8);
}
