//! Images of SD cards, formatted, filled and read by another program (the crate `fatfs`), and a check of their tables.

use std::io::{Cursor, Read, Seek, SeekFrom, Write};

use fatfs::{FatType, FileSystem, FormatVolumeOptions, FsOptions, format_volume};

/// Where the partition begins, blocks.
pub const FIRST: usize = 63;
/// Bytes of a block.
pub const BLOCK: usize = 512;

/// A part of a file that holds a volume.
struct Volume<'a>(Cursor<&'a mut [u8]>);

impl Read for Volume<'_> {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        self.0.read(to)
    }
}

impl Write for Volume<'_> {
    fn write(&mut self, from: &[u8]) -> std::io::Result<usize> {
        self.0.write(from)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Seek for Volume<'_> {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.0.seek(to)
    }
}

/// Returns a card with a partition, a folder and these files. Clusters are small, so that the chain of a file is long.
pub fn image(fat: FatType, files: &[(&str, String)]) -> Vec<u8> {
    let (kind, blocks, cluster) = match fat {
        FatType::Fat32 => (0x0C, 80_000, 512),
        _ => (0x06, 20_000, 1_024),
    };
    let mut image = vec![0; (FIRST + blocks) * BLOCK];
    image[446 + 4] = kind;
    image[446 + 8..446 + 12].copy_from_slice(&(FIRST as u32).to_le_bytes());
    image[446 + 12..446 + 16].copy_from_slice(&(blocks as u32).to_le_bytes());
    image[510..512].copy_from_slice(&[0x55, 0xAA]);
    let options = FormatVolumeOptions::new().fat_type(fat).bytes_per_cluster(cluster);
    let mut volume = Volume(Cursor::new(&mut image[FIRST * BLOCK..]));
    format_volume(&mut volume, options).unwrap();
    let system = FileSystem::new(volume, FsOptions::new()).unwrap();
    system.root_dir().create_dir("folder").unwrap();
    for (name, text) in files {
        system.root_dir().create_file(name).unwrap().write_all(text.as_bytes()).unwrap();
    }
    system.unmount().unwrap();
    image
}

/// Calls `work` with the volume of a card, as another program sees it.
fn on_volume<T>(image: &[u8], work: impl FnOnce(&FileSystem<Volume<'_>>) -> T) -> T {
    let mut image = image.to_vec();
    let volume = Volume(Cursor::new(&mut image[FIRST * BLOCK..]));
    let system = FileSystem::new(volume, FsOptions::new()).unwrap();
    work(&system)
}

/// Returns the names on a card.
pub fn names(image: &[u8]) -> Vec<String> {
    on_volume(image, |system| {
        system.root_dir().iter().map(|entry| entry.unwrap().file_name()).collect()
    })
}

/// Returns the text of a file on a card; `None` if there is no such file.
pub fn text(image: &[u8], name: &str) -> Option<String> {
    on_volume(image, |system| {
        let mut text = String::new();
        system.root_dir().open_file(name).ok()?.read_to_string(&mut text).unwrap();
        Some(text)
    })
}

/// Returns how many clusters are taken and belong to no file. Checks that both copies of the table are the same.
pub fn lost(image: &[u8]) -> u32 {
    let boot = &image[FIRST * BLOCK..];
    let word = |at| usize::from(u16::from_le_bytes([boot[at], boot[at + 1]]));
    let blocks = match word(22) {
        0 => u32::from_le_bytes(boot[36..40].try_into().unwrap()) as usize,
        blocks => blocks,
    };
    let table = &boot[word(14) * BLOCK..];
    let (first, second) = table[..2 * blocks * BLOCK].split_at(blocks * BLOCK);
    assert!(first == second, "the copies of the table differ");
    on_volume(image, |system| {
        let stats = system.stats().unwrap();
        let size = u64::from(stats.cluster_size());
        // The folder has one, and so has the root directory of FAT32.
        let folders = 1 + u32::from(system.fat_type() == FatType::Fat32);
        let files = system.root_dir().iter().map(|entry| entry.unwrap());
        let taken: u64 = files.map(|entry| entry.len().div_ceil(size)).sum();
        stats.total_clusters() - stats.free_clusters() - folders - taken as u32
    })
}
