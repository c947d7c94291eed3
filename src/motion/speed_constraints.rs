//! Look-ahead: limits the velocity so that the machine can always slow down in time.
//!
//! Owned by the block queue: the planner adds a constraint as it pushes a block, and exec reads the constraints.
//!
//! **Brake potential.** Braking at the acceleration limit A changes v^2 by 2 A for each mm. So let the potential P of a
//! point be the sum of 2 A l over all lines of the path before it. From P with velocity v the machine can slow down to
//! velocity w at a later point with potential Q if
//!
//! ```text
//! v^2 + P <= w^2 + Q  =: key
//! ```
//!
//! whatever blocks lie between, each with its own A. A corner is a point with a key. Of all keys ahead only the lowest
//! applies, and it applies to all blocks before it: adding a block needs no backward pass over the queue. The end of
//! the queue has a key too, with w = 0.
//!
//! **With a jerk limit** J the deceleration takes A/J to build up and A/J to end, which takes additional distance
//! (`constraint` says how much). With k = A^2 / 2J the distance is sufficient if
//!
//! ```text
//! (v + k)^2 + P <= (w - k)^2 + Q  =: key        k^2 + Q if w < 2 k
//! ```
//!
//! A machine that can slow down for the lower of two such keys is below the velocity of the other key at its place. So
//! a lower key makes a higher one before it needless with a jerk limit too. But exec has to find out which of the
//! remaining keys is binding: it scans from the nearest one to the first before which it could stop. Without a jerk
//! limit k is 0, and the first key is binding.
//!
//! **Lowest keys.** Keys that come after a lower one matter once the lower one has been passed; keys that come before a
//! lower one never matter. So [`SpeedConstraints`] keeps a list of rising keys ([`SpeedConstraints::seqs`]). Adding a
//! key drops the keys at the list's end that are not below it; passing a block drops its key at the front. Each key is
//! added once and dropped once. A block that adds no limit (equal feed, no corner) needs no entry.
//!
//! Where jerk limits change, k changes, and keys before and after cannot be compared. The key of such a place is
//! *firm*: no lower key drops it, and no scan goes beyond it. It is computed with the k of the line before. The line
//! that begins there must be able to stop within its own length.
//!
//! **Overrides.** The velocity at a corner is the lesser of what the corner allows and of what the feeds allow times a
//! factor ([`Line::entry`]). Which keys are needless depends on the factor, so all keys are computed again when it
//! changes (`replan`). For corners, a key that is needless at one factor is needless at every lesser factor. So a
//! lesser factor applies at once; until the keys have been computed, only a slow line after a fast one may be entered
//! at more than its part of the feed. A greater factor waits for the keys.
//!
//! Potentials grow without limit. When they are so large that floats would be too coarse for a line, they are counted
//! from zero again from that line on ([`SpeedConstraints::count_anew`]). Until exec has reached that place, the
//! difference is added ([`SpeedConstraints::lifted`]) where potentials of both sides are compared. Only one such place
//! is in the queue at a time. So floats may be coarse for a slow line after fast lines that follow that place: the
//! velocity at its end may be wrong by some 0.1 % of theirs.
//!
//! Cost: a push 1,000 cycles, and 700 for each key dropped.

use super::block::Line;
use super::factors::{Factors, Reserve};
use super::float::{OCTAVE, brief_product, least, lesser, log, scaled, some};
use super::queue::{BLOCKS, FIRM, SEQ};
use super::short::Short;
use crate::hal::arithmetic;
use crate::hal::ring::Index;

// `arithmetic::passed_over` ends at a key with this bit.
const _: () = assert!(FIRM == 1 << (Index::BITS - 1));

/// Returns half the velocity that is lost while an acceleration limit builds up under a jerk limit: `A^2 / 2J`, 0
/// without one. Cost: 650.
pub fn kappa(accel: f32, jerk: f32) -> f32 {
    if some(jerk) { 0.5 * accel * accel / jerk } else { 0.0 }
}

/// Returns the part of a key that does not depend on the place, for velocity `w`. Cost: 400.
pub fn key(w: f32, kappa: f32) -> f32 {
    if !some(kappa) {
        return w * w;
    }
    let kept = if w < kappa + kappa { kappa } else { w - kappa };
    kept * kept
}

impl Line {
    /// Returns the highest velocity at the start of the line, mm/s.
    #[inline(always)]
    pub fn entry(&self, factors: &Factors) -> f32 {
        Short::new(least(self.entry.get(), self.velocity(factors))).get()
    }

    /// Returns the key of the line: the highest sum of potential and square of velocity before its start. Cost: 500,
    /// 1,300 with a jerk limit.
    pub fn key(&self, factors: &Factors) -> f32 {
        self.start + key(self.entry(factors), kappa(self.accel.get(), self.jerk.get()))
    }

    /// Returns the key of the line for a block before it that has no jerk limit. Cost: 400.
    pub fn sharp_key(&self, factors: &Factors) -> f32 {
        let entry = self.entry(factors);
        self.start + entry * entry
    }

