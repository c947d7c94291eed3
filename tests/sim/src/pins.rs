//! Interrupts of pins: INT0 to INT7 and PCINT0 to PCINT23.
//!
//! In place of simavr's: a flag stays raised while it is masked, each group of eight pins has one flag, and an edge
//! counts at its cycle. An edge is one that comes from outside; the firmware's own outputs raise nothing here. The
//! low level of an INT is taken for its falling edge.

/// The registers, in the data space.
const PCIFR: u16 = 0x3B;
const EIFR: u16 = 0x3C;
const EIMSK: u16 = 0x3D;
const PCICR: u16 = 0x68;
const EICRA: u16 = 0x69;
const EICRB: u16 = 0x6A;
const PCMSK: [u16; 3] = [0x6B, 0x6C, 0x6D];

/// The vector of INT0, and that of PCINT0; the others follow.
const INT0: u8 = 1;
const PCINT0: u8 = 9;

/// The registers of pin interrupts.
#[derive(Default)]
pub struct PinInterrupts {
    /// EICRB and EICRA: two bits for each INT.
    sense: u16,
    external_mask: u8,
    external_flags: u8,
    change_enable: u8,
    change_flags: u8,
    change_mask: [u8; 3],
}

impl PinInterrupts {
    /// Every register.
    pub const REGISTERS: [u16; 9] =
        [PCIFR, EIFR, EIMSK, PCICR, EICRA, EICRB, PCMSK[0], PCMSK[1], PCMSK[2]];
    /// The two of flags, of which SBI touches one flag only.
    pub const FLAGS: [u16; 2] = [PCIFR, EIFR];
    /// The vectors, as a bit set.
    pub const VECTORS: u64 = 0x7FF << INT0;

    /// A register is written.
    pub fn write(&mut self, addr: u16, value: u8) {
        match addr {
            PCIFR => self.change_flags &= !value,
            EIFR => self.external_flags &= !value,
            EIMSK => self.external_mask = value,
            PCICR => self.change_enable = value & 7,
            EICRA => self.sense = self.sense & 0xFF00 | u16::from(value),
            EICRB => self.sense = self.sense & 0x00FF | u16::from(value) << 8,
            _ => {
                if let Some(group) = PCMSK.iter().position(|a| *a == addr) {
                    self.change_mask[group] = value;
                }
            }
        }
    }

    /// What a register reads.
    pub fn read(&self, addr: u16) -> u8 {
        match addr {
            PCIFR => self.change_flags,
            EIFR => self.external_flags,
            EIMSK => self.external_mask,
            PCICR => self.change_enable,
            EICRA => self.sense as u8,
            EICRB => (self.sense >> 8) as u8,
            _ => PCMSK.iter().position(|a| *a == addr).map_or(0, |g| self.change_mask[g]),
        }
    }

    /// The level of a pin has changed.
    pub fn edge(&mut self, port: char, bit: u8, high: bool) {
        let external = match (port, bit) {
            ('D', 0..4) | ('E', 4..8) => Some(bit),
            _ => None,
        };
        if let Some(n) = external {
            let counts = match self.sense >> (2 * n) & 3 {
                1 => true,
                3 => high,
                _ => !high,
            };
            self.external_flags |= u8::from(counts) << n;
        }
        let change = match (port, bit) {
            ('B', _) => Some(bit),
            ('E', 0) => Some(8),
            ('J', 0..7) => Some(9 + bit),
            ('K', _) => Some(16 + bit),
            _ => None,
        };
        if let Some(n) = change
            && self.change_mask[usize::from(n / 8)] & 1 << (n % 8) != 0
        {
            self.change_flags |= 1 << (n / 8);
        }
    }

    /// The interrupt is being served.
    pub fn acknowledge(&mut self, vector: u8) {
        match vector.checked_sub(PCINT0) {
            Some(group) => self.change_flags &= !(1 << group),
            None => self.external_flags &= !(1 << (vector - INT0)),
        }
    }

    /// Vectors that ask for service, as a bit set.
    pub fn lines(&self) -> u64 {
        let external = u64::from(self.external_flags & self.external_mask);
        let change = u64::from(self.change_flags & self.change_enable);
        external << INT0 | change << PCINT0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_that_is_masked_raises_nothing_and_a_flag_waits_for_its_enable() {
        let mut pins = PinInterrupts::default();
        pins.edge('B', 4, true);
        assert_eq!(pins.read(PCIFR), 0);
        pins.write(PCMSK[0], 1 << 4);
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
            let mut pins = PinInterrupts::default();
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
        let mut pins = PinInterrupts::default();
        pins.write(PCMSK[1], 1 << 2);
        pins.edge('J', 0, true);
        assert_eq!(pins.read(PCIFR), 0);
        pins.edge('J', 1, true);
        assert_eq!(pins.read(PCIFR), 2);
    }
}
