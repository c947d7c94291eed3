//! SPI as a master, and the devices on it: MAX6675s, and an SD card.
//!
//! A byte takes eight bits of the clock that the registers select. A byte that is written before the previous one is
//! done sets WCOL and is lost. Nothing is exchanged unless the pins of the clock, of MOSI and of SS are outputs. Not
//! modelled: the interrupt, a slave, modes other than 0.

use kerf::boards::Pin;

use crate::card::SdCard;
use crate::cpu::Cpu;

const SPCR: u16 = 0x4C;
const SPSR: u16 = 0x4D;
const SPDR: u16 = 0x4E;
const DDRB: usize = 0x24;

/// Bits of SPCR: interrupt, on, order, master, polarity, phase, clock.
const ON_AS_MASTER: u8 = 0b0101_0000;
const ASIDE_FROM_CLOCK: u8 = 0b1111_1100;
/// Bits of SPSR.
const DONE: u8 = 1 << 7;
const COLLISION: u8 = 1 << 6;
const DOUBLE: u8 = 1;
/// SS, SCK and MOSI.
const OUTPUTS: u8 = 0b111;
/// What a line reads that no device drives: it has a pull-up.
const IDLE: u8 = 0xFF;

/// Time that a MAX6675 takes for a conversion, ms.
const CONVERTS_MS: u64 = 220;

/// A chip that is selected while its pin is low.
trait Device {
    /// Takes note that the chip is selected or deselected.
    fn select(&mut self, selected: bool, cycle: u64);
    /// Sends a byte to the chip, and returns the byte that it sends at the same time.
    fn exchange(&mut self, byte: u8, cycle: u64) -> u8;
}

/// A MAX6675 with its thermocouple.
pub struct Max6675 {
    /// Temperature of the thermocouple, degrees; `None` while one of its wires is off.
    pub degrees: Option<f64>,
    /// Words that have been read.
    pub read: u64,
    /// Conversions that a reading has ended too early.
    pub spoilt: u64,
    is_there: bool,
    cycles_per_ms: u64,
    ready_at: u64,
    word: u16,
    sent: usize,
}

impl Max6675 {
    fn new(clock_hz: u32) -> Self {
        let cycles_per_ms = u64::from(clock_hz) / 1_000;
        let ready_at = CONVERTS_MS * cycles_per_ms;
        let degrees = Some(22.0);
        Self {
            degrees,
            read: 0,
            spoilt: 0,
            is_there: true,
            cycles_per_ms,
            ready_at,
            word: 0,
            sent: 0,
        }
    }

    /// Takes the chip off the lines.
    pub fn unplug(&mut self) {
        self.is_there = false;
    }

    fn convert(&self) -> u16 {
        match self.degrees {
            Some(degrees) => ((degrees.clamp(0.0, 1_023.75) * 4.0) as u16) << 3,
            None => 1 << 2,
        }
    }
}

impl Device for Max6675 {
    fn select(&mut self, selected: bool, cycle: u64) {
        if !selected {
            self.ready_at = cycle + CONVERTS_MS * self.cycles_per_ms;
        } else if cycle >= self.ready_at {
            (self.word, self.sent) = (self.convert(), 0);
            self.read += 1;
        } else {
            self.sent = 0;
            self.spoilt += 1;
        }
    }

    fn exchange(&mut self, _: u8, _: u64) -> u8 {
        if !self.is_there {
            return IDLE;
        }
        let byte = self.word.to_be_bytes().get(self.sent).copied().unwrap_or(0);
        self.sent += 1;
        byte
    }
}

/// The registers, and the devices on the lines.
#[derive(Default)]
pub struct Spi {
    control: u8,
    status: u8,
    received: u8,
    /// Cycle at which the byte under way is complete.
    done_at: Option<u64>,
    /// Whether the status was read with the flag set. The next access to the data register then clears the flag.
    seen: bool,
    thermocouples: Vec<(Pin, Max6675)>,
    card: Option<(Pin, SdCard)>,
}

