//! The lines of a pool in order of arrival: how long each is, and what to do with it.
//!
//! A ring, because the oldest line leaves most often. Owned by the pool. Cost on AVR: 15 cycles to find a line, 30 to
//! add or to remove one.

use super::{Class, SLOTS};

/// The slots of the pool, and the one for control lines that overtake.
const SIZE: usize = SLOTS + 1;

/// A line.
#[derive(Clone, Copy)]
pub struct Entry {
    /// Bytes that are kept.
    pub len: u8,
    pub class: Class,
    /// Bytes that came with the line and are not kept, its end not counted.
    pub besides: u16,
}

/// The lines.
pub struct Entries {
    /// The slot of the oldest line.
    first: u8,
    count: u8,
    slots: [Entry; SIZE],
}

impl Entries {
    pub const fn new() -> Self {
        let none = Entry { len: 0, class: Class::Data, besides: 0 };
        Self { first: 0, count: 0, slots: [none; SIZE] }
    }

    /// How many lines there are.
    pub fn len(&self) -> usize {
        self.count.into()
    }

    /// Whether there are no lines.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns the slot of a line, counted from the oldest.
    #[inline(always)]
    fn slot(&self, index: u8) -> usize {
        let slot = usize::from(self.first) + usize::from(index);
        if slot < SIZE { slot } else { slot - SIZE }
    }

    /// Returns a line, counted from the oldest.
    pub fn get(&self, index: usize) -> Option<&Entry> {
        let is_there = index < self.len();
        self.slots.get(self.slot(index as u8)).filter(|_| is_there)
    }

    /// See [`get`](Self::get).
    pub fn get_mut(&mut self, index: usize) -> Option<&mut Entry> {
        let (is_there, slot) = (index < self.len(), self.slot(index as u8));
        self.slots.get_mut(slot).filter(|_| is_there)
    }

    /// Returns the oldest line.
    pub fn first(&self) -> Option<&Entry> {
        self.get(0)
    }

    /// Returns the newest line.
    pub fn last(&self) -> Option<&Entry> {
        self.get(self.len().wrapping_sub(1))
    }

    /// Returns all lines, the oldest first.
    pub fn iter(&self) -> impl Iterator<Item = &Entry> {
        (0..self.len()).filter_map(|index| self.get(index))
    }

    /// Adds a line. False if there is no room.
    pub fn push(&mut self, entry: Entry) -> bool {
        let has_room = self.len() < SIZE;
        if has_room {
            self.count += 1;
            if let Some(place) = self.get_mut(self.len() - 1) {
                *place = entry;
            }
        }
        has_room
    }

    /// Removes the oldest line and returns it.
    pub fn pop_first(&mut self) -> Option<Entry> {
        let entry = self.first().copied()?;
        self.first = self.slot(1) as u8;
        self.count -= 1;
        Some(entry)
    }

    /// Removes a line. The lines behind it move up.
    pub fn remove(&mut self, index: usize) {
        for to in index..self.len() {
            if let Some(next) = self.get(to + 1).copied()
                && let Some(place) = self.get_mut(to)
            {
                *place = next;
            }
        }
        self.count -= u8::from(index < self.len());
    }
}
