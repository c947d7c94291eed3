//! Pin interrupts: INT0 to INT7 at most, and PCINT0 to PCINT31.
//!
//! They replace simavr's pin interrupts. A flag stays raised while it is masked, each group of eight pins has one
//! flag, and an edge counts at its cycle. Only edges from outside count; the firmware's own outputs raise no flag
//! here. The low-level mode of an INT is treated as its falling edge.

/// The registers, in the data space.
const PCIFR: u16 = 0x3B;
const EIFR: u16 = 0x3C;
const EIMSK: u16 = 0x3D;
const PCICR: u16 = 0x68;
const EICRA: u16 = 0x69;
const EICRB: u16 = 0x6A;

/// The interrupts of each pin. All else is equal on all chips.
pub struct PinLayout {
    /// The vector of INT0; the others follow.
    pub external_vector: u8,
    /// The vector of PCINT0 to PCINT7; the others follow.
    pub change_vector: u8,
    /// The mask register of each eight pins, PCMSK0 first.
    masks: &'static [u16],
    /// Pins with an INT.
    externals: &'static [Pins],
    /// Pins with a PCINT.
    changes: &'static [Pins],
}

/// Adjacent pins of a port whose interrupts have consecutive numbers.
struct Pins {
    port: char,
    first: u8,
    count: u8,
    number: u8,
}

const fn pins(port: char, first: u8, count: u8, number: u8) -> Pins {
    Pins { port, first, count, number }
}

/// The pin interrupts of the ATmega2560.
pub const ATMEGA2560: PinLayout = PinLayout {
    external_vector: 1,
    change_vector: 9,
    masks: &[0x6B, 0x6C, 0x6D],
    externals: &[pins('D', 0, 4, 0), pins('E', 4, 4, 4)],
    changes: &[pins('B', 0, 8, 0), pins('E', 0, 1, 8), pins('J', 0, 7, 9), pins('K', 0, 8, 16)],
};

/// The pin interrupts of the ATmega1284P.
pub const ATMEGA1284P: PinLayout = PinLayout {
    external_vector: 1,
    change_vector: 4,
    masks: &[0x6B, 0x6C, 0x6D, 0x73],
    externals: &[pins('D', 2, 2, 0), pins('B', 2, 1, 2)],
    changes: &[pins('A', 0, 8, 0), pins('B', 0, 8, 8), pins('C', 0, 8, 16), pins('D', 0, 8, 24)],
};

impl PinLayout {
    /// Returns the vectors of all pin interrupts, as a bit set.
    pub fn vectors(&self) -> u64 {
        let externals: u8 = self.externals.iter().map(|pins| pins.count).sum();
        let bits = |count: u64| (1 << count) - 1;
        bits(externals.into()) << self.external_vector
            | bits(self.masks.len() as u64) << self.change_vector
    }

    /// Returns the addresses of all registers.
    pub fn registers(&self) -> impl Iterator<Item = u16> {
        [PCIFR, EIFR, EIMSK, PCICR, EICRA, EICRB].into_iter().chain(self.masks.iter().copied())
    }

    fn group(&self, mask: u16) -> Option<usize> {
        self.masks.iter().position(|known| *known == mask)
    }
}

/// Returns the number of a pin's interrupt; `None` if the pin has none.
fn number(of: &[Pins], port: char, bit: u8) -> Option<u8> {
    of.iter().filter(|pins| pins.port == port).find_map(|pins| {
        bit.checked_sub(pins.first).filter(|n| *n < pins.count).map(|n| pins.number + n)
    })
}

/// The registers of pin interrupts.
pub struct PinInterrupts {
    layout: &'static PinLayout,
    /// EICRB and EICRA: two bits for each INT.
    sense: u16,
    external_mask: u8,
    external_flags: u8,
    change_enable: u8,
    change_flags: u8,
    change_mask: [u8; 4],
}

impl PinInterrupts {
    /// The two flag registers, where SBI touches one flag only.
    pub const FLAGS: [u16; 2] = [PCIFR, EIFR];

