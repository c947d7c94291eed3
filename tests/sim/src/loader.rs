//! A boot loader, which Intel HEX describes.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use crate::flash::BOOT;

/// Where Debian's package `arduino-core-avr` has the loader of the Arduino Mega.
pub const DEBIAN: &str =
    "/usr/share/arduino/hardware/arduino/avr/bootloaders/stk500v2/stk500boot_v2_mega2560.hex";

/// A boot loader, which lies in the boot section.
pub struct Loader {
    /// Its parts, each with its address.
    parts: Vec<(u32, Vec<u8>)>,
}

impl Loader {
    /// Reads an Intel HEX file. Refuses one that does not begin where the chip starts after a reset, or that lies
    /// partly outside the boot section.
    pub fn read(path: &Path) -> Result<Self> {
        let name = path.display();
        let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {name}"))?;
        let parts = parts(&text).with_context(|| format!("{name} is no Intel HEX"))?;
        let end = |(at, bytes): &(u32, Vec<u8>)| *at as usize + bytes.len();
        ensure!(parts.iter().any(|(at, _)| *at == BOOT), "nothing in {name} begins at {BOOT:#x}");
        ensure!(
            parts.iter().all(|part| part.0 >= BOOT && end(part) <= 0x4_0000),
            "{name} is no boot loader"
        );
        Ok(Loader { parts })
    }

    /// Reads the loader that Debian has for the Arduino Mega.
    pub fn of_debian() -> Result<Self> {
        let path = PathBuf::from(DEBIAN);
        Self::read(&path).context("`cargo xtask setup` installs the package arduino-core-avr")
    }

    /// The parts, each with its address.
    pub(crate) fn parts(&self) -> &[(u32, Vec<u8>)] {
        &self.parts
    }
}

/// Returns the bytes that Intel HEX describes, each record with its address.
pub fn parts(hex: &str) -> Result<Vec<(u32, Vec<u8>)>> {
    let (mut parts, mut base) = (Vec::new(), 0);
    for line in hex.lines().map(str::trim).filter(|line| !line.is_empty()) {
        let record = record(line).with_context(|| format!("the record {line}"))?;
        let [_, high, low, kind, data @ .., _] = &record[..] else { bail!("a short record") };
        let address = u32::from(u16::from_be_bytes([*high, *low]));
        match (kind, data) {
            (0, _) => parts.push((base + address, data.to_vec())),
            (1, _) => return Ok(parts),
            (2, [high, low]) => base = u32::from(u16::from_be_bytes([*high, *low])) << 4,
            (4, [high, low]) => base = u32::from(u16::from_be_bytes([*high, *low])) << 16,
            // Where a program starts, which is of no use here.
            (3 | 5, _) => {}
            _ => bail!("a record of kind {kind}"),
        }
    }
    bail!("no end")
}

/// Returns the bytes of a record. Checks its length and its sum.
fn record(line: &str) -> Result<Vec<u8>> {
    let digits = line.strip_prefix(':').context("no colon")?;
    let pairs = digits
        .as_bytes()
        .chunks(2)
        .map(|pair| Ok(u8::from_str_radix(std::str::from_utf8(pair)?, 16)?));
    let bytes: Vec<u8> = pairs.collect::<Result<_>>()?;
    ensure!(bytes.len() >= 5 && bytes.len() == usize::from(bytes[0]) + 5, "a wrong length");
    ensure!(bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte)) == 0, "a wrong sum");
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_go_on_behind_64_kib() {
        let hex = ":0400000001020304F2\n:020000040003F7\n:02E00000AABBB9\n:00000001FF\n";
        let found = parts(hex).unwrap();
        assert_eq!(found, [(0, vec![1, 2, 3, 4]), (0x3_E000, vec![0xAA, 0xBB])]);
    }

    #[test]
    fn damaged_records_are_refused() {
        for hex in [
            "",
            ":00000001FE\n",
            ":0400000001020304F3\n:00000001FF\n",
            ":04000000010203F2\n",
            "rubbish",
        ] {
            assert!(parts(hex).is_err(), "{hex}");
        }
    }
}
