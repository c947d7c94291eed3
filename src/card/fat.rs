//! FAT16 and FAT32 of a card: the first partition, its root directory, and the blocks of a file.
//!
//! Nothing on a card is trusted. [`Volume::open`] checks the sizes of the volume, so that no number below overflows and
//! no cluster lies behind its end. A cluster of a chain is checked before it is used. Each function reads a bounded
//! number of blocks, also where a chain has no end: a directory ends after [`DIRECTORY_MOST`] blocks, and a file after
//! its length. What does not fit is [`Fault::Failed`].

use super::device::{Blocks, Fault};
use super::{Entry, NAME_MAX};
use crate::hal::time::millis;

/// Bytes of a block, as a power of two.
pub const BLOCK_SHIFT: u8 = 9;
/// Bytes of an entry of a directory, and the number of entries in a block.
pub const ENTRY: usize = 32;
const ENTRIES: u8 = 16;
/// The most blocks of a directory that are read: 2,048 entries, in 0.2 s.
const DIRECTORY_MOST: u8 = 128;
/// The longest time for which a directory is read, ms. The watchdog acts after half a second.
const DIRECTORY_MS: u32 = 250;
/// The first cluster.
pub const FIRST: u32 = 2;
/// The number of clusters from which on a volume is FAT16, and from which on it is FAT32.
const FAT16: u32 = 4_085;
const FAT32: u32 = 65_525;
/// The most clusters of a volume, and the most blocks of one table for them.
const CLUSTERS_MOST: u32 = 0x0FFF_FFF0;
const TABLE_MOST: u32 = 1 << 21;
/// The bits of an entry of the table in FAT32, and the least entry that ends a chain. In FAT16 the lower half of it.
pub const LINK: u32 = 0x0FFF_FFFF;
const END: u32 = 0x0FFF_FFF8;

/// Bits of the attributes of an entry. A part of a long name has the bit of a label, too.
pub const HIDDEN: u8 = 0x02;
const LABEL: u8 = 0x08;
const FOLDER: u8 = 0x10;
/// The first byte of an entry that has been deleted.
const DELETED: u8 = 0xE5;

/// A volume whose sizes have been checked.
#[derive(Clone, Copy)]
pub struct Volume {
    /// The first block of the table of clusters.
    table: u32,
    /// Blocks from there to the copy of the table; 0 without a copy.
    #[cfg(feature = "card-write")]
    pub copy: u32,
    /// The block with the count of free clusters in FAT32; 0 without one.
    #[cfg(feature = "card-write")]
    pub info: u32,
    /// The first block of the first cluster.
    data: u32,
    /// The first block of the root directory in FAT16, its first cluster in FAT32.
    root: u32,
    /// Blocks of the root directory in FAT16.
    root_blocks: u16,
    /// The number behind the last cluster.
    pub end: u32,
    /// Blocks of a cluster, as a power of two.
    shift: u8,
    pub is_32: bool,
}

/// A place in the root directory.
pub struct Cursor {
    /// The cluster in FAT32, and the block.
    cluster: u32,
    block: u32,
    /// Blocks from here on until the next cluster, or the end of the directory.
    left: u16,
    /// The next entry of the block.
    entry: u8,
    /// Blocks that have been read, and the time of the first one, ms.
    read: u8,
    since: u32,
}

/// A file as the root directory describes it.
#[derive(Clone, Copy)]
pub struct Found {
    pub entry: Entry,
    pub attributes: u8,
    /// Its first cluster, which has not been checked.
    pub first: u32,
    /// Where its entry is.
    pub place: Place,
}

/// Where an entry of a directory is: the block, and the byte in it.
pub type Place = (u32, u16);

/// What is at a place of a directory.
pub enum Slot {
    /// Nothing, here and behind it.
    End,
    /// A file that has been deleted.
    Deleted,
    /// A label, or a part of a long name.
    Other,
    /// A file or a folder.
    Taken(Found),
}

/// A file that is read.
#[derive(Clone, Copy)]
pub struct File {
    pub found: Found,
    /// The next byte.
    pub at: u32,
    /// A cluster of the file, and how many come before it.
    cluster: u32,
    before: u32,
}

#[small]
impl Volume {
    /// Finds the volume of the first partition.
    #[inline(never)]
    pub fn open(blocks: &mut Blocks) -> Result<Self, Fault> {
        let table = blocks.read(0)?;
        let partition = table.get(446..462).filter(|_| is_signed(table)).ok_or(Fault::Failed)?;
        let (status, kind) = (byte(partition, 0), byte(partition, 4));
        if status & 0x7F != 0 || !matches!(kind, 0x04 | 0x06 | 0x0B | 0x0C | 0x0E) {
            return Err(Fault::Failed);
        }
        let first = double(partition, 8);
        Self::checked(first, blocks.read(first)?).ok_or(Fault::Failed)
    }

