//! One record of the log: 11 bytes.
//!
//! | bytes | |
//! |---|---|
//! | 0 | [`VALID`], written last; any other value: no record |
//! | 1, 2 | key: the checksum of the item's name |
//! | 3, 4 | number of the record, modulo 65,536 |
//! | 5 to 8 | value |
//! | 9, 10 | checksum of bytes 1 to 8 |
//!
//! All values are little-endian. Checksums are CRC-16/XMODEM. While a new record overwrites an old one, byte 0 is
//! [`BEGUN`]. If power fails while a byte is written, that byte may have any value. Byte 0 or the checksum reveals
//! this.

use crc::{CRC_16_XMODEM, Crc, NoTable};

/// Bytes of a record.
pub const SIZE: u16 = 11;
/// Byte 0 of a valid record. Another layout of records would get another value.
pub const VALID: u8 = 0x4B;
/// Byte 0 while the other bytes are written.
pub const BEGUN: u8 = 0xFF;

/// Computed without a table, which would be in RAM.
const CRC: Crc<u16, NoTable> = Crc::<u16, NoTable>::new(&CRC_16_XMODEM);

/// The key of the records that are no item's: see [`Change`](super::kept::Change).
pub const CHANGE: u16 = CRC.checksum(b"change of all settings");

/// The value of one item.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Record {
    /// The key of the item.
    pub key: u16,
    /// The sequence number of the record in the log, modulo 65,536.
    pub number: u16,
    /// The value.
    pub value: i32,
}

/// Returns the key of an item, from its name.
#[small]
pub fn key(name: &[u8]) -> u16 {
    CRC.checksum(name)
}

#[small]
impl Record {
    /// Returns the bytes of the record. Byte 0 makes it valid and has to be written last.
    pub fn bytes(&self) -> [u8; SIZE as usize] {
        let mut bytes = [VALID; SIZE as usize];
        bytes[1..3].copy_from_slice(&self.key.to_le_bytes());
        bytes[3..5].copy_from_slice(&self.number.to_le_bytes());
        bytes[5..9].copy_from_slice(&self.value.to_le_bytes());
        let sum = CRC.checksum(&bytes[1..9]);
        bytes[9..11].copy_from_slice(&sum.to_le_bytes());
        bytes
    }

    /// Returns the record in these bytes; `None` if the mark or the checksum is wrong.
    pub fn of(bytes: &[u8; SIZE as usize]) -> Option<Self> {
        let [mark, key0, key1, number0, number1, value @ .., sum0, sum1] = *bytes;
        let sum = u16::from_le_bytes([sum0, sum1]);
        if mark != VALID || sum != CRC.checksum(&bytes[1..9]) {
            return None;
        }
        Some(Self {
            key: u16::from_le_bytes([key0, key1]),
            number: u16::from_le_bytes([number0, number1]),
            value: i32::from_le_bytes(value),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_its_bytes() {
        let record = Record { key: 0x1234, number: 65_535, value: -7 };
        let bytes = record.bytes();
        assert_eq!(Record::of(&bytes), Some(record));
        for i in 0..bytes.len() {
            let mut damaged = bytes;
            damaged[i] ^= 0x10;
            assert_eq!(Record::of(&damaged), None, "{i}");
        }
        assert_eq!(Record::of(&[0xFF; 11]), None);
        assert_eq!(Record::of(&[0; 11]), None);
    }
}
