//! Where the registers and vectors of each timer are (data sheets: register summary).

/// Registers and vectors of one timer.
pub struct Layout {
    /// Whether the timer has 16 bits and a capture register.
    pub wide: bool,
    /// Control register A.
    pub tccra: u16,
    /// Control register B.
    pub tccrb: u16,
    /// The counter (low byte).
    pub tcnt: u16,
    /// The compare registers (low bytes); 0 where there is none.
    pub ocr: [u16; 3],
    /// The capture register (low byte); 0 where there is none.
    pub icr: u16,
    /// Interrupt mask.
    pub timsk: u16,
    /// Interrupt flags.
    pub tifr: u16,
    /// Vectors by flag bit; 0 where there is none.
    pub vectors: [u8; 6],
    /// Cycles per count by clock select; 0 stops the timer.
    pub prescale: [u64; 8],
}

const SYNCHRONOUS: [u64; 8] = [0, 1, 8, 64, 256, 1024, 0, 0];
const ASYNCHRONOUS: [u64; 8] = [0, 1, 8, 32, 64, 128, 256, 1024];

impl Layout {
    /// Number of compare channels.
    pub fn channels(&self) -> usize {
        self.ocr.iter().filter(|r| **r != 0).count()
    }

    /// Bits of the mask and flag registers that exist.
    pub fn implemented(&self) -> u8 {
        let capture = if self.wide { 0x20 } else { 0 };
        capture | ((2 << self.channels()) - 1)
    }

    /// Whether a register is the high byte of a 16-bit register.
    pub fn is_high_byte(&self, addr: u16) -> bool {
        self.words().any(|low| addr == low + 1)
    }

    fn words(&self) -> impl Iterator<Item = u16> {
        [self.tcnt, self.icr].into_iter().chain(self.ocr).filter(|r| *r != 0)
    }

    /// Returns the addresses of all registers.
    pub fn registers(&self) -> Vec<u16> {
        let mut all = vec![self.tccra, self.tccrb, self.timsk, self.tifr];
        for low in self.words() {
            all.push(low);
            if self.wide {
                all.push(low + 1);
            }
        }
        all
    }

    const fn narrow(tccra: u16, timsk: u16, tifr: u16, v: u8, prescale: [u64; 8]) -> Layout {
        Layout {
            wide: false,
            tccra,
            tccrb: tccra + 1,
            tcnt: tccra + 2,
            ocr: [tccra + 3, tccra + 4, 0],
            icr: 0,
            timsk,
            tifr,
            vectors: [v + 2, v, v + 1, 0, 0, 0],
            prescale,
        }
    }

    /// A 16-bit timer with three compare channels.
    const fn wide(tccra: u16, timsk: u16, tifr: u16, v: u8) -> Layout {
        Layout {
            wide: true,
            tccra,
            tccrb: tccra + 1,
            tcnt: tccra + 4,
            ocr: [tccra + 8, tccra + 10, tccra + 12],
            icr: tccra + 6,
            timsk,
            tifr,
            vectors: [v + 4, v + 1, v + 2, v + 3, 0, v],
            prescale: SYNCHRONOUS,
        }
    }

    /// A 16-bit timer with two compare channels.
    const fn wide_of_two(tccra: u16, timsk: u16, tifr: u16, v: u8) -> Layout {
        Layout {
            ocr: [tccra + 8, tccra + 10, 0],
            vectors: [v + 3, v + 1, v + 2, 0, 0, v],
            ..Self::wide(tccra, timsk, tifr, v)
        }
    }
}

/// Timers 0 to 5 of the ATmega2560.
pub static ATMEGA2560: [Layout; 6] = [
    Layout::narrow(0x44, 0x6E, 0x35, 21, SYNCHRONOUS),
    Layout::wide(0x80, 0x6F, 0x36, 16),
    Layout::narrow(0xB0, 0x70, 0x37, 13, ASYNCHRONOUS),
    Layout::wide(0x90, 0x71, 0x38, 31),
    Layout::wide(0xA0, 0x72, 0x39, 41),
    Layout::wide(0x120, 0x73, 0x3A, 46),
];

/// Timers 0 to 3 of the ATmega1284P.
pub static ATMEGA1284P: [Layout; 4] = [
    Layout::narrow(0x44, 0x6E, 0x35, 16, SYNCHRONOUS),
    Layout::wide_of_two(0x80, 0x6F, 0x36, 12),
    Layout::narrow(0xB0, 0x70, 0x37, 9, ASYNCHRONOUS),
    Layout::wide_of_two(0x90, 0x71, 0x38, 31),
];
