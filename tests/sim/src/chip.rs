//! The chips that can be simulated, as data. All differences between them are here (data sheets: register summary,
//! interrupt vectors).
//!
//! simavr supplies the instructions, the ports and the watchdog of each chip. To add a chip, add a [`Chip`].

use std::ffi::CStr;

use crate::pins::{self, PinLayout};
use crate::timer::{self, Layout};

/// Most vectors that a chip may have: each vector is a bit of a `u64`.
pub(crate) const MAX_VECTORS: usize = 64;

/// A chip.
pub struct Chip {
    /// simavr's name for it.
    pub(crate) name: &'static CStr,
    /// Cycles from the acceptance of an interrupt to the first instruction at its vector: two, plus one for each byte
    /// of the return address.
    pub(crate) entry_cycles: u64,
    /// The first address of the data space behind the registers.
    pub(crate) ram_start: u16,
    /// Names of its vectors by number, reset first, as in the data sheet.
    pub(crate) vectors: &'static [&'static str],
    /// Its timers by number.
    pub(crate) timers: &'static [Layout],
    /// Its USARTs by number: the first register, UCSRnA, and the first vector, RX; UDRE and TX follow.
    pub(crate) usarts: &'static [(u16, u8)],
    /// The vector of EE_READY. All chips here have 4 KB of EEPROM, with its registers at the same addresses.
    pub(crate) eeprom_ready: u8,
    /// The pin interrupts.
    pub(crate) pins: PinLayout,
}

impl Chip {
    /// The name of a vector.
    pub fn vector_name(&self, vector: u8) -> &'static str {
        self.vectors.get(usize::from(vector)).copied().unwrap_or("?")
    }

    /// Returns the number of the vector with this name.
    ///
    /// # Panics
    /// If the chip has no vector of this name.
    pub fn vector(&self, name: &str) -> u8 {
        let found = self.vectors.iter().position(|known| *known == name);
        found.unwrap_or_else(|| panic!("{:?} has no vector {name}", self.name)) as u8
    }
}

/// The ATmega2560.
pub static ATMEGA2560: Chip = Chip {
    name: c"atmega2560",
    entry_cycles: 5,
    ram_start: 0x200,
    #[rustfmt::skip]
    vectors: &[
        "RESET", "INT0", "INT1", "INT2", "INT3", "INT4", "INT5", "INT6", "INT7", "PCINT0", "PCINT1",
        "PCINT2", "WDT", "TIMER2_COMPA", "TIMER2_COMPB", "TIMER2_OVF", "TIMER1_CAPT", "TIMER1_COMPA",
        "TIMER1_COMPB", "TIMER1_COMPC", "TIMER1_OVF", "TIMER0_COMPA", "TIMER0_COMPB", "TIMER0_OVF",
        "SPI_STC", "USART0_RX", "USART0_UDRE", "USART0_TX", "ANALOG_COMP", "ADC", "EE_READY",
        "TIMER3_CAPT", "TIMER3_COMPA", "TIMER3_COMPB", "TIMER3_COMPC", "TIMER3_OVF", "USART1_RX",
        "USART1_UDRE", "USART1_TX", "TWI", "SPM_READY", "TIMER4_CAPT", "TIMER4_COMPA", "TIMER4_COMPB",
        "TIMER4_COMPC", "TIMER4_OVF", "TIMER5_CAPT", "TIMER5_COMPA", "TIMER5_COMPB", "TIMER5_COMPC",
        "TIMER5_OVF", "USART2_RX", "USART2_UDRE", "USART2_TX", "USART3_RX", "USART3_UDRE", "USART3_TX",
    ],
    timers: &timer::ATMEGA2560,
    usarts: &[(0xC0, 25), (0xC8, 36), (0xD0, 51), (0x130, 54)],
    eeprom_ready: 30,
    pins: pins::ATMEGA2560,
};

/// The ATmega1284P.
pub static ATMEGA1284P: Chip = Chip {
    name: c"atmega1284p",
    entry_cycles: 4,
    ram_start: 0x100,
    #[rustfmt::skip]
    vectors: &[
        "RESET", "INT0", "INT1", "INT2", "PCINT0", "PCINT1", "PCINT2", "PCINT3", "WDT", "TIMER2_COMPA",
        "TIMER2_COMPB", "TIMER2_OVF", "TIMER1_CAPT", "TIMER1_COMPA", "TIMER1_COMPB", "TIMER1_OVF",
        "TIMER0_COMPA", "TIMER0_COMPB", "TIMER0_OVF", "SPI_STC", "USART0_RX", "USART0_UDRE", "USART0_TX",
        "ANALOG_COMP", "ADC", "EE_READY", "TWI", "SPM_READY", "USART1_RX", "USART1_UDRE", "USART1_TX",
        "TIMER3_CAPT", "TIMER3_COMPA", "TIMER3_COMPB", "TIMER3_OVF",
    ],
    timers: &timer::ATMEGA1284P,
    usarts: &[(0xC0, 20), (0xC8, 28)],
    eeprom_ready: 25,
    pins: pins::ATMEGA1284P,
};

#[cfg(test)]
mod tests {
    use super::*;

    /// The vector numbers in a chip's description point to the vectors with the expected names.
    #[test]
    fn vectors_have_the_names_of_their_parts() {
        for chip in [&ATMEGA2560, &ATMEGA1284P] {
            assert!(chip.vectors.len() < MAX_VECTORS);
            for (n, timer) in chip.timers.iter().enumerate() {
                let names = ["OVF", "COMPA", "COMPB", "COMPC", "", "CAPT"];
                for (vector, name) in timer.vectors.into_iter().zip(names).filter(|(v, _)| *v != 0)
                {
                    assert_eq!(vector, chip.vector(&format!("TIMER{n}_{name}")));
                }
            }
            for (n, (_, first)) in chip.usarts.iter().enumerate() {
                let names =
                    ["RX", "UDRE", "TX"].map(|name| chip.vector(&format!("USART{n}_{name}")));
                assert_eq!(names, [*first, first + 1, first + 2]);
            }
            assert_eq!(chip.eeprom_ready, chip.vector("EE_READY"));
            assert_eq!(chip.pins.external_vector, chip.vector("INT0"));
            assert_eq!(chip.pins.change_vector, chip.vector("PCINT0"));
        }
    }
}
