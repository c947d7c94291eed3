//! The block queue, seen from exec's side: the oldest block, and the velocity limit at its end.
//!
//! Owned by exec, which takes block after block, and reads the constraints ahead whenever the speed constraints have
//! changed. Never waits: the machine must be able to stop at the end of the queue. Units: mm, s; brake potentials as in
//! `speed_constraints`.

use core::cell::Cell;

use avr_embassy::{InterruptEnd, Shared};
use kerf_macros::small;

use super::block::{Block, Body, Line};
use super::factors::{Factors, Reserve};
use super::float::lesser;
use super::queue::{BLOCKS, SEQ};
use super::speed_constraints::SpeedConstraints;
use crate::hal::ring::{Consumer, Index};

/// How many actions in a row [`BlockSource::goes_on`] looks behind.
const ASIDE: usize = 3;

/// Exec's end of the queue.
pub struct BlockSource {
    ring: Consumer<Block, BLOCKS>,
    constraints: InterruptEnd<&'static Shared<SpeedConstraints>>,
    /// Sequence number of the oldest block.
    oldest: Index,
    /// A cache: a version of the speed constraints, and the potential at the end of the oldest block in that version.
    end: Cell<Option<(u8, f32)>>,
}

impl BlockSource {
    /// Takes exec's ends of a store.
    pub(super) fn new(
        ring: Consumer<Block, BLOCKS>,
        constraints: InterruptEnd<&'static Shared<SpeedConstraints>>,
    ) -> Self {
        Self { ring, constraints, oldest: 0, end: Cell::new(None) }
    }

    /// The number of blocks that wait, the running one included.
    pub fn len(&self) -> usize {
        self.ring.len()
    }

    /// A number that changes with each block that is released.
    #[inline(always)]
    pub fn released(&self) -> Index {
        self.oldest
    }

    /// Whether there is no block.
    pub fn is_empty(&self) -> bool {
        self.ring.is_empty()
    }

    /// Returns a copy of the oldest block.
    pub fn oldest(&self) -> Option<Block> {
        self.look(|block| *block)
    }

    /// Whether the oldest block is followed by a line, perhaps behind actions that do not stop the machine:
    /// [`ASIDE`] at most. Cost: 40, and as much for each action.
    #[inline(never)]
    #[small]
    pub fn goes_on(&self) -> bool {
        for ahead in 1..=ASIDE + 1 {
            let kind = |block: &Block| (matches!(block.body, Body::Line(_)), block.is_aside());
            match self.ring.peek(ahead, kind) {
                Some((false, true)) => {}
                next => return next.is_some_and(|(is_line, _)| is_line),
            }
        }
        false
    }

    /// Returns what `look` makes of the oldest block; `None` if there is no block.
    #[inline(always)]
    pub fn look<R>(&self, look: impl FnOnce(&Block) -> R) -> Option<R> {
        self.ring.peek(0, look)
    }

    /// Releases the oldest block, which is done.
    pub fn release(&mut self) {
        if !self.is_empty() {
            self.ring.release();
            self.end.set(None);
            self.oldest = self.oldest.wrapping_add(1) & SEQ;
            let oldest = self.oldest;
            self.constraints.with(|constraints| constraints.oldest_is(oldest));
        }
    }

    /// Begins the oldest block: the key at its start no longer applies.
    pub fn enter(&mut self) {
        let oldest = self.oldest;
        self.constraints.with(|constraints| {
            if constraints.nth(0).is_some_and(|seq| seq & SEQ == oldest) {
                constraints.pass();
            }
        });
    }

    /// A number that changes when the constraints ahead change.
    pub fn version(&self) -> u8 {
        self.constraints.look(|constraints| constraints.version)
    }

    /// Returns the velocity at which the oldest block, a line, is run, mm/s. It changes with the version. Cost: 100.
    #[inline(always)]
    pub fn cruise(&self) -> f32 {
        self.constraints.look(|constraints| {
            self.line(self.oldest, |line| {
                line.reserve.velocity_by(line.cruise, constraints.factor(line.reserve))
            })
            .unwrap_or_default()
        })
    }