    /// Reads the boot sector of a volume that begins with block `first`.
    #[inline(never)]
    fn checked(first: u32, boot: &[u8]) -> Option<Self> {
        let cluster_blocks = byte(boot, 13);
        if !is_signed(boot)
            || word(boot, 11) != 1 << BLOCK_SHIFT
            || !cluster_blocks.is_power_of_two()
        {
            return None;
        }
        let either = |short, long| {
            Some(word(boot, short))
                .filter(|size| *size != 0)
                .map_or_else(|| double(boot, long), u32::from)
        };
        let (in_all, table_blocks) = (either(19, 32), either(22, 36));
        let (reserved, tables) = (word(boot, 14), byte(boot, 16));
        if reserved == 0 || !matches!(tables, 1 | 2) || !(1..=TABLE_MOST).contains(&table_blocks) {
            return None;
        }
        let shift = cluster_blocks.trailing_zeros() as u8;
        let root_blocks = word(boot, 17).div_ceil(ENTRIES.into());
        let table = first.checked_add(reserved.into())?;
        // No block has a number beyond 32 bits.
        first.checked_add(in_all)?;
        let behind = table.checked_add(table_blocks * u32::from(tables))?;
        let data = behind.checked_add(root_blocks.into())?;
        let clusters = in_all.checked_sub(data - first)? >> shift;
        if !(FAT16..=CLUSTERS_MOST).contains(&clusters) {
            return None;
        }
        let is_32 = clusters >= FAT32;
        // Another version of FAT32 has another form.
        if is_32 && word(boot, 42) != 0 {
            return None;
        }
        let entries = table_blocks << if is_32 { 7 } else { 8 };
        Some(Self {
            table,
            #[cfg(feature = "card-write")]
            copy: if tables == 2 { table_blocks } else { 0 },
            #[cfg(feature = "card-write")]
            info: match word(boot, 48) {
                at if is_32 && (1..reserved).contains(&at) => first + u32::from(at),
                _ => 0,
            },
            data,
            root: if is_32 { double(boot, 44) } else { behind },
            root_blocks,
            end: entries.min(clusters + FIRST),
            shift,
            is_32,
        })
    }

    /// Returns the first block of a cluster.
    #[inline(never)]
    pub fn block_of(&self, cluster: u32) -> Result<u32, Fault> {
        if !(FIRST..self.end).contains(&cluster) {
            return Err(Fault::Failed);
        }
        Ok(self.data + ((cluster - FIRST) << self.shift))
    }

    /// Returns the number of a block of a file within its cluster.
    pub fn in_cluster(&self, block: u32) -> u32 {
        block & ((1 << self.shift) - 1)
    }

    /// Returns how many links a block of the table has, as a power of two.
    pub fn links(&self) -> u8 {
        if self.is_32 { 7 } else { 8 }
    }

    /// Returns the block of the table that has the link of a cluster.
    pub fn table_block(&self, cluster: u32) -> u32 {
        self.table + (cluster >> self.links())
    }

    /// Returns where the link of a cluster is in its block of the table.
    pub fn link_at(&self, cluster: u32) -> usize {
        let at = usize::from((cluster & ((1 << self.links()) - 1)) as u16);
        if self.is_32 { at * 4 } else { at * 2 }
    }

    /// Returns the link of a cluster, from its block of the table. 0: the cluster is free.
    pub fn link(&self, cluster: u32, table: &[u8]) -> u32 {
        let at = self.link_at(cluster);
        if self.is_32 { double(table, at) & LINK } else { word(table, at).into() }
    }

    /// Returns the cluster behind a cluster; `None` if it is the last one of its chain.
    #[inline(never)]
    fn next(&self, cluster: u32, blocks: &mut Blocks) -> Result<Option<u32>, Fault> {
        self.block_of(cluster)?;
        let link = self.link(cluster, blocks.read(self.table_block(cluster))?);
        let end = if self.is_32 { END } else { END & 0xFFFF };
        if link >= end {
            return Ok(None);
        }
        self.block_of(link).map(|_| Some(link))
    }

    /// Returns the beginning of the root directory.
    #[inline(never)]
    pub fn root(&self) -> Result<Cursor, Fault> {
        let mut cursor = Cursor {
            cluster: self.root,
            block: self.root,
            left: self.root_blocks,
            entry: 0,
            read: 0,
            since: millis(),
        };
        if self.is_32 {
            (cursor.block, cursor.left) = (self.block_of(self.root)?, 1 << self.shift);
        }
        Ok(cursor)
    }

    /// Returns the next file or folder of a directory; `None` behind the last one.
    #[inline(never)]
    pub fn entry(&self, at: &mut Cursor, blocks: &mut Blocks) -> Result<Option<Found>, Fault> {
        loop {
            match self.slot(at, blocks)? {
                Some((_, Slot::Taken(found))) => return Ok(Some(found)),
                Some((_, Slot::Deleted | Slot::Other)) => {}
                Some((_, Slot::End)) | None => return Ok(None),
            }
        }
    }

