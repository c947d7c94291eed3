//! Pins of the chips: their ports, addresses and interrupts.

/// An I/O port of the ATmega2560, by its letter; or the single port of the RP2040.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(missing_docs)]
pub enum Port {
    A,
    B,
    C,
    D,
    E,
    F,
    G,
    H,
    J,
    K,
    L,
    /// The pins GP0 to GP29 of the RP2040. The bit of a pin is its number.
    Gpio,
    /// The outputs of the shift register of steps: see [`Registers`](super::Registers).
    Steps,
    /// The outputs of the shift register of other outputs.
    Outputs,
}

impl Port {
    /// Whether boards with an RP2040 have it.
    pub const fn is_of_rp2040(self) -> bool {
        matches!(self, Port::Gpio | Port::Steps | Port::Outputs)
    }

    /// The letter the data sheet uses.
    pub const fn letter(self) -> char {
        match self {
            Port::A => 'A',
            Port::B => 'B',
            Port::C => 'C',
            Port::D => 'D',
            Port::E => 'E',
            Port::F => 'F',
            Port::G => 'G',
            Port::H => 'H',
            Port::J => 'J',
            Port::K => 'K',
            Port::L => 'L',
            Port::Gpio => 'P',
            Port::Steps => 'S',
            Port::Outputs => 'O',
        }
    }

    /// Data-space address of the PORT register. PIN is two below it and DDR one below (ATmega2560 data sheet,
    /// register summary). 0 for the ports of an RP2040's board, which have none.
    pub const fn address(self) -> usize {
        match self {
            Port::Gpio | Port::Steps | Port::Outputs => 0,
            Port::A => 0x22,
            Port::B => 0x25,
            Port::C => 0x28,
            Port::D => 0x2B,
            Port::E => 0x2E,
            Port::F => 0x31,
            Port::G => 0x34,
            Port::H => 0x102,
            Port::J => 0x105,
            Port::K => 0x108,
            Port::L => 0x10B,
        }
    }
}

/// A pin of the chip, or of a shift register.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Pin {
    /// The port of the pin.
    pub port: Port,
    /// The bit of the pin in its port, 0 to 7; on the RP2040 0 to 29. The number of the output of a shift register.
    pub bit: u8,
}

/// Shorthand for board files.
pub const fn pin(port: Port, bit: u8) -> Pin {
    Pin { port, bit }
}

/// Shorthand for a pin of the RP2040, by its number.
pub const fn gp(number: u8) -> Pin {
    pin(Port::Gpio, number)
}

/// The interrupt that an edge on a pin raises.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Interrupt {
    /// An external interrupt by its number: INT0 to INT7, each with a vector of its own.
    External(u8),
    /// A pin-change interrupt by its number: PCINT0 to PCINT23. Eight of them share a vector.
    PinChange(u8),
    /// The interrupt of a pin of the RP2040, by the number of the pin. Each pin has its own flags.
    Gpio(u8),
}

impl Pin {
    /// Whether both are the same pin.
    pub const fn is(self, other: Pin) -> bool {
        self.port as u8 == other.port as u8 && self.bit == other.bit
    }

    /// Returns the output of timer 2 on this pin: 0 for A, 1 for B (ATmega2560 data sheet, pin configurations);
    /// `None` for neither.
    pub const fn channel(self) -> Option<u8> {
        match (self.port, self.bit) {
            (Port::B, 4) => Some(0),
            (Port::H, 6) => Some(1),
            _ => None,
        }
    }

    /// Returns the interrupt that an edge on the pin raises; `None` on ports A, C, F, G, H, L and on some other pins.
    pub const fn interrupt(self) -> Option<Interrupt> {
        match (self.port, self.bit) {
            (Port::B, bit) => Some(Interrupt::PinChange(bit)),
            (Port::D, bit @ 0..4) | (Port::E, bit @ 4..8) => Some(Interrupt::External(bit)),
            (Port::E, 0) => Some(Interrupt::PinChange(8)),
            (Port::J, bit @ 0..7) => Some(Interrupt::PinChange(9 + bit)),
            (Port::K, bit) => Some(Interrupt::PinChange(16 + bit)),
            (Port::Gpio, bit) => Some(Interrupt::Gpio(bit)),
            _ => None,
        }
    }
}