    /// Whether the oldest block is a traverse.
    #[small]
    pub fn is_traverse(&self) -> bool {
        self.line(self.oldest, |line| line.reserve == Reserve::TRAVERSE).unwrap_or_default()
    }

    /// Returns the velocity limit of the oldest block, a line, without overrides, mm/s.
    #[small]
    pub fn feed(&self) -> f32 {
        self.line(self.oldest, |line| line.cruise).unwrap_or_default()
    }

    /// Whether overrides have changed since the last call. Cost: 15.
    #[inline(always)]
    pub fn take_changed(&mut self) -> bool {
        self.constraints.with(|constraints| core::mem::take(&mut constraints.changed))
    }

    /// Requests these overrides. The planner computes the keys again if they are for other overrides.
    pub fn want(&mut self, factors: Factors) {
        self.constraints.with(|constraints| constraints.want(factors));
    }

    /// Returns the square of the velocity, (mm/s)^2, that is allowed at the end of the oldest block, a line, so that
    /// all later constraints are met. Cost: 900.
    pub fn headroom(&self) -> f32 {
        let end = self.queue_end();
        let first = self.constraints.look(|constraints| {
            let seq = constraints.nth(0)?;
            let key = self.line(seq, |line| line.key(&constraints.factors()))?;
            Some(self.lifted(seq, key))
        });
        let key = match first {
            // Comparing bits is enough, mostly: both are above 0.
            Some(key) if key.to_bits() < end.to_bits() && !end.is_sign_negative() => key,
            Some(key) => lesser(key, end),
            None => end,
        };
        key - self.end()
    }

    /// Returns the potential at the end of the queue, counted as at the oldest block.
    fn queue_end(&self) -> f32 {
        // The end of the queue has the sequence number before the oldest block.
        self.lifted(
            self.oldest.wrapping_sub(1),
            self.constraints.look(|constraints| constraints.end),
        )
    }

    /// Returns a potential at block `seq`, counted as at the oldest one.
    #[inline(always)]
    fn lifted(&self, seq: Index, potential: f32) -> f32 {
        if self.constraints.look(SpeedConstraints::is_mixed) {
            self.lifted_anew(seq, potential)
        } else {
            potential
        }
    }

    #[inline(never)]
    fn lifted_anew(&self, seq: Index, potential: f32) -> f32 {
        self.constraints.look(|constraints| constraints.lifted(potential, seq, self.oldest))
    }

    /// Returns the potential at the end of the oldest block.
    fn end(&self) -> f32 {
        let version = self.version();
        if let Some((of, end)) = self.end.get()
            && of == version
        {
            return end;
        }
        // The potential where the next block begins, if that is a line.
        let next = self.ring.peek(1, |block| match &block.body {
            Body::Line(line) => Some(line.start),
            _ => None,
        });
        match next {
            Some(Some(start)) if !self.constraints.look(SpeedConstraints::is_mixed) => {
                self.end.set(Some((version, start)));
                start
            }
            _ => self.end_otherwise(version, next.flatten()),
        }
    }

    /// Returns the potential at the end of the oldest block if no line follows, or if a line with this `start`
    /// follows while potentials are counted in two ways. A function of its own, so that [`BlockSource::end`] saves
    /// few registers.
    #[inline(never)]
    #[small]
    fn end_otherwise(&self, version: u8, start: Option<f32>) -> f32 {
        let end = match start {
            Some(start) => self.lifted_anew(self.oldest.wrapping_add(1), start),
            None => self.line(self.oldest, |line| line.start + line.gain()).unwrap_or(0.0),
        };
        self.end.set(Some((version, end)));
        end
    }

    /// Returns what `look` makes of block `seq`; `None` if it is not a line.
    fn line<R: Copy>(&self, seq: Index, look: impl FnOnce(&Line) -> R) -> Option<R> {
        let ahead = usize::from(seq.wrapping_sub(self.oldest) & SEQ);
        self.ring.peek(ahead, |block| match &block.body {
            Body::Line(line) => Some(look(line)),
            _ => None,
        })?
    }
}
