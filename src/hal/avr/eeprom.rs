//! The EEPROM: 4,096 bytes; writing one takes 3.4 ms. After start-up only thread mode uses it. The storage task
//! writes the log, and the parser the program behind the log, one byte each in turn; any task may read. A read waits
//! for a write that is under way.

use core::arch::asm;

use crate::hal::Thread;
use crate::store::Memory;
use crate::store::program::AREA;

const EECR: *mut u8 = 0x3F as *mut u8;
const EEDR: *mut u8 = 0x40 as *mut u8;
const EEAR: *mut u16 = 0x41 as *mut u16;
const READ: u8 = 1;
const WRITE: u8 = 1 << 1;

/// Access to the EEPROM.
pub struct Eeprom(Thread);

impl Eeprom {
    /// Returns access. At most one task may write each part.
    pub fn of(thread: Thread) -> Self {
        Self(thread)
    }
}

impl Memory for Eeprom {
    const SIZE: u16 = 4_096;
    const LOG: u16 = Self::SIZE - AREA;

    /// Cost: 20 cycles.
    #[inline(never)]
    fn read(&self, at: u16) -> u8 {
        self.read_here(at)
    }

    /// Cost: 12 cycles.
    #[inline(always)]
    fn read_here(&self, at: u16) -> u8 {
        while self.is_busy() {}
        // SAFETY: only code with a `Thread`, as `self` has, touches these registers; the EEPROM is idle.
        unsafe {
            EEAR.write_volatile(at);
            EECR.write_volatile(READ);
            EEDR.read_volatile()
        }
    }

    fn is_busy(&self) -> bool {
        // SAFETY: reading it changes nothing.
        unsafe { EECR.read_volatile() & WRITE != 0 }
    }

    fn write(&mut self, at: u16, byte: u8) {
        while self.is_busy() {}
        // SAFETY: only code with a `Thread`, as `self` has, touches these registers; the EEPROM is idle. The write has to
        // begin within four cycles of its enable, so interrupts are off for 6.
        unsafe {
            EEAR.write_volatile(at);
            EEDR.write_volatile(byte);
            asm!(
                "in   {status}, 0x3F",
                "cli",
                "sbi  0x1F, 2",
                "sbi  0x1F, 1",
                "out  0x3F, {status}",
                status = out(reg) _,
                options(nostack),
            );
        }
    }
}
