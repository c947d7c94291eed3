//! Writes a file to a card, block by block, and frees the clusters of files that are gone.
//!
//! Owned by the [card](super::Card); thread mode. A file appears in the directory with its last block, by one write of
//! one block: a power cut before leaves what was there, and some clusters that belong to nobody until the card is
//! checked by a computer. So does an upload that is given up. A file of the same name is replaced in the same way, and
//! its clusters are freed behind it.
//!
//! [`Writer::step`] reads or writes one block at most, or returns [`Fault::Later`] while the card is busy. So nothing
//! waits for the card. A card without a free cluster is [`Fault::Full`], and so is a root directory without a free
//! entry. Cost of a step: 0.4 ms of an RP2040 for a block.

use super::NAME_MAX;
use super::device::{BLOCK, Blocks, Fault};
use super::fat::{BLOCK_SHIFT, ENTRY, FIRST, LINK, Place, Slot, Volume, double, shown_name};

/// Bytes of a short name without its point.
const NAME: usize = 11;
/// The most bytes of a file.
const SIZE_MOST: u32 = u32::MAX - 2 * BLOCK as u32;
/// The date of all files, 1 January 1980, because Kerf has no clock; where it is in an entry.
const DATE: u8 = 0x21;
const DATES: [usize; 3] = [16, 18, 24];
/// The attribute of a file that has been written.
const ARCHIVE: u8 = 0x20;
/// Where the block with the count of free clusters has its marks and the count.
const MARKS: [(usize, u32); 2] = [(0, 0x4161_5252), (484, 0x6141_7272)];
const COUNT: usize = 488;

/// What the next step does.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// Nothing is being written.
    Idle,
    /// The count of free clusters becomes unknown.
    Marks,
    /// The buffer takes bytes.
    Fills,
    /// Looks for a free cluster.
    Finds,
    /// Takes the cluster that was found as the last one of a chain.
    Takes,
    /// Links the cluster before to it.
    Links,
    /// Writes the block of the table that has changed to the copy of the table.
    Copies,
    /// Writes the buffer.
    Stores,
    /// Enters the file into the directory.
    Enters,
    /// Frees clusters.
    Frees,
}

/// A file that is being written.
pub struct Writer {
    stage: Stage,
    name: [u8; NAME],
    /// Bytes that are not on the card yet.
    buffer: [u8; BLOCK],
    fill: usize,
    /// How many bytes of the present line have been taken.
    taken: usize,
    /// Bytes on the card.
    size: u32,
    /// The first cluster of the file, and its last one; 0 for none.
    first: u32,
    last: u32,
    /// Where to look for a free cluster, and how many have been looked at.
    search: u32,
    looked: u32,
    /// The next cluster to be freed.
    frees: u32,
    /// The block of the table that has changed, and what is done when its copy has been written.
    changed: u32,
    then: Stage,
}

impl Writer {
    /// Returns a writer that writes nothing.
    pub const fn new() -> Self {
        Self {
            stage: Stage::Idle,
            name: [b' '; NAME],
            buffer: [0; BLOCK],
            fill: 0,
            taken: 0,
            size: 0,
            first: 0,
            last: 0,
            search: FIRST,
            looked: 0,
            frees: 0,
            changed: 0,
            then: Stage::Idle,
        }
    }

    /// Whether anything is to be done: a file is being written, or clusters are being freed.
    pub fn is_busy(&self) -> bool {
        self.stage != Stage::Idle
    }

    /// Returns the bytes of the file so far.
    pub fn size(&self) -> u32 {
        self.size + self.fill as u32
    }

    /// Returns the name of the file, with its point.
    pub fn name(&self) -> [u8; NAME_MAX] {
        shown_name(&self.name)
    }

    /// Begins to write a file. `false`: it cannot have this name.
    pub fn begin(&mut self, name: &[u8]) -> bool {
        let Some(name) = short_name(name) else { return false };
        let search = self.search;
        *self = Self { stage: Stage::Marks, name, search, ..Self::new() };
        true
    }

    /// Begins to free a chain of clusters.
    pub fn free(&mut self, first: u32) {
        (self.stage, self.frees) = (Stage::Frees, first);
    }

    /// Gives up. What has been written belongs to no file.
    pub fn give_up(&mut self) {
        self.stage = Stage::Idle;
    }

