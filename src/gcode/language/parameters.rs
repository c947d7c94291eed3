//! The parameters that programs assign: by number and by name.
//!
//! They last until power-off. The stores have fixed sizes: a line that needs more is refused with
//! [`Status::ParametersFull`] before anything on it is done. A numbered parameter that is 0 takes no room, because one
//! that was never assigned is 0 as well.
//!
//! Cost: a number is found in 10 steps, a name by looking at each. To add a number moves those above it.

use super::text::Name;
use crate::status::Status;

/// The highest number of a parameter.
pub const NUMBER_MAX: u16 = 5_601;
/// The numbers up to this one have a place of their own. They are the arguments of subroutines.
pub const ARGUMENTS: usize = 30;
/// How many parameters with higher numbers may be other than 0.
pub const NUMBERED: usize = 256;
/// Places that are kept free for those that a probing sets.
const RESERVED: usize = 10;
const PLACES: usize = NUMBERED + RESERVED;
/// How many named parameters there may be.
pub const NAMED: usize = 64;
/// Bytes for all names.
pub const NAMES: usize = 768;

/// The parameters with numbers.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Numbered {
    arguments: [f64; ARGUMENTS],
    /// The numbers of the parameters that are not 0, in ascending order.
    numbers: [u16; PLACES],
    values: [f64; PLACES],
    count: u16,
}

impl Numbered {
    /// Parameters that are all 0.
    pub const NONE: Self =
        Self { arguments: [0.0; ARGUMENTS], numbers: [0; PLACES], values: [0.0; PLACES], count: 0 };

    /// Returns the value of a parameter.
    pub fn get(&self, number: u16) -> f64 {
        if let Some(value) = self.arguments.get(usize::from(number).wrapping_sub(1)) {
            return *value;
        }
        self.find(number).ok().and_then(|at| self.values.get(at)).copied().unwrap_or(0.0)
    }

    /// Returns how many more parameters lines may make other than 0.
    pub fn room(&self) -> usize {
        NUMBERED.saturating_sub(self.count.into())
    }

    /// Returns the arguments.
    fn arguments(&mut self) -> &mut [f64; ARGUMENTS] {
        &mut self.arguments
    }

    /// Whether a parameter has no place yet.
    pub fn lacks(&self, number: u16) -> bool {
        usize::from(number) > ARGUMENTS && self.find(number).is_err()
    }

    /// Sets a parameter. The caller has made sure that there is [room](Self::room), or sets one after a probing.
    pub fn set(&mut self, number: u16, value: f64) {
        if let Some(argument) = self.arguments.get_mut(usize::from(number).wrapping_sub(1)) {
            *argument = value;
            return;
        }
        match self.find(number) {
            Ok(at) if value == 0.0 => self.remove(at),
            Ok(at) => self.put(at, number, value),
            Err(_) if value == 0.0 || usize::from(self.count) == PLACES => {}
            Err(at) => {
                let count = usize::from(self.count);
                self.numbers.copy_within(at..count, at + 1);
                self.values.copy_within(at..count, at + 1);
                self.count += 1;
                self.put(at, number, value);
            }
        }
    }

    fn put(&mut self, at: usize, number: u16, value: f64) {
        if let (Some(n), Some(v)) = (self.numbers.get_mut(at), self.values.get_mut(at)) {
            (*n, *v) = (number, value);
        }
    }

    fn remove(&mut self, at: usize) {
        let count = usize::from(self.count);
        self.numbers.copy_within(at + 1..count, at);
        self.values.copy_within(at + 1..count, at);
        self.count -= 1;
        // What is not in use is always the same, so that equal parameters compare as equal.
        self.put(count - 1, 0, 0.0);
    }

    /// Returns the place of a number, or the place where it belongs.
    fn find(&self, number: u16) -> Result<usize, usize> {
        self.numbers.get(..self.count.into()).unwrap_or_default().binary_search(&number)
    }
}

