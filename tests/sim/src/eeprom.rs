//! The EEPROM: a write takes 3.4 ms and EE_READY is a level.

use crate::stuck::Stuck;

const NEVER: u64 = u64::MAX;

/// Size of the EEPROM, bytes.
pub const SIZE: usize = 4096;

const EECR: u16 = 0x3F;
const EEDR: u16 = 0x40;
const EEARL: u16 = 0x41;
const EEARH: u16 = 0x42;

// Bits of EECR.
const READ: u8 = 1;
const WRITE: u8 = 1 << 1;
const MASTER: u8 = 1 << 2;
const READY_ENABLE: u8 = 1 << 3;
const MODE_SHIFT: u8 = 4;

/// Cycles of a write: erase and write, erase only, write only (data sheet, at 16 MHz).
const WRITE_CYCLES: [u64; 4] = [54_400, 28_800, 28_800, 54_400];
/// Cycles that MASTER stays set.
const MASTER_CYCLES: u64 = 4;

/// The EEPROM and its registers.
pub struct Eeprom {
    cells: Box<[u8; SIZE]>,
    control: u8,
    data: u8,
    address: u16,
    master_until: u64,
    busy_until: u64,
    writes: u64,
    /// Cells with bits that do not change.
    stuck: Vec<Stuck>,
}

impl Eeprom {
    /// Registers.
    pub const REGISTERS: [u16; 4] = [EECR, EEDR, EEARL, EEARH];

    /// An erased EEPROM.
    pub fn new() -> Self {
        Eeprom {
            cells: Box::new([0xFF; SIZE]),
            control: 0,
            data: 0,
            address: 0,
            master_until: 0,
            busy_until: 0,
            writes: 0,
            stuck: Vec::new(),
        }
    }

    /// From now on the bits of `stuck` do not change.
    pub fn stick(&mut self, stuck: Stuck) {
        self.stuck.push(stuck);
        self.hold_stuck();
    }

    fn hold_stuck(&mut self) {
        for stuck in &self.stuck {
            let cell = &mut self.cells[usize::from(stuck.address)];
            *cell = stuck.of(*cell);
        }
    }

    /// The contents.
    pub fn cells(&self) -> &[u8; SIZE] {
        &self.cells
    }

    /// Replaces the contents.
    pub fn set_cells(&mut self, cells: &[u8; SIZE]) {
        *self.cells = *cells;
        self.hold_stuck();
    }

    /// Bytes written so far.
    pub fn writes(&self) -> u64 {
        self.writes
    }

    /// Puts the registers into their state after a reset; a write under way is taken as done.
    pub fn reset(&mut self) {
        (self.control, self.master_until, self.busy_until) = (0, 0, 0);
    }

    /// Cycle at which the write under way is done.
    pub fn due(&self) -> u64 {
        if self.busy_until == 0 { NEVER } else { self.busy_until }
    }

    /// Ends the write that is due.
    pub fn advance(&mut self, now: u64) {
        if self.busy_until <= now {
            self.busy_until = 0;
        }
    }

    /// Whether EE_READY asks for service.
    pub fn asks(&self) -> bool {
        self.busy_until == 0 && self.control & READY_ENABLE != 0
    }

    /// A load that samples at cycle `now`.
    pub fn read(&mut self, addr: u16, now: u64) -> Option<u8> {
        self.advance(now);
        Some(match addr {
            EECR => {
                let busy = if self.busy_until != 0 { WRITE } else { 0 };
                let master = if self.master_until > now { MASTER } else { 0 };
                self.control & !(WRITE | MASTER | READ) | busy | master
            }
            EEDR => self.data,
            EEARL => self.address as u8,
            _ => (self.address >> 8) as u8,
        })
    }

    /// A store that takes effect at cycle `now`. Returns how many cycles the CPU is halted.
    pub fn write(&mut self, addr: u16, value: u8, now: u64) -> u64 {
        self.advance(now);
        match addr {
            EECR => return self.command(value, now),
            EEDR => self.data = value,
            EEARL => self.address = (self.address & 0x0F00) | u16::from(value),
            _ => self.address = (self.address & 0x00FF) | u16::from(value & 0x0F) << 8,
        }
        0
    }

    fn command(&mut self, value: u8, now: u64) -> u64 {
        let armed = self.master_until >= now;
        self.control = value & !(READ | WRITE | MASTER);
        if value & MASTER != 0 && !armed {
            self.master_until = now + MASTER_CYCLES;
        }
        if self.busy_until != 0 {
            return 0;
        }
        if value & WRITE != 0 && armed {
            self.program(now);
            return 2;
        }
        if value & READ != 0 {
            self.data = self.cells[usize::from(self.address)];
            return 4;
        }
        0
    }

    fn program(&mut self, now: u64) {
        let mode = usize::from(self.control >> MODE_SHIFT & 3);
        let cell = &mut self.cells[usize::from(self.address)];
        *cell = match mode {
            1 => 0xFF,
            2 => *cell & self.data,
            _ => self.data,
        };
        self.hold_stuck();
        self.master_until = 0;
        self.busy_until = now + WRITE_CYCLES[mode];
        self.writes += 1;
    }
}

impl Default for Eeprom {
    fn default() -> Self {
        Self::new()
    }
}
