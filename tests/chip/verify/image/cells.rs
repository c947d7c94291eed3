//! Tests cells of the EEPROM.
//!
//! Each cell is written twice: with the complement of its value, and with its value again. That takes 7 ms. A cell is
//! bad if it does not hold one of both. The contents are as before afterwards, but for a cell that cannot hold them. If
//! the power goes meanwhile, the value of one cell is lost.

use kerf::hal::Thread;
use kerf::hal::imp::eeprom::Eeprom;
use kerf::store::Memory;

/// Most cells that one command tests: half a second.
const MOST: u32 = 64;

/// Tests `count` cells. Returns how many are bad, and the address of the first bad one, or 0. `None` if that is too
/// many, or beyond the end.
pub fn test(from: u32, count: u32) -> Option<(u32, u32)> {
    if count > MOST || from + count > u32::from(Eeprom::SIZE) {
        return None;
    }
    // SAFETY: this image has no interrupts and no tasks, so thread mode is all there is.
    let mut memory = Eeprom::of(unsafe { Thread::assume() });
    let (mut bad, mut first) = (0, 0);
    for at in from..from + count {
        if !is_sound(&mut memory, at as u16) {
            first = if bad == 0 { at } else { first };
            bad += 1;
        }
    }
    Some((bad, first))
}

fn is_sound(memory: &mut Eeprom, at: u16) -> bool {
    let own = memory.read(at);
    let mut holds = |value| {
        memory.write(at, value);
        memory.read(at) == value
    };
    let complement = holds(!own);
    holds(own) && complement
}
