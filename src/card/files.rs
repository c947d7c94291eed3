//! The files of a card, and the lines of the file that is printed.

use heapless::Vec;

use super::device::{BLOCK, Blocks, Fault};
use super::fat::{File, Found, HIDDEN, Volume};
use super::{Entry, NAME_MAX, prints_byte};
use crate::status::Status;

/// The longest line, without its comment.
pub const LINE_MAX: usize = 80;
/// The most bytes that are read at once.
const PIECE: usize = 40;
/// The most clusters over which the chain of a file is followed at once.
const LINKS: u8 = 32;

/// The result of reading a part of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Line {
    /// The line is complete. It may be empty.
    Whole,
    /// The line continues after the part that has been read.
    More,
    /// The block with the rest of the line has not come yet.
    Later,
    /// The end of the file.
    End,
    /// The file cannot be read.
    Failed,
    /// The line is longer than [`LINE_MAX`] and has been skipped.
    Long,
}

/// The card and its open file: see the [parent module](super).
pub struct Card {
    blocks: Blocks,
    volume: Option<Volume>,
    file: Option<File>,
    /// Whether the rest of the line is skipped, because it is a comment or too long.
    skips: bool,
    is_long: bool,
    /// Whether reading continues at another place in the file, so that the part of a line that has been read is
    /// dropped.
    jumps: bool,
}

#[small]
impl Card {
    /// Returns a card that has not been initialized.
    pub fn new() -> Self {
        prints_byte().set(0);
        Self {
            blocks: Blocks::new(),
            volume: None,
            file: None,
            skips: false,
            is_long: false,
            jumps: false,
        }
    }

    /// Initializes the card, M21. [`Status::Again`]: it is not ready yet.
    #[inline(never)]
    pub fn begin(&mut self) -> Status {
        self.release();
        let begun = self.blocks.begin();
        if begun == Ok(false) {
            return Status::Again;
        }
        let opened = begun.and_then(|_| Volume::open(&mut self.blocks));
        self.volume = opened.ok();
        status(opened)
    }

    /// Releases the card, M22.
    pub fn release(&mut self) {
        self.close();
        self.volume = None;
    }

    /// Closes the selected file, if there is one: the print has ended.
    pub fn close(&mut self) {
        prints_byte().set(0);
        self.jumps = true;
        self.file = None;
        self.blocks.settle();
    }

    /// Selects a file, M23. [`Status::UnrecognizedName`]: there is none with this name.
    #[inline(never)]
    pub fn open(&mut self, name: &[u8]) -> Status {
        self.close();
        let found = match self.find(name) {
            Ok(found) => found,
            Err(status) => return status,
        };
        self.file = Some(File::new(found));
        (self.skips, self.is_long) = (false, false);
        Status::Ok
    }

    /// Deletes a file, M30, unless it is selected ([`Status::NotAccepted`]). [`Status::UnrecognizedName`]: there is none
    /// with this name.
    #[inline(never)]
    pub fn delete(&mut self, name: &[u8]) -> Status {
        let found = match self.find(name) {
            Ok(found) => found,
            Err(status) => return status,
        };
        if self.file.is_some_and(|file| file.found.place == found.place) {
            return Status::NotAccepted;
        }
        status(Volume::delete(&found, &mut self.blocks))
    }

    /// Sets whether lines are taken from the file: M24, M25. Without a file none are: [`Status::NotAccepted`].
    pub fn print(&mut self, prints: bool) -> Status {
        if prints && self.file.is_none() {
            return Status::NotAccepted;
        }
        prints_byte().set(prints.into());
        if !prints {
            // While the card is selected the sensor on the same lines cannot be read.
            self.blocks.settle();
        }
        Status::Ok
    }

    /// Moves to a byte of the file, M26. [`Status::OutOfRange`]: the file is not that long.
    pub fn seek(&mut self, at: u32) -> Status {
        let Some(file) = self.file.as_mut().filter(|file| at <= file.found.entry.size) else {
            return Status::OutOfRange;
        };
        file.at = at;
        (self.skips, self.is_long, self.jumps) = (false, false, true);
        Status::Ok
    }

    /// Returns the position of the next byte of the file, and the length of the file. `None` without a file.
    pub fn progress(&self) -> Option<(u32, u32)> {
        self.file.map(|file| (file.at, file.found.entry.size))
    }