    /// The registers in their state after reset.
    pub fn new(layout: &'static PinLayout) -> Self {
        PinInterrupts {
            layout,
            sense: 0,
            external_mask: 0,
            external_flags: 0,
            change_enable: 0,
            change_flags: 0,
            change_mask: [0; 4],
        }
    }

    /// A register is written.
    pub fn write(&mut self, addr: u16, value: u8) {
        match addr {
            PCIFR => self.change_flags &= !value,
            EIFR => self.external_flags &= !value,
            EIMSK => self.external_mask = value,
            PCICR => self.change_enable = value & ((1 << self.layout.masks.len()) - 1),
            EICRA => self.sense = self.sense & 0xFF00 | u16::from(value),
            EICRB => self.sense = self.sense & 0x00FF | u16::from(value) << 8,
            _ => {
                if let Some(group) = self.layout.group(addr) {
                    self.change_mask[group] = value;
                }
            }
        }
    }

    /// Returns the value of a register.
    pub fn read(&self, addr: u16) -> u8 {
        match addr {
            PCIFR => self.change_flags,
            EIFR => self.external_flags,
            EIMSK => self.external_mask,
            PCICR => self.change_enable,
            EICRA => self.sense as u8,
            EICRB => (self.sense >> 8) as u8,
            _ => self.layout.group(addr).map_or(0, |g| self.change_mask[g]),
        }
    }

    /// The level of a pin has changed.
    pub fn edge(&mut self, port: char, bit: u8, high: bool) {
        if let Some(n) = number(self.layout.externals, port, bit) {
            let counts = match self.sense >> (2 * n) & 3 {
                1 => true,
                3 => high,
                _ => !high,
            };
            self.external_flags |= u8::from(counts) << n;
        }
        if let Some(n) = number(self.layout.changes, port, bit)
            && self.change_mask[usize::from(n / 8)] & 1 << (n % 8) != 0
        {
            self.change_flags |= 1 << (n / 8);
        }
    }

    /// Takes note that the interrupt is being served: its flag is cleared.
    pub fn acknowledge(&mut self, vector: u8) {
        match vector.checked_sub(self.layout.change_vector) {
            Some(group) => self.change_flags &= !(1 << group),
            None => self.external_flags &= !(1 << (vector - self.layout.external_vector)),
        }
    }

    /// Vectors that ask for service, as a bit set.
    pub fn lines(&self) -> u64 {
        let external = u64::from(self.external_flags & self.external_mask);
        let change = u64::from(self.change_flags & self.change_enable);
        external << self.layout.external_vector | change << self.layout.change_vector
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_that_is_masked_raises_nothing_and_a_flag_waits_for_its_enable() {
        let mut pins = PinInterrupts::new(&ATMEGA2560);
        pins.edge('B', 4, true);
        assert_eq!(pins.read(PCIFR), 0);
        pins.write(ATMEGA2560.masks[0], 1 << 4);
        pins.edge('B', 5, true);
        assert_eq!(pins.read(PCIFR), 0);
        pins.edge('B', 4, false);
        assert_eq!((pins.read(PCIFR), pins.lines()), (1, 0));
        pins.write(PCICR, 1);
        assert_eq!(pins.lines(), 1 << 9);
        pins.acknowledge(9);
        assert_eq!(pins.lines(), 0);
    }

    #[test]
    fn external_interrupts_go_by_their_sense() {
        for (sense, rising, falling) in [(1, true, true), (2, false, true), (3, true, false)] {
            let mut pins = PinInterrupts::new(&ATMEGA2560);
            pins.write(EICRB, sense << 2);
            pins.write(EIMSK, 1 << 5);
            for (high, wanted) in [(true, rising), (false, falling)] {
                pins.edge('E', 5, high);
                assert_eq!(pins.lines(), u64::from(wanted) << 6, "sense {sense}");
                pins.write(EIFR, 0xFF);
            }
        }
    }

    #[test]
    fn port_j_is_one_off() {
        let mut pins = PinInterrupts::new(&ATMEGA2560);
        pins.write(ATMEGA2560.masks[1], 1 << 2);
        pins.edge('J', 0, true);
        assert_eq!(pins.read(PCIFR), 0);
        pins.edge('J', 1, true);
        assert_eq!(pins.read(PCIFR), 2);
    }
}
