//! The ring of records.
//!
//! Between writes one invariant holds: the slot behind the newest record, the gap, holds nothing of worth. A record
//! goes into the gap. Before that the slot behind the gap, which becomes the next gap, is cleared: if
//! its record is the newest of its item, it is written anew, into the gap. So each write of an item takes one
//! record and as many others as have to make room: one and a half on average while half of the slots count.
//!
//! Cost on AVR: 70 cycles for each slot that was ever used, of 290: up to 26,000 for the newest records of a row of the
//! tables (`tests/sim/tests/interpreter.rs`).

use super::Memory;
use super::record::{self, BEGUN, Record, SIZE};

/// Where the next record goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Log {
    /// The gap.
    gap: u16,
    /// The number of the next record.
    next: u16,
    /// Slots that were ever used: those before this one.
    used: u16,
    /// The log has all of the memory.
    wide: bool,
}

/// A record on its way to memory.
#[derive(Clone, Copy, Debug)]
pub struct Write {
    slot: u16,
    bytes: [u8; SIZE as usize],
    /// Bytes written, with that which clears the mark.
    done: u8,
}

/// What is needed to put an item away.
#[derive(Clone, Copy, Debug)]
pub enum Put {
    /// This record makes room: write it, and ask again.
    Room(Write),
    /// This record is that of the item: write it.
    Last(Write),
    /// Every slot has been moved, so each holds the newest record of some item.
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

    /// Whether memory holds something, but no record: another program's data, or rubbish. Cost on AVR: up to
    /// 100,000 cycles, if it holds nothing.
    pub fn is_rubbish<M: Memory>(&self, memory: &M) -> bool {
        self.is_empty() && (0..M::SIZE).any(|at| memory.read(at) != 0xFF)
    }

    /// The value of an item, if it was ever put away.
    pub fn newest<M: Memory>(&self, memory: &M, key: u16) -> Option<i32> {
        let [value] = self.find(memory, &[key]);
        value
    }

    /// The values of items that were ever put away, in one go.
    pub fn find<M: Memory, const N: usize>(&self, memory: &M, keys: &[u16; N]) -> [Option<i32>; N] {
        let mut values = [None; N];
        let mut missing = N;
        let mut back = Backwards { at: self.gap * SIZE, left: self.used, end: self.used * SIZE };
        let common = Common::of(keys);
        while let Some((at, key)) = back.next(memory, common) {
            let sought = keys.iter().zip(&mut values).find(|(sought, _)| **sought == key);
            if let Some((_, value @ None)) = sought
                && let Some(record) = read(memory, at / SIZE)
            {
                *value = Some(record.value);
                missing -= 1;
                if missing == 0 {
                    break;
                }
            }
        }
        values
    }

    /// Whether nothing was ever put away.
    pub fn is_empty(&self) -> bool {
        self.used == 0
    }

    /// All records from the oldest to the newest.
    pub fn replay<M: Memory>(&self, memory: &M, mut each: impl FnMut(&Record)) {
        // What the gap holds is older than all others.
        let mut slot = self.gap;
        for _ in 0..self.slots::<M>() {
            if let Some(record) = read(memory, slot) {
                each(&record);
            }
            slot = self.behind::<M>(slot);
        }
    }

    /// What to write next to put an item away, after `moved` records have been written to make room for it.
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

    /// Whether it has all of the memory: that of firmware without programs that has come so far.
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
        // Up to the gap are the newer ones.
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
    /// Where the next byte belongs, and the byte; `None` if there is none left.
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

    /// Whether memory does not take the next byte yet; behind the last one, whether it is busy.
    #[inline(always)]
    pub fn waits<M: Memory>(&self, memory: &M) -> bool {
        match self.next() {
            Some((at, _)) => !memory.takes(at),
            None => memory.is_busy(),
        }
    }

    /// Begins to write the next byte; false if there is none left. Not while it [`waits`](Self::waits).
    pub fn step<M: Memory>(&mut self, memory: &mut M) -> bool {
        let Some((at, byte)) = self.next() else { return false };
        self.done += 1;
        // A byte that is right already is spared.
        if memory.read(at) != byte {
            memory.write(at, byte);
        }
        true
    }
}

/// A walk over the slots that were used, from the newest. By addresses, which saves a product for each.
struct Backwards {
    /// Where the slot before begins.
    at: u16,
    left: u16,
    /// Where the last one that was used ends.
    end: u16,
}

#[small]
impl Backwards {
    /// Where the next slot begins whose key may be one of those sought, and that key.
    #[inline(never)]
    fn next<M: Memory>(&mut self, memory: &M, sought: Common) -> Option<(u16, u16)> {
        let (mut at, mut left) = (self.at, self.left);
        while left > 0 {
            left -= 1;
            // Behind the first slot are the last ones that were used.
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

/// The bits that keys have in common: one look tells that most others are none of them.
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

/// Whether one number was given after another, less than 32,768 records apart.
#[small]
fn is_after(number: u16, other: u16) -> bool {
    number.wrapping_sub(other) as i16 > 0
}

/// The key in the slot that begins there, be it that of a record or not.
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