    /// Appends a line and a line end. Returns whether all of it has been taken; if not, this is to be called again.
    pub fn append(
        &mut self,
        line: &[u8],
        volume: &Volume,
        blocks: &mut Blocks,
    ) -> Result<bool, Fault> {
        if self.stage != Stage::Fills {
            self.step(volume, blocks)?;
        }
        if self.stage != Stage::Fills {
            return Ok(false);
        }
        let rest = line.iter().chain(b"\n").skip(self.taken);
        let mut taken = 0;
        for (place, byte) in self.buffer.iter_mut().skip(self.fill).zip(rest) {
            *place = *byte;
            taken += 1;
        }
        (self.fill, self.taken) = (self.fill + taken, self.taken + taken);
        if self.fill == BLOCK {
            self.store(volume);
        }
        let is_done = self.taken > line.len();
        if is_done {
            self.taken = 0;
        }
        Ok(is_done)
    }

    /// Completes the file. Returns whether it is complete; if not, this is to be called again.
    pub fn finish(&mut self, volume: &Volume, blocks: &mut Blocks) -> Result<bool, Fault> {
        if self.stage == Stage::Fills && self.fill > 0 {
            self.buffer.iter_mut().skip(self.fill).for_each(|byte| *byte = 0);
            self.store(volume);
        } else if self.stage == Stage::Fills {
            self.stage = Stage::Enters;
        }
        self.step(volume, blocks)?;
        Ok(!self.is_busy())
    }

    /// Has the buffer written, to a new cluster if the last one is full.
    fn store(&mut self, volume: &Volume) {
        let is_full = self.last == 0 || volume.in_cluster(self.size >> BLOCK_SHIFT) == 0;
        self.stage = if is_full { Stage::Finds } else { Stage::Stores };
        self.looked = 0;
    }

    /// Does the next part of the work.
    pub fn step(&mut self, volume: &Volume, blocks: &mut Blocks) -> Result<(), Fault> {
        match self.stage {
            Stage::Idle | Stage::Fills => {}
            Stage::Marks => {
                mark(volume, blocks)?;
                self.stage = Stage::Fills;
            }
            Stage::Finds => self.find(volume, blocks)?,
            Stage::Takes => {
                let is_first = self.last == 0;
                let then = if is_first { Stage::Stores } else { Stage::Links };
                self.link(self.search, LINK, then, volume, blocks)?;
                if is_first {
                    (self.first, self.last) = (self.search, self.search);
                }
            }
            Stage::Links => {
                self.link(self.last, self.search, Stage::Stores, volume, blocks)?;
                self.last = self.search;
            }
            Stage::Copies => {
                if volume.copy != 0 {
                    blocks.copy(self.changed, self.changed + volume.copy)?;
                }
                self.stage = self.then;
            }
            Stage::Stores => {
                let block = volume.in_cluster(self.size >> BLOCK_SHIFT);
                blocks.write(volume.block_of(self.last)? + block, &self.buffer)?;
                (self.size, self.fill) = (self.size + self.fill as u32, 0);
                self.stage = Stage::Fills;
            }
            Stage::Enters => self.enter(volume, blocks)?,
            Stage::Frees => self.free_some(volume, blocks)?,
        }
        Ok(())
    }

    /// Sets the link of a cluster, then has the copy of the table written.
    fn link(
        &mut self,
        cluster: u32,
        to: u32,
        then: Stage,
        volume: &Volume,
        blocks: &mut Blocks,
    ) -> Result<(), Fault> {
        self.changed = volume.table_block(cluster);
        blocks.change(self.changed, |table| put_link(volume, cluster, to, table))?;
        (self.stage, self.then) = (Stage::Copies, then);
        Ok(())
    }

    /// Looks for a free cluster in one block of the table.
    fn find(&mut self, volume: &Volume, blocks: &mut Blocks) -> Result<(), Fault> {
        if self.size > SIZE_MOST || self.looked >= volume.end {
            return Err(Fault::Full);
        }
        if !(FIRST..volume.end).contains(&self.search) {
            self.search = FIRST;
        }
        let table = blocks.read(volume.table_block(self.search))?;
        let behind = (((self.search >> volume.links()) + 1) << volume.links()).min(volume.end);
        let free = (self.search..behind).find(|cluster| volume.link(*cluster, table) == 0);
        self.looked += behind - self.search;
        self.search = free.unwrap_or(behind);
        if free.is_some() {
            self.stage = Stage::Takes;
        }
        Ok(())
    }

    /// Enters the file into the directory. This is the moment from which on it is there.
    fn enter(&mut self, volume: &Volume, blocks: &mut Blocks) -> Result<(), Fault> {
        blocks.rest()?;
        // Bounded by the time in which a directory may be read. Without patience it would begin anew for each block.
        blocks.patient = true;
        let (place, replaces) = place(volume, &self.name, blocks)?.ok_or(Fault::Full)?;
        let mut entry = [0; ENTRY];
        put(&mut entry, 0, &self.name);
        put(&mut entry, 11, &[ARCHIVE]);
        DATES.iter().for_each(|at| put(&mut entry, *at, &[DATE]));
        let [low, high, higher, highest] = self.first.to_le_bytes();
        put(&mut entry, 20, &[higher, highest]);
        put(&mut entry, 26, &[low, high]);
        put(&mut entry, 28, &self.size.to_le_bytes());
        let (block, at) = (place.0, usize::from(place.1));
        blocks.change(block, |bytes| {
            // Behind the entry that ended the directory the next one ends it.
            if bytes.get(at) == Some(&0) {
                put(bytes, at + ENTRY, &[0]);
            }
            put(bytes, at, &entry);
        })?;
        self.free(replaces);
        Ok(())
    }

