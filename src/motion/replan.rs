//! The keys of what is queued, worked out anew for other overrides.
//!
//! Called by the planner when the factors that are wanted are not those of the keys. Blocks and their
//! potentials stay as they are: corners are stored whatever the feeds. From the newest line to the oldest, a
//! key is kept if it is lower than all behind it, and a limit for whoever comes from the line before, by more than a
//! thousandth. Exec goes on by the old keys until the new ones are put in their place, all at once.
//!
//! Cost on AVR: 800 cycles a line where the feed is steady, 2,000 at a corner that limits; exec waits for 60 a block and
//! 250 a key. All that is queued: 52,000, or 127,000 if each line is a corner.

use super::block::{Action, Block, Body, Line};
use super::factors::{Factors, Reserve};
use super::float::{below, least};
use super::horizon::{self, kappa};
use super::queue::{BLOCKS, BlockQueue, FIRM, SEQ, WORTH};
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

/// What limits a line, of all that is behind it.
struct Behind {
    /// The least key.
    key: f32,
    /// The lowest velocity up to the next place that is worth a key.
    low: f32,
    /// What potentials counted so far have less than those of the line that is asked about.
    left_out: f32,
    known: Known,
}

/// Of the line that was asked about last, which mostly is as the next one: its velocity, and how it brakes.
#[derive(Default)]
struct Known {
    cruise: f32,
    reserve: Reserve,
    velocity: f32,
    limits: (Short, Short),
    kappa: f32,
}

impl Behind {
    /// Potentials of the next line to be asked about have so much more than those at the end of the queue.
    fn count_from(&mut self, left_out: f32) {
        if left_out.to_bits() != self.left_out.to_bits() {
            self.key += left_out - self.left_out;
            self.left_out = left_out;
        }
    }

    /// Whether `this` line needs a key, that follows `before` without a stop.
    #[inline(never)]
    fn needs(&mut self, this: &Line, before: Option<&Line>, factors: &Factors) -> bool {
        let velocity = self.known.velocity(this, factors);
        let low = least(self.low, velocity);
        let entry = least(velocity, this.entry.get());
        let mut firm = false;
        let mut brakes = this;
        if let Some(before) = before {
            firm = is_firm(this, before);
            let pace = self.known.velocity(before, factors);
            let most = least(low, entry);
            if !firm && (!below(most, pace) || most >= pace * WORTH) {
                self.low = low;
                return false;
            }
            if firm {
                // What comes before brakes with its own limits.
                brakes = before;
            }
        }
        self.low = f32::MAX;
        let key = this.start + horizon::key(Short::new(entry).get(), self.known.kappa(brakes));
        let needed = firm || key < self.key;
        if needed {
            self.key = key;
        }
        needed
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

    fn kappa(&mut self, line: &Line) -> f32 {
        let limits = (line.accel, line.jerk);
        if limits != self.limits {
            self.limits = limits;
            self.kappa = kappa(line.accel.get(), line.jerk.get());
        }
        self.kappa
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
        self.look_back(&mut marks);
        if let (Some(last), Some(line)) = (&mut self.last, line(self.ring.pushed(0))) {
            last.cruise = line.velocity(&factors);
            last.high = last.cruise;
        }
        self.install(&marks);
    }

    /// Marks the lines that need a key, from the newest to the oldest.
    #[inline(never)]
    fn look_back(&self, marks: &mut Marks) {
        let mut behind =
            Behind { key: f32::MAX, low: f32::MAX, left_out: 0.0, known: Known::default() };
        let mut last: Option<(usize, &Line)> = None;
        let next = self.newest.wrapping_add(1) & SEQ;
        let older = exec::lock(|ceiling| self.store.with_horizon(ceiling, |h| h.older(next)));
        for back in 0..=self.ring.used() {
            let block = self.ring.pushed(back);
            if is_aside(block) {
                continue;
            }
            let before = line(block);
            if let Some((back, this)) = last {
                behind.count_from(older.of(back as u8));
                if behind.needs(this, before, &self.factors) {
                    marks.set(back);
                }
            }
            last = before.map(|line| (back, line));
        }
    }

    /// The line before the one that has been pushed so many before the newest, if it is in the queue still.
    fn before(&self, back: usize) -> Option<&Line> {
        let mut back = back + 1;
        while is_aside(self.ring.pushed(back)) {
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
                    let Some(this) = line(self.ring.pushed(back)) else { continue };
                    let firm = self.before(back).is_some_and(|before| is_firm(this, before));
                    let entry = Short::new(this.entry(&self.factors));
                    horizon.add(if firm { seq | FIRM } else { seq }, entry);
                }
                horizon.planned = self.factors;
                horizon.changed = true;
                horizon.version = horizon.version.wrapping_add(1);
            });
        });
    }
}

/// Whether the machine goes on over a block that is no line.
#[small]
fn is_aside(block: Option<&Block>) -> bool {
    matches!(block, Some(Block { body: Body::Action(Action::Override(_)), .. }))
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
