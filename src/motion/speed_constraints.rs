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
//! **Lowest keys.** Keys that come after a lower one matter once the lower one has been passed; keys that come before a
//! lower one never matter. So [`SpeedConstraints`] keeps a list of rising keys ([`SpeedConstraints::seqs`]). Adding a
//! key drops the keys at the list's end that are not below it; passing a block drops its key at the front. Each key is
//! added once and dropped once. A block that adds no limit (equal feed, no corner) needs no entry.
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
use super::queue::{BLOCKS, SEQ};
use super::short::Short;
use crate::hal::ring::Index;

impl Line {
    /// Returns the highest velocity at the start of the line, mm/s.
    #[inline(always)]
    pub fn entry(&self, factors: &Factors) -> f32 {
        Short::new(least(self.entry.get(), self.velocity(factors))).get()
    }

    /// Returns the key of the line: the highest sum of potential and square of velocity before its start. Cost: 400.
    pub fn key(&self, factors: &Factors) -> f32 {
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
        let speed = scaled(self.cruise, 1);
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
}

impl SpeedConstraints {
    /// The speed constraints of an empty queue.
    pub const fn new() -> Self {
        // All zero, so that the initial value takes no room in flash. `begin` is called first.
        let none = Factors { feed: 0.0, traverse: 0.0 };
        let (wanted, planned) = (none, none);
        Self {
            seqs: [0; BLOCKS],
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

    /// Adds the key of a block, which is above all other keys.
    pub fn add(&mut self, seq: Index) {
        if usize::from(self.len) < BLOCKS {
            let slot = self.slot(self.len);
            self.seqs[slot] = seq;
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
        self.seqs = keys.seqs;
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
}

impl Keys {
    /// No keys.
    pub const fn none() -> Self {
        Self { front: BLOCKS as Index, seqs: [0; BLOCKS] }
    }

    /// Adds the key of a block that comes before all other keys, if there is room.
    pub fn add_before(&mut self, seq: Index) {
        let front = usize::from(self.front.wrapping_sub(1));
        if let Some(to) = self.seqs.get_mut(front) {
            *to = seq;
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
