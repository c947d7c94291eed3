//! The files of a card, and the lines of the file that is printed.

use heapless::Vec;

use super::device::{BLOCK, Blocks, Fault};
use super::fat::{File, Found, HIDDEN, Volume};
#[cfg(feature = "card-write")]
use super::write::Writer;
use super::{Entry, NAME_MAX, PRINTS, REST, use_byte};
#[cfg(feature = "card-write")]
use super::{WRITES, writes};
use crate::capability::Capability;
use crate::hal::Thread;
use crate::status::Status;

/// The longest line, without what is behind a `;`.
pub const LINE_MAX: usize = if Capability::CardWrite.is_built_in() { 254 } else { 80 };
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
    #[cfg(feature = "card-write")]
    writer: Writer,
    /// Why the file that is being written cannot be completed. Its lines are refused until its end, because a sender
    /// goes on to send them, and they must not run.
    #[cfg(feature = "card-write")]
    spoilt: Option<Status>,
    /// Whether the program that was writing the file has closed its port.
    #[cfg(feature = "card-write")]
    forsaken: bool,
    /// Lines of the selected file that have been read.
    lines: u32,
}

#[small]
impl Card {
    /// Returns a card that has not been initialized.
    pub fn new(thread: Thread) -> Self {
        use_byte().set(REST);
        Self {
            blocks: Blocks::new(thread),
            volume: None,
            file: None,
            skips: false,
            is_long: false,
            jumps: false,
            #[cfg(feature = "card-write")]
            writer: Writer::new(),
            #[cfg(feature = "card-write")]
            spoilt: None,
            #[cfg(feature = "card-write")]
            forsaken: false,
            lines: 0,
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
        use_byte().set(REST);
        self.jumps = true;
        self.file = None;
        #[cfg(feature = "card-write")]
        self.writer.give_up();
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
        (self.skips, self.is_long, self.lines) = (false, false, 0);
        Status::Ok
    }

    /// Returns the number of the line that was read last, unless M26 has moved in the file.
    pub fn lines(&self) -> u32 {
        self.lines
    }

    /// Has the file end behind the line that was read last, as after M2.
    pub fn end(&mut self) {
        if let Some((_, size)) = self.progress() {
            self.seek(size);
        }
    }

    /// Spoils the file that is being written, because its program has closed its port. Lines of that program may still
    /// wait; behind them the file is given up: see [`Card::leave`].
    #[cfg(feature = "card-write")]
    pub fn forsake(&mut self) {
        self.interrupt();
        self.forsaken = true;
    }

    /// Gives up a file whose program has closed its port. To be called when no line waits.
    #[cfg(feature = "card-write")]
    pub fn leave(&mut self) {
        if writes() && self.forsaken {
            self.close();
        }
    }

    /// Spoils the file that is being written, if there is one: it lacks a line, for this reason.
    #[cfg(feature = "card-write")]
    pub fn spoil(&mut self, status: Status) {
        if writes() {
            self.spoilt = self.spoilt.or(Some(status));
        }
    }

    /// Ends the print, or spoils the file that is being written: an alarm or a flush has dropped lines. The file stays
    /// selected.
    pub fn interrupt(&mut self) {
        #[cfg(feature = "card-write")]
        if writes() {
            return self.spoil(Status::KillJob);
        }
        let _ = self.print(false);
    }

    /// Deletes a file, M30, unless it is selected ([`Status::NotAccepted`]). [`Status::UnrecognizedName`]: there is none
    /// with this name. [`Status::Again`]: its clusters are being freed.
    #[inline(never)]
    pub fn delete(&mut self, name: &[u8]) -> Status {
        #[cfg(feature = "card-write")]
        if self.writer.is_busy() {
            return self.go_on(|card, volume| {
                card.writer.step(volume, &mut card.blocks)?;
                Ok(!card.writer.is_busy())
            });
        }
        let found = match self.find(name) {
            Ok(found) => found,
            Err(status) => return status,
        };
        if self.file.is_some_and(|file| file.found.place == found.place) {
            return Status::NotAccepted;
        }
        let deleted = Volume::delete(&found, &mut self.blocks);
        #[cfg(feature = "card-write")]
        if deleted.is_ok() {
            self.writer.free(found.first);
            return Status::Again;
        }
        status(deleted)
    }

    /// Begins to write a file, M28. [`Status::UnrecognizedName`]: no file can have this name.
    #[cfg(feature = "card-write")]
    pub fn create(&mut self, name: &[u8]) -> Status {
        self.close();
        if self.volume.is_none() {
            return Status::CardError;
        }
        if !self.writer.begin(name) {
            return Status::UnrecognizedName;
        }
        (self.spoilt, self.forsaken) = (None, false);
        use_byte().set(WRITES);
        Status::Ok
    }

    /// Appends a line to the file that is being written. [`Status::Again`]: not all of it has been taken yet. Cost: that
    /// of a step of the [writer](super::write) at most.
    #[cfg(feature = "card-write")]
    pub fn append(&mut self, line: &[u8]) -> Status {
        if let Some(status) = self.spoilt {
            return status;
        }
        self.go_on(|card, volume| card.writer.append(line, volume, &mut card.blocks))
    }

    /// Completes the file that is being written, M29: from now on it is there. [`Status::Again`]: not yet.
    #[cfg(feature = "card-write")]
    pub fn finish(&mut self) -> Status {
        if !writes() {
            return Status::NotAccepted;
        }
        if let Some(status) = self.spoilt {
            self.close();
            return status;
        }
        let done = self.go_on(|card, volume| card.writer.finish(volume, &mut card.blocks));
        if done != Status::Again {
            self.close();
        }
        done
    }

    /// Does a part of the writer's work, which returns whether it is done. A failure gives the file up.
    #[cfg(feature = "card-write")]
    fn go_on(&mut self, work: impl FnOnce(&mut Self, &Volume) -> Result<bool, Fault>) -> Status {
        self.blocks.patient = false;
        let done = match self.volume {
            Some(volume) => work(self, &volume),
            None => Err(Fault::Failed),
        };
        self.blocks.patient = true;
        match done {
            Ok(true) => Status::Ok,
            Ok(false) | Err(Fault::Later) => Status::Again,
            Err(fault) => {
                let status =
                    if fault == Fault::Full { Status::CardFull } else { Status::CardError };
                self.spoil(status);
                self.writer.give_up();
                status
            }
        }
    }

    /// Sets whether lines are taken from the file: M24, M25. Without a file none are: [`Status::NotAccepted`].
    pub fn print(&mut self, prints: bool) -> Status {
        if prints && self.file.is_none() {
            return Status::NotAccepted;
        }
        use_byte().set(if prints { PRINTS } else { REST });
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

    /// Returns the position of the next byte of the file, and the length of the file. `None` without a file. For a
    /// file that is being written, both are its length so far.
    pub fn progress(&self) -> Option<(u32, u32)> {
        #[cfg(feature = "card-write")]
        if writes() {
            return Some((self.writer.size(), self.writer.size()));
        }
        self.file.map(|file| (file.at, file.found.entry.size))
    }

    /// Returns the name of the selected file, or of the one that is being written; zeros without one.
    pub fn name(&self) -> [u8; NAME_MAX] {
        #[cfg(feature = "card-write")]
        if writes() {
            return self.writer.name();
        }
        self.file.map_or([0; NAME_MAX], |file| file.found.entry.name)
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
            Err(_) => return Line::Failed,
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
                self.lines += 1;
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
fn status<T>(done: Result<T, Fault>) -> Status {
    if done.is_ok() { Status::Ok } else { Status::CardError }
}
