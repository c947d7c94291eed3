//! Self-programming of the ATmega2560 (data sheet, chapter 29): a program in the boot section erases and writes pages
//! of the flash with the instruction SPM.
//!
//! simavr has SPM too, but its write of a page replaces the content at once. Here, as in silicon, a write only clears
//! bits, so a page that was not erased keeps the zeros it had. An erase or a write takes 4.5 ms, in which the flash
//! below the boot section can be neither read nor executed, and stays so until the program enables it again. The boot
//! section itself is locked, as on boards that are sold.

use crate::cpu::Cpu;

const NEVER: u64 = u64::MAX;

/// The register that says what SPM does.
pub const SPMCSR: u16 = 0x57;
/// The first address of the boot section, and of the part of the flash that can be read at any time.
pub const BOOT: u32 = 0x3_E000;
/// Bytes in a page.
pub const PAGE: u32 = 256;

// Bits of SPMCSR.
const UNREADABLE: u8 = 1 << 6;
const SIGNATURE: u8 = 1 << 5;
const ENABLE_READING: u8 = 1 << 4;
const LOCK_BITS: u8 = 1 << 3;
const WRITE: u8 = 1 << 2;
const ERASE: u8 = 1 << 1;
const ENABLE: u8 = 1;

/// Longest time of an erase or a write of a page: 4.5 ms at 16 MHz.
const BUSY: u64 = 72_000;
/// Cycles within which SPM must follow the store to SPMCSR.
const ARMED: u64 = 4;

/// The low fuse, the lock bits, the extended fuse and the high fuse of an Arduino Mega.
const FUSES: [u8; 4] = [0xFF, 0xCF, 0xFD, 0xD8];
/// The signature, at even addresses.
const ID: [u8; 3] = [0x1E, 0x98, 0x01];

/// The state of self-programming.
pub struct Flash {
    /// What the next SPM does.
    control: u8,
    armed_until: u64,
    /// `NEVER` when nothing is being erased or written.
    busy_until: u64,
    is_unreadable: bool,
    /// The buffer that is written to a page. A word can be set once.
    buffer: [Option<u16>; PAGE as usize / 2],
    has_changed: bool,
}

impl Flash {
    /// Nothing is under way.
    pub fn new() -> Self {
        Flash {
            control: 0,
            armed_until: 0,
            busy_until: NEVER,
            is_unreadable: false,
            buffer: [None; PAGE as usize / 2],
            has_changed: false,
        }
    }

    /// Cycle at which the erase or the write under way ends.
    pub fn due(&self) -> u64 {
        self.busy_until
    }

    /// Ends what is due.
    pub fn advance(&mut self, now: u64) {
        if self.busy_until <= now {
            self.busy_until = NEVER;
        }
    }

    /// Whether the flash below the boot section can be neither read nor executed.
    pub fn is_unreadable(&self) -> bool {
        self.is_unreadable
    }

    /// Whether the flash has changed since the last call.
    pub fn take_changed(&mut self) -> bool {
        std::mem::take(&mut self.has_changed)
    }

    /// Reads SPMCSR.
    pub fn read(&self, now: u64) -> u8 {
        let enabled = self.busy_until != NEVER || now <= self.armed_until;
        (u8::from(self.is_unreadable) * UNREADABLE) | (u8::from(enabled) * ENABLE)
    }

    /// Stores to SPMCSR, from cycle `now` on.
    pub fn write(&mut self, value: u8, now: u64) {
        if self.busy_until == NEVER {
            self.control = value;
            self.armed_until = if value & ENABLE != 0 { now + ARMED } else { 0 };
        }
    }

    /// Executes SPM with this address in Z.
    pub fn program(&mut self, cpu: Cpu, z: u32) {
        let now = cpu.cycle();
        if now > self.armed_until || self.busy_until != NEVER {
            return;
        }
        self.armed_until = 0;
        match self.control & (ENABLE_READING | LOCK_BITS | WRITE | ERASE) {
            0 => {
                let word = &mut self.buffer[(z % PAGE / 2) as usize];
                *word = word.or(Some(cpu.word_of_program()));
            }
            ERASE => self.change(cpu, z, |_, _| 0xFFFF),
            WRITE => {
                self.change(cpu, z, |old, new| old & new.unwrap_or(0xFFFF));
                self.buffer.fill(None);
            }
            ENABLE_READING => {
                self.is_unreadable = false;
                self.buffer.fill(None);
            }
            _ => {}
        }
    }

    /// Changes each word of a page, given the word and that in the buffer.
    fn change(&mut self, cpu: Cpu, z: u32, to: impl Fn(u16, Option<u16>) -> u16) {
        let page = z & !(PAGE - 1);
        if page >= BOOT {
            return;
        }
        for (at, new) in (page..).step_by(2).zip(self.buffer) {
            cpu.set_flash(at, &to(cpu.opcode(at), new).to_le_bytes());
        }
        (self.is_unreadable, self.has_changed) = (true, true);
        self.busy_until = cpu.cycle() + BUSY;
    }

    /// Returns what LPM reads at `z` instead of the content; `None` if it reads the content.
    pub fn read_program(&mut self, now: u64, z: u32) -> Option<u8> {
        if now <= self.armed_until && self.control & (LOCK_BITS | SIGNATURE) != 0 {
            self.armed_until = 0;
            // LPM ignores RAMPZ.
            let z = (z & 0xFFFF) as usize;
            let is_fuse = self.control & LOCK_BITS != 0;
            return if is_fuse { FUSES.get(z) } else { ID.get(z / 2) }.copied();
        }
        (self.is_unreadable && z < BOOT).then_some(0xFF)
    }

    /// The state after a reset. What was under way is taken as done.
    pub fn reset(&mut self) {
        *self = Flash { has_changed: self.has_changed, ..Self::new() };
    }
}