/// How many arguments of callers that are not 0 may be kept.
const SAVED: usize = 96;

/// The arguments of callers, those that are not 0.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Saved {
    /// The level of calls, and the place of the argument.
    of: [(u8, u8); SAVED],
    values: [f64; SAVED],
    count: u8,
}

impl Saved {
    /// No arguments.
    pub const NONE: Self = Self { of: [(0, 0); SAVED], values: [0.0; SAVED], count: 0 };

    /// Checks that there is room for the arguments.
    pub fn check_room(&self, numbered: &Numbered) -> Result<(), Status> {
        let more = numbered.arguments.iter().filter(|value| **value != 0.0).count();
        if usize::from(self.count) + more > SAVED { Err(Status::FlowTooDeep) } else { Ok(()) }
    }

    /// Takes the arguments, so that all are 0. The caller has [checked](Self::check_room) the room. `level` is that of
    /// the call.
    pub fn save(&mut self, numbered: &mut Numbered, level: u8) {
        for (at, value) in numbered.arguments().iter_mut().enumerate() {
            let count = usize::from(self.count);
            if *value != 0.0
                && let (Some(of), Some(kept)) = (self.of.get_mut(count), self.values.get_mut(count))
            {
                (*of, *kept) = ((level, at as u8), *value);
                self.count += 1;
            }
            *value = 0.0;
        }
    }

    /// Gives the arguments back that a call of this level has taken.
    pub fn restore(&mut self, numbered: &mut Numbered, level: u8) {
        *numbered.arguments() = [0.0; ARGUMENTS];
        while let Some(last) = usize::from(self.count).checked_sub(1)
            && let (Some(of), Some(kept)) = (self.of.get_mut(last), self.values.get_mut(last))
            && of.0 == level
        {
            if let Some(value) = numbered.arguments().get_mut(usize::from(of.1)) {
                *value = *kept;
            }
            (*of, *kept) = ((0, 0), 0.0);
            self.count -= 1;
        }
    }
}

/// A named parameter.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Entry {
    /// Where in the text of all names its name begins.
    start: u16,
    length: u8,
    /// The level of calls that knows it. Globals are of level 0.
    level: u8,
    value: f64,
}

impl Entry {
    /// In places that are not in use.
    const NONE: Self = Self { start: 0, length: 0, level: 0, value: 0.0 };
}

/// The parameters with names.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Named {
    entries: [Entry; NAMED],
    count: u8,
    text: [u8; NAMES],
    used: u16,
    /// The level of calls.
    level: u8,
}

impl Named {
    /// No parameters.
    pub const NONE: Self =
        Self { entries: [Entry::NONE; NAMED], count: 0, text: [0; NAMES], used: 0, level: 0 };

    /// Returns the value of a parameter.
    pub fn get(&self, name: Name) -> Option<f64> {
        self.find(name).and_then(|at| self.entries.get(at)).map(|entry| entry.value)
    }

    /// Checks that there is room for new parameters.
    pub fn check_room(&self, names: impl Iterator<Item = usize>) -> Result<(), Status> {
        let (mut count, mut used) = (usize::from(self.count), usize::from(self.used));
        for length in names {
            (count, used) = (count + 1, used + length);
        }
        if count > NAMED || used > NAMES { Err(Status::ParametersFull) } else { Ok(()) }
    }

    /// Sets a parameter. The caller has [made sure](Self::check_room) that there is room.
    pub fn set(&mut self, name: Name, value: f64) {
        let at = self.find(name).or_else(|| self.add(name));
        if let Some(entry) = at.and_then(|at| self.entries.get_mut(at)) {
            entry.value = value;
        }
    }

    fn find(&self, name: Name) -> Option<usize> {
        let entries = self.entries.get(..self.count.into()).unwrap_or_default();
        let level = self.level_of(name);
        let is = |entry: &Entry| {
            entry.level == level && name.bytes().eq(self.text_of(entry).iter().copied())
        };
        entries.iter().position(is)
    }

