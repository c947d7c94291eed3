//! A fault: a byte of memory with bits that do not change.

/// Some bits of a byte, and what they stay.
#[derive(Clone, Copy, Debug)]
pub struct Stuck {
    /// Where the byte is.
    pub address: u16,
    /// The bits that do not change.
    pub mask: u8,
    /// Their value.
    pub value: u8,
}

impl Stuck {
    /// Returns what the byte holds after `written` was stored in it.
    pub fn of(self, written: u8) -> u8 {
        written & !self.mask | self.value & self.mask
    }
}
