//! The chips that images are built for.

/// A chip.
pub struct Chip {
    /// Its name: of the compiler's target CPU, of `-mmcu`, and of the feature of `avr-embassy`.
    pub name: &'static str,
    /// What avrdude calls it.
    pub part: &'static str,
    /// Bytes of a return address: three where there are more than 128 KiB of flash.
    pub return_address: usize,
}

/// The chip of every board.
pub const ATMEGA2560: Chip = Chip { name: "atmega2560", part: "m2560", return_address: 3 };
/// A chip that the runtime is tried on beside it.
pub const ATMEGA1284P: Chip = Chip { name: "atmega1284p", part: "m1284p", return_address: 2 };