    fn level_of(&self, name: Name) -> u8 {
        if name.is_global() { 0 } else { self.level }
    }

    /// Begins a call, which knows no local parameters yet.
    pub fn enter(&mut self) {
        self.level += 1;
    }

    /// Ends a call: its local parameters go.
    pub fn leave(&mut self) {
        let Self { entries, count, text, used, level } = self;
        let mut at = 0;
        while let Some(entry) = entries.get(at).copied().filter(|_| at < usize::from(*count)) {
            if entry.level != *level {
                at += 1;
                continue;
            }
            let (start, length) = (usize::from(entry.start), usize::from(entry.length));
            text.copy_within(start + length..usize::from(*used), start);
            *used -= u16::from(entry.length);
            if let Some(free) = text.get_mut(usize::from(*used)..usize::from(*used) + length) {
                free.fill(0);
            }
            entries.copy_within(at + 1..usize::from(*count), at);
            *count -= 1;
            if let Some(last) = entries.get_mut(usize::from(*count)) {
                *last = Entry::NONE;
            }
            let behind = entries.iter_mut().take(usize::from(*count)).skip(at);
            behind.for_each(|entry| entry.start -= length as u16);
        }
        *level = level.saturating_sub(1);
    }

    fn text_of(&self, entry: &Entry) -> &[u8] {
        let start = usize::from(entry.start);
        self.text.get(start..start + usize::from(entry.length)).unwrap_or_default()
    }

    /// Adds a parameter. Returns its place; `None` if there is no room.
    fn add(&mut self, name: Name) -> Option<usize> {
        let (at, start) = (usize::from(self.count), self.used);
        let mut end = start;
        for byte in name.bytes() {
            *self.text.get_mut(usize::from(end))? = byte;
            end += 1;
        }
        let length = u8::try_from(end - start).ok()?;
        *self.entries.get_mut(at)? =
            Entry { start, length, level: self.level_of(name), value: 0.0 };
        (self.count, self.used) = (self.count + 1, end);
        Some(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::boxed::Box;
    use std::collections::BTreeMap;

    #[test]
    fn numbers_keep_their_values_in_any_order() {
        let (mut numbered, mut model) = (Box::new(Numbered::NONE), BTreeMap::new());
        let mut number = 7u32;
        for n in 0..5_000u32 {
            number = number * 1_103 % 5_601;
            let value = if n % 3 == 0 { 0.0 } else { f64::from(n) };
            let at = number as u16 % 256 + 1;
            numbered.set(at, value);
            model.insert(at, value);
        }
        for at in 1..=NUMBER_MAX {
            assert_eq!(numbered.get(at), model.get(&at).copied().unwrap_or(0.0), "{at}");
        }
        for at in 1..=NUMBER_MAX {
            numbered.set(at, 0.0);
        }
        assert_eq!(*numbered, Numbered::NONE);
    }

    #[test]
    fn a_full_store_keeps_what_it_has() {
        let mut numbered = Box::new(Numbered::NONE);
        for number in 31..31 + PLACES as u16 {
            numbered.set(number, 1.0);
        }
        assert_eq!(numbered.room(), 0);
        numbered.set(5_000, 1.0);
        assert_eq!((numbered.get(5_000), numbered.get(296)), (0.0, 1.0));
        numbered.set(290, 2.0);
        assert_eq!(numbered.get(290), 2.0);
    }

    #[test]
    fn names_ignore_case_and_blanks() {
        let mut named = Box::new(Named::NONE);
        named.set(Name(b"P a R am"), 3.0);
        named.set(Name(b"_G"), 4.0);
        assert_eq!(named.get(Name(b"param")), Some(3.0));
        assert_eq!(named.get(Name(b" _ g ")), Some(4.0));
        assert_eq!(named.get(Name(b"para")), None);
        assert!(named.check_room([NAMES].into_iter()).is_err());
    }
}
