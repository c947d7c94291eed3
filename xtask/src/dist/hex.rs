//! Converts the part of an image that lies in flash to Intel HEX, which avrdude takes.

use anyhow::{Context, Result, ensure};
use object::Endianness;
use object::read::elf::{ElfFile32, ProgramHeader};

/// From this address up, addresses mean RAM, EEPROM and fuses.
const FLASH_END: u64 = 0x4_0000;
/// Bytes in a record.
const RECORD: usize = 16;

/// Returns the parts of an image that are written to flash, each with its address.
pub fn parts(elf: &[u8]) -> Result<Vec<(u64, Vec<u8>)>> {
    let file = ElfFile32::<Endianness>::parse(elf).context("not an ELF of 32 bits")?;
    let endian = file.endian();
    let mut parts = Vec::new();
    for header in file.elf_program_headers() {
        let data = header.data(endian, elf).map_err(|()| anyhow::anyhow!("a part is cut off"))?;
        // The load address: initial values of RAM are stored in flash, behind the code.
        let address = u64::from(header.p_paddr(endian));
        if header.p_type(endian) == object::elf::PT_LOAD && !data.is_empty() && address < FLASH_END
        {
            parts.push((address, data.to_vec()));
        }
    }
    ensure!(!parts.is_empty(), "nothing in it goes to flash");
    Ok(parts)
}

/// Returns a record: its length, address, kind, bytes and checksum.
fn record(address: u16, kind: u8, bytes: &[u8]) -> String {
    let [high, low] = address.to_be_bytes();
    let all = [&[bytes.len() as u8, high, low, kind], bytes].concat();
    let sum = all.iter().fold(0u8, |sum, byte| sum.wrapping_sub(*byte));
    let digits: String = all.iter().chain([&sum]).map(|byte| format!("{byte:02X}")).collect();
    format!(":{digits}\n")
}

/// Converts an image to Intel HEX.
pub fn of_elf(elf: &[u8]) -> Result<String> {
    Ok(of_parts(&parts(elf)?))
}

/// Converts parts of the flash, each with its address, to Intel HEX.
pub fn of_parts(parts: &[(u64, Vec<u8>)]) -> String {
    let (mut text, mut upper) = (String::new(), 0);
    for (start, bytes) in parts {
        let mut at = 0;
        while at < bytes.len() {
            let address = start + at as u64;
            if address >> 16 != upper {
                upper = address >> 16;
                // This record has the upper 16 bits of the addresses that follow.
                text += &record(0, 4, &(upper as u16).to_be_bytes());
            }
            // No record crosses a boundary of 64 KiB.
            let room = (0x1_0000 - (address & 0xFFFF)) as usize;
            let end = bytes.len().min(at + RECORD.min(room));
            text += &record(address as u16, 0, &bytes[at..end]);
            at = end;
        }
    }
    text + &record(0, 1, &[])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_as_the_format_has_them() {
        let bytes = vec![0x02, 0x33, 0x7A];
        let text = of_parts(&[(0x0030, bytes)]);
        assert_eq!(text, ":0300300002337A1E\n:00000001FF\n");
    }

    #[test]
    fn addresses_beyond_64_kib_are_told() {
        let text = of_parts(&[(0xFFFE, vec![1, 2, 3, 4])]);
        let want = [":02FFFE000102FE", ":020000040001F9", ":020000000304F7", ":00000001FF"];
        assert_eq!(text.lines().collect::<Vec<_>>(), want);
    }

    #[test]
    fn long_parts_are_split() {
        let text = of_parts(&[(0, vec![0; 40])]);
        let lengths: Vec<_> = text.lines().map(|line| &line[1..3]).collect();
        assert_eq!(lengths, ["10", "10", "08", "00"]);
    }

    #[test]
    fn rubbish_is_no_image() {
        assert!(of_elf(b"rubbish").is_err());
    }
}