    /// Frees the clusters of a chain that lie in one block of the table.
    fn free_some(&mut self, volume: &Volume, blocks: &mut Blocks) -> Result<(), Fault> {
        let is_cluster = |cluster| (FIRST..volume.end).contains(&cluster);
        if !is_cluster(self.frees) {
            self.stage = Stage::Idle;
            return Ok(());
        }
        self.changed = volume.table_block(self.frees);
        let mut cluster = self.frees;
        blocks.change(self.changed, |table| {
            while is_cluster(cluster) && volume.table_block(cluster) == self.changed {
                let next = volume.link(cluster, table);
                put_link(volume, cluster, 0, table);
                // A chain that runs into itself ends here, because a free cluster has no link.
                cluster = next;
            }
        })?;
        self.frees = cluster;
        (self.stage, self.then) = (Stage::Copies, Stage::Frees);
        Ok(())
    }
}

/// Sets the link of a cluster in its block. The upper four bits in FAT32 are nobody's and are kept.
fn put_link(volume: &Volume, cluster: u32, to: u32, table: &mut [u8; BLOCK]) {
    let at = volume.link_at(cluster);
    let bytes = match volume.is_32 {
        true => (double(table, at) & !LINK | to & LINK).to_le_bytes(),
        false => to.to_le_bytes(),
    };
    put(table, at, bytes.get(..if volume.is_32 { 4 } else { 2 }).unwrap_or(&[]));
}

/// Copies bytes to a place in a block.
fn put(block: &mut [u8], at: usize, bytes: &[u8]) {
    for (place, byte) in block.iter_mut().skip(at).zip(bytes) {
        *place = *byte;
    }
}

/// Makes the count of free clusters unknown, because it will not be right any more.
fn mark(volume: &Volume, blocks: &mut Blocks) -> Result<(), Fault> {
    if volume.info == 0 {
        return Ok(());
    }
    let info = blocks.read(volume.info)?;
    if MARKS.iter().all(|(at, mark)| double(info, *at) == *mark) {
        blocks.change(volume.info, |info| put(info, COUNT, &[0xFF; 4]))?;
    }
    Ok(())
}

/// Returns the place of the entry of a file with this name and the first cluster of the file, or else a free place and 0.
/// `None`: there is no free one. A folder of this name is [`Fault::Failed`].
fn place(
    volume: &Volume,
    name: &[u8; NAME],
    blocks: &mut Blocks,
) -> Result<Option<(Place, u32)>, Fault> {
    let mut at = volume.root()?;
    let mut free = None;
    while let Some((place, slot)) = volume.slot(&mut at, blocks)? {
        match slot {
            Slot::End => return Ok(free.or(Some((place, 0)))),
            Slot::Deleted => free = free.or(Some((place, 0))),
            Slot::Other => {}
            Slot::Taken(found) => {
                // Other names may be shown alike.
                let entry = blocks.read(place.0)?.get(usize::from(place.1)..);
                if entry.is_some_and(|entry| entry.starts_with(name)) {
                    let replaces = Some((place, found.first));
                    return if found.is_folder() { Err(Fault::Failed) } else { Ok(replaces) };
                }
            }
        }
    }
    Ok(free)
}

/// Returns a name as an entry has it: eight letters and three, padded with blanks. `None`: it is too long, or has a
/// character that no short name has.
fn short_name(name: &[u8]) -> Option<[u8; NAME]> {
    let point = name.iter().rposition(|letter| *letter == b'.').unwrap_or(name.len());
    let (stem, ending) = name.split_at_checked(point)?;
    let ending = ending.get(1..).unwrap_or(&[]);
    if !(1..=8).contains(&stem.len()) || ending.len() > 3 {
        return None;
    }
    let mut short = [b' '; NAME];
    let letters = (0..).zip(stem).chain((8..).zip(ending));
    for (at, letter) in letters {
        let is_allowed = letter.is_ascii_alphanumeric() || b"$%'-_@~`!(){}^#&".contains(letter);
        *short.get_mut(at).filter(|_| is_allowed)? = letter.to_ascii_uppercase();
    }
    Some(short)
}
