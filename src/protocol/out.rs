//! Where dialects write to.

use crate::progmem::Plain;

/// The destination of output. One step of a [`Request`](super::Request) or a report writes at most
/// [`CHUNK`](super::CHUNK) bytes.
pub trait Out {
    /// Writes one byte.
    fn put(&mut self, byte: u8);

    /// Writes bytes out of program memory.
    fn put_plain(&mut self, bytes: Plain) {
        self.put_all(bytes.bytes());
    }

    /// Writes several bytes.
    fn put_all(&mut self, bytes: impl Iterator<Item = u8>) {
        bytes.for_each(|byte| self.put(byte));
    }

    /// Starts a checksum over the bytes that are written from here on.
    fn begin_sum(&mut self);

    /// Ends the checksum and returns the [`Checksum`](super::Checksum) of the bytes written since
    /// [`Self::begin_sum`].
    fn take_sum(&mut self) -> u16;
}