impl Spi {
    /// Registers.
    pub const REGISTERS: [u16; 3] = [SPCR, SPSR, SPDR];

    /// The registers in their state after a reset, with no device.
    pub fn new() -> Self {
        Self::default()
    }

    /// Resets the registers; the devices keep their state.
    pub fn reset(&mut self) {
        let thermocouples = std::mem::take(&mut self.thermocouples);
        *self = Self { thermocouples, card: self.card.take(), ..Self::new() };
    }

    /// Puts a MAX6675 there, selected by a pin.
    pub fn add_max6675(&mut self, select: Pin, clock_hz: u32) {
        self.thermocouples.push((select, Max6675::new(clock_hz)));
    }

    /// Puts an SD card there, selected by a pin.
    pub fn add_card(&mut self, select: Pin, card: SdCard) {
        self.card = Some((select, card));
    }

    /// The SD card.
    pub fn card(&mut self) -> Option<&mut SdCard> {
        self.card.as_mut().map(|(_, card)| card)
    }

    /// The MAX6675 that a pin selects.
    pub fn max6675(&mut self, select: Pin) -> Option<&mut Max6675> {
        self.thermocouples.iter_mut().find(|(pin, _)| *pin == select).map(|(_, chip)| chip)
    }

    /// Takes a level of a pin that selects a device.
    pub fn select(&mut self, pin: Pin, high: bool, cycle: u64) {
        for (_, device) in self.thermocouples.iter_mut().filter(|(select, _)| *select == pin) {
            device.select(!high, cycle);
        }
        if let Some((_, card)) = self.card.as_mut().filter(|(select, _)| *select == pin) {
            card.select(!high);
        }
    }

    /// A register is written.
    pub fn write(&mut self, addr: u16, value: u8, cycle: u64, cpu: Cpu) {
        match addr {
            SPCR => self.control = value,
            SPSR => self.status = self.status & !DOUBLE | value & DOUBLE,
            _ => self.send(value, cycle, cpu),
        }
    }

    /// A register is read.
    pub fn read(&mut self, addr: u16, cycle: u64) -> u8 {
        self.pass(cycle);
        match addr {
            SPCR => self.control,
            SPSR => {
                self.seen = self.status & DONE != 0;
                self.status
            }
            _ => {
                self.forget();
                self.received
            }
        }
    }

    fn pass(&mut self, cycle: u64) {
        if self.done_at.is_some_and(|at| at <= cycle) {
            self.done_at = None;
            self.status |= DONE;
        }
    }

    fn forget(&mut self) {
        if std::mem::take(&mut self.seen) {
            self.status &= DOUBLE;
        }
    }

    fn send(&mut self, byte: u8, cycle: u64, cpu: Cpu) {
        self.pass(cycle);
        self.forget();
        if self.done_at.is_some() {
            self.status |= COLLISION;
            return;
        }
        let is_on = self.control & ASIDE_FROM_CLOCK == ON_AS_MASTER;
        if !is_on || cpu.data(DDRB) & OUTPUTS != OUTPUTS {
            return;
        }
        let bit = [4, 16, 64, 128][usize::from(self.control & 3)] >> (self.status & DOUBLE);
        self.done_at = Some(cycle + 8 * bit);
        let selected = |pin: Pin| {
            let port = pin.port.address();
            let low = cpu.data(port) & 1 << pin.bit == 0;
            low && cpu.data(port - 1) & 1 << pin.bit != 0
        };
        self.received = self
            .thermocouples
            .iter_mut()
            .filter(|(pin, _)| selected(*pin))
            .fold(IDLE, |line, (_, device)| line & device.exchange(byte, cycle));
        if let Some((_, card)) = self.card.as_mut().filter(|(pin, _)| selected(*pin)) {
            self.received &= card.exchange(byte, cycle);
        }
    }
}
