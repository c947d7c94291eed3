//! The chip's registers as bytes.

/// A register.
#[derive(Clone, Copy)]
pub struct Register(u16);

impl Register {
    /// The register at an address of the data space.
    pub const fn at(address: u16) -> Self {
        assert!(address >= 0x20 && address < 0x200);
        Self(address)
    }

    /// Its address.
    pub const fn address(self) -> u16 {
        self.0
    }

    /// Reads it. Cost: 1 or 2 cycles.
    #[inline(always)]
    pub fn get(self) -> u8 {
        // SAFETY: `at` allows registers only, and no interrupt comes between: they are off for good.
        unsafe { (usize::from(self.0) as *const u8).read_volatile() }
    }

    /// Writes it. Cost: 2 or 3 cycles.
    #[inline(always)]
    pub fn put(self, value: u8) {
        // SAFETY: as in `get`; no register that is written here changes memory.
        unsafe { (usize::from(self.0) as *mut u8).write_volatile(value) }
    }
}
