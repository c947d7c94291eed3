//! The ring buffer of records.
//!
//! Invariant between writes: the slot behind the newest record, the gap, holds nothing that is needed. A new record
//! goes into the gap. Before that, the slot behind the gap is cleared, because it becomes the next gap: if its record
//! is the newest of its item, a copy of the record is written into the gap first. So each write of an item costs one
//! record plus the copies that make room: one and a half records on average while half of the slots hold valid
//! records.
//!
//! Cost on AVR: 70 cycles for each slot that was ever used, of 290. Finding the newest records of a row of the tables
//! takes up to 26,000 cycles (`tests/sim/tests/interpreter.rs`).

use super::Memory;
use super::record::{self, BEGUN, Record, SIZE};

/// The position of the next record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Log {
    /// The slot that the next record goes into.
    gap: u16,
    /// The number of the next record.
    next: u16,
    /// All slots that were ever used are below this one.
    used: u16,
    /// Whether the log has all of the memory.
    wide: bool,
}

/// A record that is being written to memory.
#[derive(Clone, Copy, Debug)]
pub struct Write {
    slot: u16,
    bytes: [u8; SIZE as usize],
    /// Bytes written so far. The first one clears the mark of the old record.
    done: u8,
}

/// The next step of storing an item.
#[derive(Clone, Copy, Debug)]
pub enum Put {
    /// Write this copy of an older record, which makes room, then call [`Log::put`] again.
    Room(Write),
    /// Write this record, which is that of the item.
    Last(Write),
    /// There is no room: every slot has been copied, so each holds the newest record of some item.
    Full,
}

#[small]
impl Log {
    /// Finds the end of the log.
    pub fn open<M: Memory>(memory: &M) -> Self {
        let mut newest: Option<(u16, u16)> = None;
        let mut used = 0;
        for slot in 0..M::SIZE / SIZE {
            let Some(record) = read(memory, slot) else { continue };
            used = slot + 1;
            if newest.is_none_or(|(_, number)| is_after(record.number, number)) {
                newest = Some((slot, record.number));
            }
        }
        let mut log = Self { gap: 0, next: 0, used, wide: used > M::LOG / SIZE };
        if let Some((slot, number)) = newest {
            (log.gap, log.next) = (log.behind::<M>(slot), number.wrapping_add(1));
        }
        log
    }

    /// Whether the log's memory is not empty but holds no record. It then holds another program's data, or random bytes.
    /// The first slot may have a record that was cut short. Cost on AVR: up to 80,000 cycles, if the memory is empty.
    pub fn is_rubbish<M: Memory>(&self, memory: &M) -> bool {
        self.is_empty() && (SIZE..M::LOG).any(|at| memory.read(at) != 0xFF)
    }

    /// Returns the value of an item; `None` if it was never stored.
    #[inline(never)]
    pub fn newest<M: Memory>(&self, memory: &M, key: u16) -> Option<i32> {
        let mut newest = None;
        self.search(memory, &[key], |_, value| newest = Some(value));
        newest
    }

    /// Gives the values of several items, eight at most, in one search to `each`, with their indices: those that were
    /// ever stored, each once. Returns which they are, as bits.
    #[inline(always)]
    pub fn search<M: Memory, const N: usize>(
        &self,
        memory: &M,
        keys: &[u16; N],
        mut each: impl FnMut(usize, i32),
    ) -> u8 {
        const { assert!(N <= 8) };
        let (mut found, all) = (0, (0xFFu16 >> (8 - N)) as u8);
        let mut back = Backwards { at: self.gap * SIZE, left: self.used, end: self.used * SIZE };
        let common = Common::of(keys);
        while let Some((at, key)) = back.next(memory, common) {
            let sought = keys.iter().position(|sought| *sought == key);
            if let Some(i) = sought
                && found & 1 << i == 0
                && let Some(record) = read(memory, at / SIZE)
            {
                each(i, record.value);
                found |= 1 << i;
                if found == all {
                    break;
                }
            }
        }
        found
    }

    /// Whether nothing was ever stored.
    pub fn is_empty(&self) -> bool {
        self.used == 0
    }

    /// Calls `each` for all records, from the oldest to the newest.
    pub fn replay<M: Memory>(&self, memory: &M, mut each: impl FnMut(&Record)) {
        // The record in the gap, if any, is the oldest.
        let mut slot = self.gap;
        for _ in 0..self.slots::<M>() {
            if let Some(record) = read(memory, slot) {
                each(&record);
            }
            slot = self.behind::<M>(slot);
        }
    }

    /// Returns what to write next to store an item. `moved` counts the records copied so far to make room for it.
    pub fn put<M: Memory>(&mut self, memory: &M, key: u16, value: i32, moved: u16) -> Put {
        let next_gap = self.behind::<M>(self.gap);
        let last = Record { key, number: self.next, value };
        match read(memory, next_gap) {
            Some(record) if record.key != key && self.counts(memory, next_gap, record.key) => {
                if moved >= self.slots::<M>() {
                    return Put::Full;
                }
                Put::Room(self.append::<M>(Record { number: self.next, ..record }))
            }
            _ => Put::Last(self.append::<M>(last)),
        }
    }

