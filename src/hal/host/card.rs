//! An SD card of a machine: a card of high capacity. It is busy for some time after each block that is written. Blocks
//! that nobody has written are 0.

use crate::hal::Thread;
use core::cell::{Cell, RefCell};
use std::collections::{HashMap, VecDeque};
use std::vec::Vec;

use super::time::millis;

/// The blocks of a card that are not all 0.
pub type Blocks = HashMap<u32, [u8; 512]>;

/// The byte that begins a block, and the answer to a block that was written.
const START: u8 = 0xFE;
const TAKEN: u8 = 0xE5;
/// For how many bytes a card is busy with a block, and for how many milliseconds at most. Time stands still for a reader
/// that does nothing else.
const BUSY: u32 = 40;
const BUSY_MS: u32 = 20;
/// Bytes before a block: a reader without patience does not find it at once.
const WAIT: [u8; 12] = [0xFF; 12];

struct Card {
    /// `None`: there is no card.
    blocks: RefCell<Option<Blocks>>,
    /// Bytes of a command, or of the block that is being written behind its number.
    taken: RefCell<Vec<u8>>,
    writes: Cell<Option<u32>>,
    answer: RefCell<VecDeque<u8>>,
    reads: Cell<u32>,
    /// For how many bytes the card is busy, and since when, ms.
    busy: Cell<(u32, u32)>,
}

machine_static! {
    fn card() -> Card = Card {
        blocks: RefCell::new(None),
        taken: RefCell::new(Vec::new()),
        writes: Cell::new(None),
        answer: RefCell::new(VecDeque::new()),
        reads: Cell::new(0),
        busy: Cell::new((0, 0)),
    };
}

/// Puts a card into the slot of this thread's machine, or takes it out.
pub fn insert(blocks: Option<Blocks>) {
    *card().blocks.borrow_mut() = blocks;
}

/// Returns the blocks of the card; `None` without a card.
pub fn blocks() -> Option<Blocks> {
    card().blocks.borrow().clone()
}

/// Returns how many blocks have been read so far.
pub fn reads() -> u32 {
    card().reads.get()
}

/// Selects the card.
pub fn select(_: Thread) {
    card().taken.borrow_mut().clear();
    card().answer.borrow_mut().clear();
    card().writes.set(None);
}

/// Deselects the card.
pub fn release(_: Thread) {}

/// Sets the speed of the clock.
pub fn set_fast(_: Thread, _: bool) {}

/// Sends a byte. Returns what the card sends meanwhile; 0xFF without a card, because an undriven line is high.
pub fn exchange(_: Thread, byte: u8) -> u8 {
    let mut blocks = card().blocks.borrow_mut();
    let Some(blocks) = blocks.as_mut() else { return 0xFF };
    let (busy, since) = card().busy.get();
    let is_busy = busy > 0 && millis().wrapping_sub(since) < BUSY_MS;
    let none = if is_busy { 0 } else { 0xFF };
    card().busy.set((busy.saturating_sub(1), since));
    let answer = card().answer.borrow_mut().pop_front().unwrap_or(none);
    let mut taken = card().taken.borrow_mut();
    let is_idle = taken.is_empty();
    match card().writes.get() {
        Some(_) if is_idle && byte != START => {}
        None if is_idle && byte & 0xC0 != 0x40 => {}
        _ => taken.push(byte),
    }
    if let Some(block) = card().writes.get().filter(|_| taken.len() == 515) {
        let mut contents = [0; 512];
        contents.copy_from_slice(&taken[1..513]);
        blocks.insert(block, contents);
        card().answer.borrow_mut().push_back(TAKEN);
        card().busy.set((BUSY, millis()));
        card().writes.set(None);
        taken.clear();
    } else if card().writes.get().is_none() && taken.len() == 6 {
        let argument = u32::from_be_bytes([taken[1], taken[2], taken[3], taken[4]]);
        obey(taken[0] & 0x3F, argument, blocks);
        taken.clear();
    }
    answer
}

/// Carries out a command.
fn obey(number: u8, argument: u32, blocks: &Blocks) {
    let mut answer = card().answer.borrow_mut();
    match number {
        0 => answer.push_back(1),
        8 => answer.extend([1, 0, 0, 1, 0xAA]),
        58 => answer.extend([0, 0xC0, 0, 0, 0]),
        17 => {
            card().reads.set(card().reads.get() + 1);
            answer.push_back(0);
            answer.extend(WAIT);
            answer.push_back(START);
            answer.extend(blocks.get(&argument).unwrap_or(&[0; 512]));
            answer.extend([0, 0]);
        }
        24 => {
            answer.push_back(0);
            card().writes.set(Some(argument));
        }
        _ => answer.push_back(0),
    }
}

/// Reads a block.
pub fn read(thread: Thread, block: &mut [u8; 512]) {
    block.fill_with(|| exchange(thread, 0xFF));
}

/// Whether another device waits for the lines: never.
pub fn is_wanted(_: Thread) -> bool {
    false
}
