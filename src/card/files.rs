//! The files of a card, and the lines of the file that is printed.

use embedded_sdmmc::{
    Mode, RawDirectory, RawFile, RawVolume, TimeSource, Timestamp, VolumeIdx, VolumeManager,
};
use heapless::{String, Vec};

use super::device::{Device, Fault, set_patient};
use super::{Entry, NAME_MAX};
use crate::status::Status;

/// The longest line, without its comment.
pub const LINE_MAX: usize = 80;

type Manager = VolumeManager<Device, NoClock, 1, 1, 1>;
type Error = embedded_sdmmc::Error<Fault>;

/// The board has no clock, so files keep their times.
#[derive(Debug)]
struct NoClock;

impl TimeSource for NoClock {
    fn get_timestamp(&self) -> Timestamp {
        Timestamp {
            year_since_1970: 0,
            zero_indexed_month: 0,
            zero_indexed_day: 0,
            hours: 0,
            minutes: 0,
            seconds: 0,
        }
    }
}

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
    manager: Manager,
    root: Option<(RawVolume, RawDirectory)>,
    file: Option<RawFile>,
    /// Whether lines are taken from the file.
    prints: bool,
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
        Self {
            manager: Manager::new_with_limits(Device::new(), NoClock, 1),
            root: None,
            file: None,
            prints: false,
            skips: false,
            is_long: false,
            jumps: false,
        }
    }

    /// Initializes the card, M21. [`Status::Again`]: it is not ready yet.
    #[inline(never)]
    pub fn begin(&mut self) -> Status {
        self.release();
        match self.manager.device(|device| device.begin()) {
            Ok(true) => {}
            Ok(false) => return Status::Again,
            Err(_) => return Status::CardError,
        }
        let opened = self.manager.open_raw_volume(VolumeIdx(0)).and_then(|volume| {
            let root = self.manager.open_root_dir(volume)?;
            self.root = Some((volume, root));
            Ok(())
        });
        status(opened)
    }

    /// Releases the card, M22.
    #[inline(never)]
    pub fn release(&mut self) {
        self.close();
        if let Some((volume, root)) = self.root.take() {
            let _ = self.manager.close_dir(root);
            let _ = self.manager.close_volume(volume);
        }
    }

    /// Closes the selected file, if there is one: the print has ended.
    pub fn close(&mut self) {
        (self.prints, self.jumps) = (false, true);
        if let Some(file) = self.file.take() {
            let _ = self.manager.close_file(file);
        }
    }

    /// Selects a file, M23.
    #[inline(never)]
    pub fn open(&mut self, name: &[u8]) -> Status {
        self.close();
        let Some((_, root)) = self.root else { return Status::CardError };
        let Some(name) = text(name) else { return Status::CardError };
        match self.manager.open_file_in_dir(root, name.as_str(), Mode::ReadOnly) {
            Ok(file) => {
                self.file = Some(file);
                (self.skips, self.is_long) = (false, false);
                Status::Ok
            }
            Err(_) => Status::CardError,
        }
    }

    /// Deletes a file, M30, unless it is selected.
    #[inline(never)]
    pub fn delete(&mut self, name: &[u8]) -> Status {
        let Some((_, root)) = self.root else { return Status::CardError };
        let Some(name) = text(name) else { return Status::CardError };
        let done = self.manager.delete_entry_in_dir(root, name.as_str());
        status(done)
    }

    /// Sets whether lines are taken from the file: M24, M25.
    pub fn print(&mut self, prints: bool) -> Status {
        if prints && self.file.is_none() {
            return Status::CardError;
        }
        self.prints = prints;
        Status::Ok
    }

    /// Whether lines are taken from the file.
    pub fn prints(&self) -> bool {
        self.prints
    }

    /// Moves to a byte of the file, M26.
    pub fn seek(&mut self, at: u32) -> Status {
        let Some(file) = self.file else { return Status::CardError };
        (self.skips, self.is_long, self.jumps) = (false, false, true);
        let done = self.manager.file_seek_from_start(file, at);
        status(done)
    }

    /// Returns the position of the next byte of the file, and the length of the file. `None` without a file.
    pub fn progress(&self) -> Option<(u32, u32)> {
        let file = self.file?;
        Some((self.manager.file_offset(file).ok()?, self.manager.file_length(file).ok()?))
    }

    /// Returns the file with this number in the root directory. `Err`: the card cannot be read.
    #[inline(never)]
    pub fn entry(&mut self, number: u8) -> Result<Option<Entry>, Status> {
        let Some((_, root)) = self.root else { return Err(Status::CardError) };
        let (mut left, mut found) = (number, None);
        let done = self.manager.iterate_dir(root, |entry| {
            let flags = entry.attributes;
            let hides = flags.is_volume() || flags.is_directory() || flags.is_hidden();
            if hides || found.is_some() {
                return core::ops::ControlFlow::Continue(());
            }
            if left == 0 {
                found = Some(named(&entry.name, entry.size));
            }
            left = left.wrapping_sub(1);
            core::ops::ControlFlow::Continue(())
        });
        done.map(|()| found).map_err(|_| Status::CardError)
    }

    /// Reads the next part of the line that is being printed. Cost: 3,000 cycles, with a new block 25,000 more.
    #[inline(never)]
    pub fn line(&mut self, line: &mut Vec<u8, LINE_MAX>) -> Line {
        let Some(file) = self.file else { return Line::Failed };
        if core::mem::take(&mut self.jumps) {
            line.clear();
        }
        let mut piece = [0; PIECE];
        let Some((at, size)) = self.progress() else { return Line::Failed };
        if at >= size {
            return if line.is_empty() { Line::End } else { Line::Whole };
        }
        let in_block = BLOCK - at % BLOCK;
        let wanted = piece.len().min(in_block as usize);
        set_patient(false);
        let read = self.manager.read(file, piece.get_mut(..wanted).unwrap_or(&mut []));
        set_patient(true);
        let read = match read {
            Ok(read) => read,
            Err(Error::DeviceError(Fault::Later)) => return Line::Later,
            Err(_) => return Line::Failed,
        };
        let piece = piece.get(..read).unwrap_or(&[]);
        let end = piece.iter().position(|byte| *byte == b'\n');
        let taken = end.map_or(read, |end| end + 1);
        for byte in piece.iter().take(taken) {
            self.take(*byte, line);
        }
        if taken < read {
            let _ = self.manager.file_seek_from_start(file, at + taken as u32);
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

/// The most bytes that are read at once.
const PIECE: usize = 40;
const BLOCK: u32 = 512;

#[small]
fn status<T>(done: Result<T, Error>) -> Status {
    if done.is_ok() { Status::Ok } else { Status::CardError }
}

#[small]
fn named(name: &embedded_sdmmc::ShortFileName, size: u32) -> Entry {
    let mut entry = Entry { name: [0; NAME_MAX], size };
    let (base, extension) = (name.base_name(), name.extension());
    let point: &[u8] = if extension.is_empty() { b"" } else { b"." };
    let letters = base.iter().chain(point).chain(extension);
    for (place, letter) in entry.name.iter_mut().zip(letters) {
        *place = *letter;
    }
    entry
}

/// Returns a short name as text. The function of the standard library is not used, because its table of UTF-8 would be
/// in RAM.
#[small]
fn text(name: &[u8]) -> Option<String<NAME_MAX>> {
    let mut text = String::new();
    for letter in name {
        let is_known = letter.is_ascii_graphic();
        text.push(char::from(*letter)).ok().filter(|()| is_known)?;
    }
    Some(text)
}