    /// Returns how much potential the line has, (mm/s)^2. The value is capped at several times the square of the
    /// highest velocity that an override gives the line; more makes no difference. Cost: 160.
    #[inline(never)]
    pub fn gain(&self) -> f32 {
        let full = brief_product(scaled(self.accel.get(), 1), self.extent.length());
        // Certainly below the square of its velocity, as in short blocks.
        if log(full) + OCTAVE < 2 * log(self.cruise) { full } else { self.capped(full) }
    }

    #[inline(never)]
    fn capped(&self, full: f32) -> f32 {
        let speed = scaled(self.cruise, 1) + 2.0 * kappa(self.accel.get(), self.jerk.get());
        lesser(full, 2.0 * speed * speed)
    }
}

/// Keys of blocks in the queue, lowest first, which is nearest first too.
#[derive(Debug)]
#[repr(C)]
pub struct SpeedConstraints {
    // The most used fields come first: the CPU reaches 64 bytes from a pointer.
    front: Index,
    len: Index,
    /// Potential at the end of the newest block.
    pub end: f32,
    /// Potentials are counted from zero again from this block on. `left_out` is 0 if no block before it is left.
    anew: Index,
    /// The potential that is left out from `anew` on.
    left_out: f32,
    /// A number that changes with every push, and with the factors.
    pub version: u8,
    /// The requested overrides.
    pub wanted: Factors,
    /// Whether the requested or the planned overrides have changed since exec's last check.
    pub changed: bool,
    /// The overrides that the keys are made for, or greater ones: nothing may run faster than by these factors.
    pub planned: Factors,
    /// Sequence numbers of blocks with rising keys: a ring.
    seqs: [Index; BLOCKS],
    /// The velocity at which each of these blocks may be entered, with the factors that the keys are made for:
    /// [`Short::bits`].
    entries: [u16; BLOCKS],
}

impl SpeedConstraints {
    /// The speed constraints of an empty queue.
    pub const fn new() -> Self {
        // All zero, so that the initial value takes no room in flash. `begin` is called first.
        let none = Factors { feed: 0.0, traverse: 0.0 };
        let (wanted, planned) = (none, none);
        Self {
            seqs: [0; BLOCKS],
            entries: [0; BLOCKS],
            front: 0,
            len: 0,
            end: 0.0,
            anew: 0,
            left_out: 0.0,
            version: 0,
            wanted,
            changed: false,
            planned,
        }
    }

    /// Returns the block with the `n`th key; `None` if there are fewer keys.
    #[inline]
    pub fn nth(&self, n: Index) -> Option<Index> {
        (n < self.len).then(|| self.seqs[self.slot(n)])
    }

    /// Returns the block of a key near the end of the list: `back` 0 is the last key. `None` if there are fewer keys.
    pub fn nth_last(&self, back: Index) -> Option<Index> {
        self.nth(self.len.checked_sub(back)?.wrapping_sub(1))
    }

    /// Drops the last `count` keys, or all if there are fewer.
    pub fn drop_last(&mut self, count: Index) {
        self.len = self.len.saturating_sub(count);
    }

    /// Returns the velocity of the `n`th key.
    #[inline]
    pub fn entry(&self, n: Index) -> Short {
        Short::of_bits(self.entries[self.slot(n)])
    }

    /// Returns the number of the first key from the `n`th on that is slower than `velocity`, or firm; one more than
    /// the last if there is none. Cost: 110, and 14 for each key that is passed over.
    #[inline(never)]
    pub fn slower(&self, n: Index, velocity: Short) -> Index {
        let left = self.len.saturating_sub(n);
        let slot = self.slot(n) as Index;
        let before_end = left.min((BLOCKS as Index).saturating_sub(slot));
        let passed = self.passed_over(slot, before_end, velocity);
        if passed < before_end || before_end == left {
            return n + passed;
        }
        // The list continues at the beginning of the ring.
        n + passed + self.passed_over(0, left - before_end, velocity)
    }

    /// Returns how many of `count` keys from a slot on are passed over: until one is slower than `velocity`, or firm.
    #[inline(always)]
    fn passed_over(&self, slot: Index, count: Index, velocity: Short) -> Index {
        let slots = usize::from(slot)..usize::from(slot) + usize::from(count);
        let all = self.seqs.get(slots.clone()).zip(self.entries.get(slots));
        all.map_or(0, |(seqs, entries)| arithmetic::passed_over(seqs, entries, velocity.bits()))
    }

    /// Adds the key of a block, which is above all other keys. The block may be entered at `entry`.
    pub fn add(&mut self, seq: Index, entry: Short) {
        if usize::from(self.len) < BLOCKS {
            let slot = self.slot(self.len);
            self.seqs[slot] = seq;
            self.entries[slot] = entry.bits();
            self.len += 1;
        }
    }

    /// Drops the first key.
    pub fn pass(&mut self) {
        if self.len > 0 {
            self.front = self.slot(1) as Index;
            self.len -= 1;
        }
    }

