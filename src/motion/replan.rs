//! Computes the keys of all queued lines again, after an override has changed.
//!
//! Called by the planner when the requested factors differ from those of the keys. Blocks and their potentials do not
//! change, because corners are stored independently of feeds. A backward pass goes from the newest line to the oldest.
//! A key is kept if it is lower than all keys after it, and limits the line before it by more than a thousandth. Exec
//! uses the old keys until all new ones replace them at once. The new keys are made on the stack, so that exec waits
//! only for a copy.
//!
//! Cost on AVR: 800 cycles a line where the feed is steady, 2,000 at a corner that limits. For a full queue 52,000, or
//! 127,000 if each line is a corner. Exec waits for 2,000 of these cycles.

use super::block::{Block, Body, Line};
use super::factors::{Factors, Reserve};
use super::float::{below, least};
use super::queue::{BlockQueue, SEQ};
use super::short::Short;
use super::speed_constraints::Keys;
use super::tail::WORTH;
use crate::hal::exec;
use crate::hal::ring::Index;

/// The requirements of the lines that follow a line.
struct Behind {
    /// The least key.
    key: f32,
    /// The lowest velocity of the lines up to the next place that may need a key.
    low: f32,
    /// By how much `key` has been raised because potentials of older lines are higher.
    left_out: f32,
    known: Known,
}

/// A cache: the velocity of the last line. The next line mostly has an equal one.
#[derive(Default)]
struct Known {
    cruise: f32,
    reserve: Reserve,
    velocity: f32,
}

impl Behind {
    /// Takes into account that potentials of the next line are `left_out` higher than at the end of the queue.
    fn count_from(&mut self, left_out: f32) {
        if left_out.to_bits() != self.left_out.to_bits() {
            self.key += left_out - self.left_out;
            self.left_out = left_out;
        }
    }

    /// Whether `this` line needs a key. The line follows `before` without a stop; if `before` is `None`, it begins at a
    /// standstill.
    #[inline(never)]
    fn needs_key(&mut self, this: &Line, before: Option<&Line>, factors: &Factors) -> bool {
        let velocity = self.known.velocity(this, factors);
        let low = least(self.low, velocity);
        let entry = least(velocity, this.entry.get());
        if let Some(before) = before {
            let pace = self.known.velocity(before, factors);
            let most = least(low, entry);
            if !below(most, pace) || most >= pace * WORTH {
                self.low = low;
                return false;
            }
        }
        self.low = f32::MAX;
        let entry = Short::new(entry).get();
        let key = this.start + entry * entry;
        if key >= self.key {
            return false;
        }
        self.key = key;
        true
    }
}

#[small]
impl Known {
    fn velocity(&mut self, line: &Line, factors: &Factors) -> f32 {
        if line.cruise.to_bits() != self.cruise.to_bits() || line.reserve != self.reserve {
            (self.cruise, self.reserve) = (line.cruise, line.reserve);
            self.velocity = line.velocity(factors);
        }
        self.velocity
    }
}

#[small]
impl BlockQueue {
    /// Returns the requested overrides if the keys are for other ones; else `None`. Cost: 60.
    pub fn wanted(&self) -> Option<Factors> {
        let wanted =
            exec::lock(self.thread, |ceiling| self.constraints.with(ceiling, |h| h.wanted));
        (!wanted.same(&self.tail.factors)).then_some(wanted)
    }

    /// Computes all keys again, for these overrides.
    #[inline(never)]
    pub fn replan(&mut self, factors: Factors) {
        self.tail.factors = factors;
        let mut keys = Keys::none();
        self.look_back(&mut keys);
        if let (Some(last), Some(line)) = (&mut self.tail.last, line(self.ring.pushed(0))) {
            last.cruise = line.velocity(&factors);
            last.high = last.cruise;
        }
        self.install(&keys);
    }

    /// Makes the keys, from the newest line to the oldest.
    #[inline(never)]
    fn look_back(&self, keys: &mut Keys) {
        let mut behind =
            Behind { key: f32::MAX, low: f32::MAX, left_out: 0.0, known: Known::default() };
        let mut last: Option<(usize, &Line)> = None;
        let next = self.newest.wrapping_add(1) & SEQ;
        let older =
            exec::lock(self.thread, |ceiling| self.constraints.with(ceiling, |h| h.older(next)));
        for back in 0..=self.ring.used() {
            let block = self.ring.pushed(back);
            if is_aside(block) {
                continue;
            }
            let before = line(block);
            if let Some((back, this)) = last {
                behind.count_from(older.of(back as Index));
                if behind.needs_key(this, before, &self.tail.factors) {
                    keys.add_before(self.newest.wrapping_sub(back as Index) & SEQ);
                }
            }
            last = before.map(|line| (back, line));
        }
    }

    /// Replaces the present keys.
    #[inline(never)]
    fn install(&self, keys: &Keys) {
        exec::lock(self.thread, |ceiling| {
            let (used, factors) = (self.ring.used() as Index, self.tail.factors);
            let oldest = self.newest.wrapping_sub(used).wrapping_add(1) & SEQ;
            self.constraints.with(ceiling, |constraints| {
                // Keys of lines that have begun, or have been run meanwhile, are dropped.
                let begun = constraints.nth(0).is_none_or(|first| first & SEQ != oldest);
                constraints.replace(keys);
                while let Some(first) = constraints.nth(0) {
                    let place = (first & SEQ).wrapping_sub(oldest) & SEQ;
                    if place < used && !(begun && place == 0) {
                        break;
                    }
                    constraints.pass();
                }
                constraints.planned = factors;
                constraints.changed = true;
                constraints.version = constraints.version.wrapping_add(1);
            });
        });
    }
}

/// Whether a block is an action that does not stop the machine.
#[small]
fn is_aside(block: Option<&Block>) -> bool {
    block.is_some_and(Block::is_aside)
}

/// Returns the line in a block; `None` if it is not a line.
#[small]
fn line(block: Option<&Block>) -> Option<&Line> {
    match block {
        Some(Block { body: Body::Line(line), .. }) => Some(line),
        _ => None,
    }
}
