//! An SD card: its files, and the one that is being printed.
//!
//! Owned by thread mode; the parser task alone calls it. FAT16 and FAT32 are `embedded-sdmmc`'s, which keeps one block
//! of 512 bytes; blocks come from the `device`. Files are those of the root, by their short names.
//!
//! A line of the file that is printed is read where it lies, up to its end or to the end of a block. If a block has to
//! come first, the card is asked for it, and `Line::Later` says so: nobody waits for the card then, but for the 1.5 ms
//! in which the block is handed over. All else, which an idle machine is asked for, waits for its blocks, for 100 ms
//! each at most. What goes wrong is [`CardError`](crate::status::Status::CardError), and ends a print.

#[cfg(feature = "sd")]
mod device;
#[cfg(feature = "sd")]
mod files;

#[cfg(feature = "sd")]
pub use files::{Card, LINE_MAX, Line};

/// Bytes of a short name, with its point.
pub const NAME_MAX: usize = 12;

/// A file of the list.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Entry {
    /// Its name; what is behind is 0.
    pub name: [u8; NAME_MAX],
    /// Bytes.
    pub size: u32,
}

/// What a card is asked for.
#[derive(Clone, Copy, Debug)]
pub enum Op<'a> {
    /// To be got ready, M21. [`Again`](crate::status::Status::Again): it is not yet.
    Begin,
    /// To be forgotten, M22.
    Release,
    /// To choose a file, M23.
    Open(&'a [u8]),
    /// To print it, M24; or no longer, M25.
    Print(bool),
    /// To go to a byte of it, M26.
    Seek(u32),
    /// To delete a file, M30.
    Delete(&'a [u8]),
}