    /// Counts potentials from zero again from the next block on, `seq`. Does nothing if there is such a place in the
    /// queue already.
    pub fn count_anew(&mut self, seq: Index) {
        if !some(self.left_out) {
            (self.anew, self.left_out, self.end) = (seq, self.end, 0.0);
        }
    }

    /// Notes that block `seq` is the oldest from now on.
    pub fn oldest_is(&mut self, seq: Index) {
        if self.anew == seq {
            self.left_out = 0.0;
        }
    }

    /// Whether there are blocks before the one from which potentials are counted again. Cost: 10.
    #[inline(always)]
    pub fn is_mixed(&self) -> bool {
        some(self.left_out)
    }

    /// Returns a potential at block `seq`, counted as at the `oldest` block. Cost: 150.
    pub fn lifted(&self, potential: f32, seq: Index, oldest: Index) -> f32 {
        let place = |seq: Index| seq.wrapping_sub(oldest) & SEQ;
        if place(seq) >= place(self.anew) { potential + self.left_out } else { potential }
    }

    /// Returns by how much potentials are higher at blocks before the one from which they are counted again. `next` is
    /// the block to be queued next.
    pub fn older(&self, next: Index) -> Older {
        Older { behind: next.wrapping_sub(self.anew) & SEQ, more: self.left_out }
    }

    /// Requests these overrides.
    pub fn want(&mut self, factors: Factors) {
        self.wanted = factors;
        self.changed = true;
        self.version = self.version.wrapping_add(1);
    }

    /// Begins without overrides.
    pub fn begin(&mut self) {
        (self.wanted, self.planned) = (Factors::ONE, Factors::ONE);
    }

    /// Replaces all keys. Cost: 1,500.
    pub fn replace(&mut self, keys: &Keys) {
        (self.seqs, self.entries) = (keys.seqs, keys.entries);
        (self.front, self.len) = (keys.front, BLOCKS as Index - keys.front);
    }

    /// Returns the overrides in force: the requested ones, as far as the keys allow.
    #[inline(always)]
    pub fn factors(&self) -> Factors {
        self.wanted.least(&self.planned)
    }

    /// Returns the factor in force for a line with this reserve.
    #[inline(always)]
    pub fn factor(&self, reserve: Reserve) -> f32 {
        // Computes only one of the two factors, because comparisons take time.
        if reserve == Reserve::TRAVERSE {
            least(self.wanted.traverse, self.planned.traverse)
        } else {
            least(self.wanted.feed, self.planned.feed)
        }
    }

    fn slot(&self, n: Index) -> usize {
        let slot = usize::from(self.front) + usize::from(n);
        if slot >= BLOCKS { slot - BLOCKS } else { slot }
    }
}

/// New keys for the speed constraints, made from the last one to the first.
pub struct Keys {
    front: Index,
    seqs: [Index; BLOCKS],
    entries: [u16; BLOCKS],
}

impl Keys {
    /// No keys.
    pub const fn none() -> Self {
        Self { front: BLOCKS as Index, seqs: [0; BLOCKS], entries: [0; BLOCKS] }
    }

    /// Adds the key of a block that comes before all other keys, if there is room.
    pub fn add_before(&mut self, seq: Index, entry: Short) {
        let front = usize::from(self.front.wrapping_sub(1));
        if let (Some(to), Some(velocity)) = (self.seqs.get_mut(front), self.entries.get_mut(front))
        {
            (*to, *velocity) = (seq, entry.bits());
            self.front = front as Index;
        }
    }
}

/// By how much potentials of older blocks are higher: see [`SpeedConstraints::older`].
#[derive(Clone, Copy)]
pub struct Older {
    /// How many of the newest blocks are counted from zero again.
    behind: Index,
    more: f32,
}

impl Older {
    /// Returns by how much the potential of a block is higher, after which `back` blocks have been queued.
    #[inline(always)]
    pub fn of(&self, back: Index) -> f32 {
        if back >= self.behind { self.more } else { 0.0 }
    }
}

impl Default for SpeedConstraints {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What `slower` is to return, found one key after the other.
    fn expected(constraints: &SpeedConstraints, n: u8, velocity: Short) -> u8 {
        let stops = |n: &u8| {
            constraints.nth(*n).is_some_and(|seq| seq & FIRM != 0)
                || constraints.entry(*n) < velocity
        };
        (n..constraints.len).find(stops).unwrap_or(constraints.len.max(n))
    }

    proptest! {
        #[test]
        fn a_slower_key_is_found_wherever_the_list_lies(
            front in 0..BLOCKS as u8,
            keys in prop::collection::vec((0u8..20, 0u8..30), 0..BLOCKS),
            n in 0..BLOCKS as u8,
            velocity in 0u8..21,
        ) {
            let mut constraints = SpeedConstraints { front, ..SpeedConstraints::new() };
            for (entry, kind) in keys {
                let firm = if kind == 0 { FIRM } else { 0 };
                constraints.add(kind | firm, Short::new(entry.into()));
            }
            let (n, velocity) = (n.min(constraints.len), Short::new(velocity.into()));
            prop_assert_eq!(constraints.slower(n, velocity), expected(&constraints, n, velocity));
        }
    }
}