    /// Returns the file with this number in the root directory. `Err`: the card cannot be read.
    #[inline(never)]
    pub fn entry(&mut self, number: u8) -> Result<Option<Entry>, Status> {
        let mut left = number;
        let found = self.search(|found| {
            let is_listed = !found.is_folder() && found.attributes & HIDDEN == 0;
            let is_it = is_listed && left == 0;
            left = left.wrapping_sub(is_listed.into());
            is_it
        });
        found.map(|found| found.map(|found| found.entry)).map_err(|_| Status::CardError)
    }

    /// Returns the file with this name. [`Status::UnrecognizedName`]: there is none.
    #[inline(never)]
    fn find(&mut self, name: &[u8]) -> Result<Found, Status> {
        let found = self.search(|found| {
            let kept = found.entry.name.iter().position(|letter| *letter == 0).unwrap_or(NAME_MAX);
            found.entry.name.get(..kept).is_some_and(|kept| kept.eq_ignore_ascii_case(name))
        });
        let found = found.map_err(|_| Status::CardError)?;
        found.filter(|found| !found.is_folder()).ok_or(Status::UnrecognizedName)
    }

    /// Returns the first entry of the root directory for which `is_it` returns true.
    fn search(&mut self, mut is_it: impl FnMut(&Found) -> bool) -> Result<Option<Found>, Fault> {
        let volume = self.volume.ok_or(Fault::Failed)?;
        let mut at = volume.root()?;
        loop {
            let found = volume.entry(&mut at, &mut self.blocks)?;
            if found.is_none_or(|found| is_it(&found)) {
                return Ok(found);
            }
        }
    }

    /// Reads the next part of the line that is being printed. Cost: 3,000 cycles, with a new block 25,000 more.
    #[inline(never)]
    pub fn line(&mut self, line: &mut Vec<u8, LINE_MAX>) -> Line {
        if core::mem::take(&mut self.jumps) {
            line.clear();
        }
        let Some((at, size)) = self.progress() else { return Line::Failed };
        if at >= size {
            return if line.is_empty() { Line::End } else { Line::Whole };
        }
        let mut piece = [0; PIECE];
        self.blocks.patient = false;
        let read = self.piece(&mut piece);
        self.blocks.patient = true;
        let read = match read {
            Ok(0) => return Line::More,
            Ok(read) => read,
            Err(Fault::Later) => return Line::Later,
            Err(Fault::Failed) => return Line::Failed,
        };
        let piece = piece.get(..read).unwrap_or(&[]);
        let end = piece.iter().position(|byte| *byte == b'\n');
        let taken = end.map_or(read, |end| end + 1);
        for byte in piece.iter().take(taken) {
            self.take(*byte, line);
        }
        if let Some(file) = &mut self.file {
            file.at = at + taken as u32;
        }
        match end {
            None => Line::More,
            Some(_) => {
                self.skips = false;
                while line.last() == Some(&b' ') {
                    line.pop();
                }
                if core::mem::take(&mut self.is_long) { Line::Long } else { Line::Whole }
            }
        }
    }

    /// Copies the next bytes of the file, up to the end of a block at most. Returns their number. 0: the chain of
    /// clusters has not been followed far enough yet.
    #[inline(never)]
    fn piece(&mut self, to: &mut [u8; PIECE]) -> Result<usize, Fault> {
        let volume = self.volume.ok_or(Fault::Failed)?;
        let file = self.file.as_mut().ok_or(Fault::Failed)?;
        let Some(block) = file.block(&volume, LINKS, &mut self.blocks)? else { return Ok(0) };
        let bytes = self.blocks.read(block)?.get((file.at % BLOCK as u32) as usize..);
        let bytes = bytes.unwrap_or(&[]);
        let left = file.found.entry.size.saturating_sub(file.at).min(PIECE as u32) as usize;
        let read = bytes.len().min(left);
        for (place, byte) in to.iter_mut().zip(bytes).take(read) {
            *place = *byte;
        }
        Ok(read)
    }

    fn take(&mut self, byte: u8, line: &mut Vec<u8, LINE_MAX>) {
        self.skips |= byte == b';';
        let is_kept = !self.skips && !matches!(byte, b'\n' | b'\r');
        if is_kept && line.push(byte).is_err() {
            (self.skips, self.is_long) = (true, true);
        }
    }
}

#[small]
impl Default for Card {
    fn default() -> Self {
        Self::new()
    }
}

#[small]
fn status<T>(done: Result<T, Fault>) -> Status {
    if done.is_ok() { Status::Ok } else { Status::CardError }
}
