//! An SD card: its files, and the file that is being printed.
//!
//! Owned by thread mode; only the parser task calls it. `fat` finds files on FAT16 and FAT32, `device` reads blocks and
//! keeps one of 512 bytes. Only files in the root directory are visible, by their short names. A card may hold
//! anything: a volume with impossible sizes, and chains of clusters without an end, are refused within bounded work.
//!
//! `write` writes files, in an image with that capability.
//!
//! A line of the printed file is read in place, up to its end or to the end of a block. If another block is needed
//! first, it is requested from the card, and `Line::Later` says so. So no task waits for the card, except for the 1.5
//! ms in which the block is transferred. All other operations, which run while the machine is idle, wait for their
//! blocks, at most 100 ms for each. A failure is [`CardError`](crate::status::Status::CardError), and ends a print.

use crate::hal::byte::SharedByte;

#[cfg(feature = "sd")]
mod device;
#[cfg(feature = "sd")]
mod fat;
#[cfg(feature = "sd")]
mod files;
#[cfg(feature = "card-write")]
mod write;

#[cfg(feature = "sd")]
pub use files::{Card, LINE_MAX, Line};

machine_static! {
    // What is done with the selected file. Only thread mode uses it.
    fn use_byte() -> SharedByte = SharedByte::new(REST);
}

/// Nothing is done with a file.
const REST: u8 = 0;
/// Lines are taken from the selected file.
const PRINTS: u8 = 1;
/// Lines are written to a file.
const WRITES: u8 = 2;

/// Whether lines of the selected file are being taken. Any level. Cost: 10 cycles.
pub fn prints() -> bool {
    cfg!(feature = "sd") && use_byte().get() == PRINTS
}

/// Whether lines are written to a file, and not run. Any level. Cost: 10 cycles.
pub fn writes() -> bool {
    cfg!(feature = "card-write") && use_byte().get() == WRITES
}

/// Whether a file is in use: lines are taken from it, or written to it. Any level. Cost: 20 cycles.
pub fn is_in_use() -> bool {
    prints() || writes()
}

/// The length of a short name in bytes, with its point.
pub const NAME_MAX: usize = 12;

/// A file in the list of files.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Entry {
    /// The name, padded with zeros.
    pub name: [u8; NAME_MAX],
    /// The length in bytes.
    pub size: u32,
}

/// Returns the letters of a name that is padded with zeros.
pub fn letters(name: &[u8; NAME_MAX]) -> impl Iterator<Item = u8> {
    name.iter().copied().take_while(|letter| *letter != 0)
}

/// An operation on the card.
#[derive(Clone, Copy, Debug)]
pub enum Op<'a> {
    /// Initializes the card, M21. [`Again`](crate::status::Status::Again): it is not ready yet.
    Begin,
    /// Releases the card, M22.
    Release,
    /// Selects a file, M23.
    Open(&'a [u8]),
    /// Starts to print the file, M24, or pauses, M25.
    Print(bool),
    /// Moves to a byte of the file, M26.
    Seek(u32),
    /// Deletes a file, M30. [`Again`](crate::status::Status::Again): its clusters are being freed.
    Delete(&'a [u8]),
    /// Begins to write a file, M28: lines are written from now on, and not run.
    Create(&'a [u8]),
    /// Completes the file, M29. [`Again`](crate::status::Status::Again): it is not complete yet.
    Finish,
    /// Gives up the file that is being written, or ends the print.
    Drop,
}
