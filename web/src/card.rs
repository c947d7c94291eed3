//! The SD card of the simulated machine: formatted, and empty at each start.

use kerf::hal::imp::card::Blocks;

/// The first block of the partition, its blocks, and those of each table of clusters; a cluster has one block.
const FIRST: u32 = 63;
const BLOCKS: u16 = 20_000;
const TABLE: u16 = 79;
/// Entries of the root directory.
const ENTRIES: u16 = 512;
/// The kind of the partition: FAT16.
const FAT16: u8 = 0x06;

/// Returns the blocks of an empty card of 10 MB.
pub fn empty() -> Blocks {
    let mut blocks = Blocks::new();
    let mut put = |block: u32, at: usize, bytes: &[u8]| {
        let contents = blocks.entry(block).or_insert([0; 512]);
        contents[at..at + bytes.len()].copy_from_slice(bytes);
    };
    put(0, 446 + 4, &[FAT16]);
    put(0, 446 + 8, &FIRST.to_le_bytes());
    put(0, 446 + 12, &u32::from(BLOCKS).to_le_bytes());
    put(0, 510, &[0x55, 0xAA]);
    // Bytes of a block, blocks of a cluster, blocks before the tables, tables.
    put(FIRST, 11, &[0, 2, 1, 1, 0, 2]);
    put(FIRST, 17, &ENTRIES.to_le_bytes());
    put(FIRST, 19, &BLOCKS.to_le_bytes());
    put(FIRST, 21, &[0xF8]);
    put(FIRST, 22, &TABLE.to_le_bytes());
    put(FIRST, 510, &[0x55, 0xAA]);
    // The first two entries of a table belong to no cluster.
    for table in [FIRST + 1, FIRST + 1 + u32::from(TABLE)] {
        put(table, 0, &[0xF8, 0xFF, 0xFF, 0xFF]);
    }
    blocks
}
