//! The chips that images are built for.

/// A chip.
pub struct Chip {
    /// Its name, for the compiler's target CPU, for `-mmcu`, and for the feature of `avr-embassy`.
    pub name: &'static str,
    /// Its name for avrdude.
    pub part: &'static str,
    /// Bytes of a return address: three on chips with more than 128 KiB of flash.
    pub return_address: usize,
}

/// The chip of every board, except those with an RP2040.
pub const ATMEGA2560: Chip = Chip { name: "atmega2560", part: "m2560", return_address: 3 };
/// A second chip that the runtime is tested on.
pub const ATMEGA1284P: Chip = Chip { name: "atmega1284p", part: "m1284p", return_address: 2 };
