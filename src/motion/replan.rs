//! The keys of what is queued, worked out anew for other overrides.
//!
//! Called by the planner when the factors that are wanted are not those of the keys. Blocks and their
//! potentials stay as they are: corners are stored whatever the feeds. From the newest line to the oldest, a
//! key is kept if it is lower than all behind it, and a limit for whoever comes from the line before. Exec goes
//! on by the old keys until the new ones are put in their place, all at once.
//!
//! Cost on AVR: 300 cycles a line where the feed is steady, 1,500 at a corner; exec waits for 60 a block and 250
//! a key.

use super::block::{Action, Block, Body, Line};
use super::factors::Factors;
use super::horizon::{self, kappa};
use super::queue::{BLOCKS, BlockQueue, FIRM, SEQ};
use super::short::Short;
use crate::hal::imp::exec;

/// A bit for each block, the newest first.
struct Marks([u8; BLOCKS.div_ceil(8)]);

#[small]
impl Marks {
    fn set(&mut self, back: usize) {
        if let Some(byte) = self.0.get_mut(back / 8) {
            *byte |= 1 << (back % 8);
        }
    }

    fn has(&self, back: usize) -> bool {
        self.0.get(back / 8).is_some_and(|byte| byte & 1 << (back % 8) != 0)
    }
}

#[small]
impl BlockQueue {
    /// The overrides that are wanted, if the keys are for others. Cost: 60.
    pub fn wanted(&self) -> Option<Factors> {
        let wanted = exec::lock(|ceiling| self.store.with_horizon(ceiling, |h| h.wanted));
        (!wanted.same(&self.factors)).then_some(wanted)
    }

    /// Makes the keys anew, for these overrides.
    #[inline(never)]
    pub fn replan(&mut self, factors: Factors) {
        self.factors = factors;
        let mut marks = Marks([0; _]);
        let mut least = f32::MAX;
        for back in 0..self.ring.used() {
            if self.mark(back, &mut least) {
                marks.set(back);
            }
        }
        if let (Some(last), Some(line)) = (&mut self.last, line(self.ring.pushed(0))) {
            last.cruise = line.velocity(&factors);
            last.high = last.cruise;
        }
        self.install(&marks);
    }

    /// Whether the line that has been pushed so many before the newest needs a key, all behind it having none
    /// lower than `least`.
    #[inline(never)]
    fn mark(&self, back: usize, least: &mut f32) -> bool {
        let Some(this) = line(self.ring.pushed(back)) else { return false };
        let before = self.before(back);
        if let Some(before) = before {
            if is_firm(this, before) {
                let kappa = kappa(before.accel.get(), before.jerk.get());
                *least = this.start + horizon::key(this.entry(&self.factors), kappa);
                return true;
            }
            let entry = this.entry(&self.factors).to_bits();
            if entry >= before.velocity(&self.factors).to_bits() {
                return false;
            }
        }
        let key = this.key(&self.factors);
        let needed = key < *least;
        if needed {
            *least = key;
        }
        needed
    }

    /// The line before the one that has been pushed so many before the newest, if it is in the queue still.
    fn before(&self, back: usize) -> Option<&Line> {
        let mut back = back + 1;
        while let Some(Block { body: Body::Action(Action::Override(_)), .. }) =
            self.ring.pushed(back)
        {
            back += 1;
        }
        line(self.ring.pushed(back))
    }

    /// Puts the keys that are marked in the place of those that there are.
    #[inline(never)]
    fn install(&self, marks: &Marks) {
        exec::lock(|ceiling| {
            self.store.with_horizon(ceiling, |horizon| {
                let first = horizon.nth(0);
                horizon.clear();
                let used = self.ring.used();
                for back in (0..used).rev().filter(|back| marks.has(*back)) {
                    let seq = self.newest.wrapping_sub(back as u8) & SEQ;
                    // What has begun has no key any more.
                    if back + 1 == used && first.is_none_or(|first| first & SEQ != seq) {
                        continue;
                    }
                    let firm = match (line(self.ring.pushed(back)), self.before(back)) {
                        (Some(this), Some(before)) => is_firm(this, before),
                        _ => false,
                    };
                    horizon.add(if firm { seq | FIRM } else { seq });
                }
                horizon.planned = self.factors;
                horizon.changed = true;
                horizon.version = horizon.version.wrapping_add(1);
            });
        });
    }
}

/// The line that a block is.
#[small]
fn line(block: Option<&Block>) -> Option<&Line> {
    match block {
        Some(Block { body: Body::Line(line), .. }) => Some(line),
        _ => None,
    }
}

/// Whether jerk limits change between two lines.
#[small]
fn is_firm(line: &Line, before: &Line) -> bool {
    let limits = |line: &Line| (line.accel, line.jerk);
    limits(line) != limits(before) && (line.jerk != Short::ZERO || before.jerk != Short::ZERO)
}
