//! UF2, the format of the RP2040's boot loader: blocks of 512 bytes, each with 256 bytes of flash and their address.
//!
//! <https://github.com/microsoft/uf2>

use std::collections::BTreeMap;

use anyhow::{Result, ensure};
use object::read::elf::{ElfFile32, FileHeader, ProgramHeader};

const MAGIC: [u32; 2] = [0x0A32_4655, 0x9E5D_5157];
const END: u32 = 0x0AB1_6F30;
/// The flag which says that a block names the family of the chip.
const HAS_FAMILY: u32 = 0x2000;
/// The family of the RP2040.
const FAMILY: u32 = 0xE48B_FF56;
/// Bytes of flash in a block: the chip programs this many at once.
const PAGE: usize = 256;
/// The addresses of the flash.
const FLASH: std::ops::Range<u32> = 0x1000_0000..0x1100_0000;

type Pages = BTreeMap<u32, [u8; PAGE]>;

/// Converts an image to UF2.
pub fn of_elf(elf: &[u8]) -> Result<Vec<u8>> {
    let file = ElfFile32::<object::Endianness>::parse(elf)?;
    let endian = file.endian();
    let mut pages = Pages::new();
    for header in file.elf_header().program_headers(endian, elf)? {
        let loads = header.p_type(endian) == object::elf::PT_LOAD;
        let at = header.p_paddr(endian);
        if loads && FLASH.contains(&at) {
            let bytes = header.data(endian, elf).unwrap_or_default();
            put(&mut pages, at, bytes);
        }
    }
    ensure!(!pages.is_empty(), "the image has nothing for the flash");
    Ok(blocks(&pages))
}

/// Puts bytes into pages; the bytes between them stay erased.
fn put(pages: &mut Pages, at: u32, bytes: &[u8]) {
    for (at, byte) in (at..).zip(bytes) {
        let within = at as usize % PAGE;
        pages.entry(at - within as u32).or_insert([0xFF; PAGE])[within] = *byte;
    }
}

fn blocks(pages: &Pages) -> Vec<u8> {
    let count = pages.len() as u32;
    let mut file = Vec::with_capacity(pages.len() * 512);
    for (number, (at, page)) in (0..).zip(pages) {
        let head = [MAGIC[0], MAGIC[1], HAS_FAMILY, *at, PAGE as u32, number, count, FAMILY];
        file.extend(head.iter().flat_map(|word| word.to_le_bytes()));
        file.extend(page);
        file.resize(file.len() + 476 - PAGE, 0);
        file.extend(END.to_le_bytes());
    }
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_blocks_of_512_bytes() {
        let mut pages = Pages::new();
        put(&mut pages, 0x1000_00FE, &[1, 2, 3]);
        let file = blocks(&pages);
        assert_eq!(file.len(), 1024);
        let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap());
        assert_eq!([word(0), word(4), word(508)], [MAGIC[0], MAGIC[1], END]);
        assert_eq!([word(12), word(16), word(20), word(24)], [0x1000_0000, 256, 0, 2]);
        assert_eq!([word(512 + 12), word(512 + 20)], [0x1000_0100, 1]);
        assert_eq!(file[32 + 253..32 + 256], [0xFF, 1, 2]);
        assert_eq!(file[512 + 32..512 + 34], [3, 0xFF]);
    }

    #[test]
    fn an_image_without_flash_is_refused() {
        assert!(of_elf(b"no elf").is_err());
    }
}