    /// Returns the next place of a directory, and what is there; `None` if the directory has no more places.
    #[inline(always)]
    pub fn slot(
        &self,
        at: &mut Cursor,
        blocks: &mut Blocks,
    ) -> Result<Option<(Place, Slot)>, Fault> {
        if at.entry >= ENTRIES && !self.advance(at, blocks)? || at.left == 0 {
            return Ok(None);
        }
        let begins = usize::from(at.entry) * ENTRY;
        let entry = blocks.read(at.block)?.get(begins..begins + ENTRY).unwrap_or(&[]);
        at.entry += 1;
        let place = (at.block, begins as u16);
        let slot = match byte(entry, 0) {
            0 => Slot::End,
            DELETED => Slot::Deleted,
            _ if byte(entry, 11) & LABEL != 0 => Slot::Other,
            _ => Slot::Taken(found(entry, self.is_32, place)),
        };
        Ok(Some((place, slot)))
    }

    /// Goes to the next block of a directory. Returns whether there is one.
    #[inline(never)]
    fn advance(&self, at: &mut Cursor, blocks: &mut Blocks) -> Result<bool, Fault> {
        (at.entry, at.read, at.left) = (0, at.read + 1, at.left - 1);
        if at.read >= DIRECTORY_MOST || millis().wrapping_sub(at.since) > DIRECTORY_MS {
            return Err(Fault::Failed);
        }
        at.block += 1;
        if at.left > 0 || !self.is_32 {
            return Ok(at.left > 0);
        }
        let Some(next) = self.next(at.cluster, blocks)? else { return Ok(false) };
        (at.cluster, at.block, at.left) = (next, self.block_of(next)?, 1 << self.shift);
        Ok(true)
    }

    /// Marks an entry as deleted. The clusters of its file stay taken.
    #[inline(never)]
    pub fn delete(found: &Found, blocks: &mut Blocks) -> Result<(), Fault> {
        let (block, at) = found.place;
        blocks.change(block, |bytes| {
            if let Some(first) = bytes.get_mut(usize::from(at)) {
                *first = DELETED;
            }
        })
    }
}

impl File {
    /// Begins to read a file.
    pub fn new(found: Found) -> Self {
        Self { found, at: 0, cluster: found.first, before: 0 }
    }

    /// Returns the block with the next byte of the file. Follows the chain of clusters over `most` of them at most;
    /// `None`: it is to be called again.
    #[inline(never)]
    #[small]
    pub fn block(
        &mut self,
        volume: &Volume,
        most: u8,
        blocks: &mut Blocks,
    ) -> Result<Option<u32>, Fault> {
        let block = self.at >> BLOCK_SHIFT;
        let before = block >> volume.shift;
        if before < self.before {
            (self.cluster, self.before) = (self.found.first, 0);
        }
        for _ in 0..most {
            if self.before == before {
                return Ok(Some(volume.block_of(self.cluster)? + volume.in_cluster(block)));
            }
            // A chain that is shorter than its file.
            self.cluster = volume.next(self.cluster, blocks)?.ok_or(Fault::Failed)?;
            self.before += 1;
        }
        Ok(None)
    }
}

impl Found {
    /// Whether it is a folder.
    pub fn is_folder(&self) -> bool {
        self.attributes & FOLDER != 0
    }
}

/// Reads an entry of a directory.
#[inline(never)]
#[small]
fn found(entry: &[u8], is_32: bool, place: Place) -> Found {
    let high = if is_32 { word(entry, 20) } else { 0 };
    Found {
        entry: Entry { name: shown_name(entry), size: double(entry, 28) },
        attributes: byte(entry, 11),
        first: u32::from(high) << 16 | u32::from(word(entry, 26)),
        place,
    }
}

/// Returns a short name with its point. Characters that could be taken for another part of an answer become `_`.
#[inline(never)]
#[small]
pub fn shown_name(entry: &[u8]) -> [u8; NAME_MAX] {
    let mut name = [0; NAME_MAX];
    let mut len = 0;
    for (at, letter) in entry.iter().take(11).enumerate() {
        if *letter == b' ' {
            continue;
        }
        if at >= 8 && !name.contains(&b'.') {
            if let Some(place) = name.get_mut(len) {
                *place = b'.';
            }
            len += 1;
        }
        if let Some(place) = name.get_mut(len) {
            *place = if letter.is_ascii_graphic() && *letter != b'.' { *letter } else { b'_' };
        }
        len += 1;
    }
    name
}

/// Whether a sector ends as the first one of a card or of a volume does.
fn is_signed(sector: &[u8]) -> bool {
    word(sector, 510) == 0xAA55
}

#[small]
fn byte(bytes: &[u8], at: usize) -> u8 {
    bytes.get(at).copied().unwrap_or(0)
}

/// Returns two bytes as a number.
#[inline(never)]
#[small]
fn word(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([byte(bytes, at), byte(bytes, at + 1)])
}

/// Returns four bytes as a number.
#[inline(never)]
#[small]
pub fn double(bytes: &[u8], at: usize) -> u32 {
    u32::from(word(bytes, at + 2)) << 16 | u32::from(word(bytes, at))
}
