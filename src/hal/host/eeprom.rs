//! The EEPROM of a machine: bytes, and a write takes 3.4 ms.

use core::cell::{Cell, RefCell};
use std::vec::Vec;

use super::now;
use crate::hal::Thread;
use crate::store::Memory;
use crate::store::program::AREA;

/// Cycles that a write takes.
const WRITE_CYCLES: u64 = 54_400;

/// The EEPROM that a machine of this thread finds at its start, and leaves behind.
struct Cells {
    bytes: RefCell<Vec<u8>>,
    busy_until: Cell<u64>,
    /// What has been written: addresses and bytes.
    written: RefCell<Vec<(u16, u8)>>,
}

machine_static! {
    fn cells() -> Cells = Cells {
        bytes: RefCell::new(Vec::new()),
        busy_until: Cell::new(0),
        written: RefCell::new(Vec::new()),
    };
}

/// Returns the bytes in the EEPROM of this thread's machine.
pub fn contents() -> Vec<u8> {
    let mut bytes = cells().bytes.borrow().clone();
    bytes.resize(usize::from(Eeprom::SIZE), 0xFF);
    bytes
}

/// Puts bytes into the EEPROM before the machine boots.
pub fn put(contents: &[u8]) {
    *cells().bytes.borrow_mut() = contents.to_vec();
}

/// Takes what has been written since the last call, address and byte, in order: for tests that cut power at each byte.
pub fn take_written() -> Vec<(u16, u8)> {
    cells().written.take()
}

/// The EEPROM.
pub struct Eeprom(Thread);

impl Eeprom {
    /// Returns access to the EEPROM of this thread's machine.
    pub fn of(thread: Thread) -> Self {
        Self(thread)
    }
}

impl Memory for Eeprom {
    const SIZE: u16 = 4_096;
    const LOG: u16 = Self::SIZE - AREA;

    fn read(&self, at: u16) -> u8 {
        cells().bytes.borrow().get(usize::from(at)).copied().unwrap_or(0xFF)
    }

    fn is_busy(&self) -> bool {
        now() < cells().busy_until.get()
    }

    fn write(&mut self, at: u16, byte: u8) {
        let mut bytes = cells().bytes.borrow_mut();
        bytes.resize(usize::from(Self::SIZE), 0xFF);
        if let Some(cell) = bytes.get_mut(usize::from(at)) {
            *cell = byte;
        }
        cells().written.borrow_mut().push((at, byte));
        cells().busy_until.set(now() + WRITE_CYCLES);
    }
}
