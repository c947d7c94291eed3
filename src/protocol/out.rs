//! Where dialects write to.

use crate::progmem::Plain;

/// Where output goes. One step of a [`Request`](super::Request) or a report puts at most
/// [`CHUNK`](super::CHUNK) bytes.
pub trait Out {
    /// Takes one byte.
    fn put(&mut self, byte: u8);

    /// Takes bytes out of program memory.
    fn put_plain(&mut self, bytes: Plain) {
        self.put_all(bytes.bytes());
    }

    /// Takes several.
    fn put_all(&mut self, bytes: impl Iterator<Item = u8>) {
        bytes.for_each(|byte| self.put(byte));
    }

    /// Begins to sum up what is put from here on.
    fn begin_sum(&mut self);

    /// The [`Checksum`](super::Checksum) of what has been put since, and the end of it.
    fn take_sum(&mut self) -> u16;
}