    /// Whether the log has all of the memory. This is so if earlier firmware, which stored no programs, has written
    /// records beyond [`Memory::LOG`].
    pub fn is_wide(&self) -> bool {
        self.wide
    }

    fn slots<M: Memory>(&self) -> u16 {
        if self.wide { M::SIZE / SIZE } else { M::LOG / SIZE }
    }

    fn behind<M: Memory>(&self, slot: u16) -> u16 {
        if slot + 1 == self.slots::<M>() { 0 } else { slot + 1 }
    }

    fn append<M: Memory>(&mut self, record: Record) -> Write {
        let slot = self.gap;
        self.gap = self.behind::<M>(slot);
        self.used = self.used.max(slot + 1);
        self.next = self.next.wrapping_add(1);
        Write { slot, bytes: record.bytes(), done: 0 }
    }

    /// Whether the record in a slot is the newest of its item.
    fn counts<M: Memory>(&self, memory: &M, slot: u16, key: u16) -> bool {
        let mut at = self.behind::<M>(slot);
        // The newer records are in the slots from here up to the gap.
        while at != self.gap {
            if at >= self.used {
                at = 0;
                continue;
            }
            if key_at(memory, at * SIZE) == key && read(memory, at).is_some() {
                return false;
            }
            at = self.behind::<M>(at);
        }
        true
    }
}

#[small]
impl Write {
    /// Returns the address of the next byte, and the byte; `None` after the last one.
    #[inline(always)]
    fn next(&self) -> Option<(u16, u8)> {
        let start = self.slot * SIZE;
        Some(match self.done {
            0 => (start, BEGUN),
            i if u16::from(i) < SIZE => {
                (start + u16::from(i), self.bytes.get(usize::from(i)).copied().unwrap_or(0))
            }
            i if u16::from(i) == SIZE => (start, record::VALID),
            _ => return None,
        })
    }

    /// Whether the memory cannot take the next byte yet; after the last byte, whether the memory is busy.
    #[inline(always)]
    pub fn waits<M: Memory>(&self, memory: &M) -> bool {
        match self.next() {
            Some((at, _)) => !memory.takes(at),
            None => memory.is_busy(),
        }
    }

    /// Begins to write the next byte; `false` if all bytes are written. Not while the write [`waits`](Self::waits).
    pub fn step<M: Memory>(&mut self, memory: &mut M) -> bool {
        let Some((at, byte)) = self.next() else { return false };
        self.done += 1;
        // A byte that already has its value is not written, which saves time and wear.
        if memory.read(at) != byte {
            memory.write(at, byte);
        }
        true
    }
}

/// A walk over the used slots from the newest to the oldest. It counts in addresses, which saves a multiplication per
/// slot.
struct Backwards {
    /// The start of the slot visited last.
    at: u16,
    left: u16,
    /// The end of the last used slot.
    end: u16,
}

#[small]
impl Backwards {
    /// Returns the start of the next slot whose key may be one of the wanted keys, and that key; `None` at the end of
    /// the walk.
    #[inline(never)]
    fn next<M: Memory>(&mut self, memory: &M, sought: Common) -> Option<(u16, u16)> {
        let (mut at, mut left) = (self.at, self.left);
        while left > 0 {
            left -= 1;
            // The slot before the first one is the last used one.
            at = if at == 0 { self.end } else { at } - SIZE;
            let key = key_at(memory, at);
            if sought.may_have(key) {
                (self.at, self.left) = (at, left);
                return Some((at, key));
            }
        }
        self.left = 0;
        None
    }
}

/// The bits that all wanted keys have in common. Comparing them rules out most other keys at once.
#[derive(Clone, Copy)]
struct Common {
    mask: u16,
    bits: u16,
}

#[small]
impl Common {
    fn of(keys: &[u16]) -> Self {
        let first = keys.first().copied().unwrap_or(0);
        let mask = !keys.iter().fold(0, |differ, key| differ | (key ^ first));
        Self { mask, bits: first & mask }
    }

    fn may_have(self, key: u16) -> bool {
        key & self.mask == self.bits
    }
}

/// Whether one record number is newer than another. Holds for numbers less than 32,768 records apart.
#[small]
fn is_after(number: u16, other: u16) -> bool {
    number.wrapping_sub(other) as i16 > 0
}

/// Returns the key in the slot that begins there. The slot need not hold a valid record.
#[inline(always)]
#[small]
fn key_at<M: Memory>(memory: &M, start: u16) -> u16 {
    u16::from_le_bytes([memory.read_here(start + 1), memory.read_here(start + 2)])
}

#[small]
fn read<M: Memory>(memory: &M, slot: u16) -> Option<Record> {
    let start = slot * SIZE;
    if memory.read(start) != record::VALID {
        return None;
    }
    let mut bytes = [0; SIZE as usize];
    for (at, byte) in (start..).zip(&mut bytes) {
        *byte = memory.read(at);
    }
    Record::of(&bytes)
}

#[cfg(test)]
mod tests;
