//! The block queue, seen from the planner's side: a ring of blocks, and the speed constraints that say how fast they
//! may be run. Exec's side is `source`.
//!
//! The planner changes the speed constraints under the ceiling lock only, exec at any time. When the ring is
//! full the planner waits ([`BlockQueue::free`]).

use avr_embassy::{InterruptEnd, Shared};

use super::block::{Block, Body, Line};
use super::factors::Factors;
use super::float::{OCTAVE, below, greater, least, lesser, log, some};
use super::short::Short;
pub use super::source::{BlockSource, Constraint};
use super::speed_constraints::{self, SpeedConstraints, kappa};
use crate::hal::exec;
use crate::hal::ring::{Ceiling, Index, Producer, Ring};
use crate::hal::{Interrupt, LOOK_AHEAD, Thread};
use crate::math::sqrt;

/// Blocks the planner can queue, plus one slot that stays empty. Sequence numbers have a bit less than an [`Index`].
pub const BLOCKS: usize = LOOK_AHEAD + 1;
const _: () = assert!(BLOCKS <= SEQ as usize + 1);

/// Blocks that can wait at once; what `qr` shows of an idle machine.
pub const CAPACITY: usize = BLOCKS - 1;

/// Sequence numbers.
pub(super) const SEQ: Index = Index::MAX >> 1;

/// Marks a key that stays even before a lower one.
pub(super) const FIRM: Index = !SEQ;

/// A corner is worth a key if it is slower than this share of what holds on both sides.
pub(super) const WORTH: f32 = 0.999;

/// Potentials beyond so many times the square of the velocity are counted anew.
const COARSE: f32 = 1024.0;

/// The logarithm of half of it.
const FINE: i32 = 9 * OCTAVE;

/// The storage.
pub struct BlockStore {
    ring: Ring<Block, BLOCKS>,
    constraints: Shared<SpeedConstraints>,
}

impl BlockStore {
    /// Without blocks.
    pub const fn new() -> Self {
        Self { ring: Ring::new(), constraints: Shared::new(SpeedConstraints::new()) }
    }

    /// The planner's end. `None` after the first time.
    pub fn queue(&'static self, thread: Thread) -> Option<BlockQueue> {
        let ring = self.ring.producer()?;
        exec::lock(thread, |ceiling| self.constraints.with(ceiling, SpeedConstraints::begin));
        Some(BlockQueue {
            thread,
            ring,
            constraints: &self.constraints,
            newest: SEQ,
            last: None,
            factors: Factors::ONE,
        })
    }

    /// Exec's end. `None` after the first time.
    ///
    /// Thread mode cannot have it, nor be given it:
    ///
    /// ```compile_fail,E0308
    /// fn steal(thread: kerf::hal::Thread) {
    ///     kerf::motion::queue::store().source(thread);
    /// }
    /// ```
    ///
    /// ```compile_fail,E0277
    /// fn is_send<T: Send>() {}
    /// is_send::<kerf::motion::queue::BlockSource>();
    /// ```
    pub fn source(&'static self, level: Interrupt) -> Option<BlockSource> {
        Some(BlockSource::new(self.ring.consumer()?, InterruptEnd::of(&self.constraints, level)?))
    }

    /// These overrides are wanted: in force at once, but for what is more than the keys are for.
    pub fn want(&self, factors: Factors, ceiling: &Ceiling) {
        self.constraints.with(ceiling, |constraints| constraints.want(factors));
    }
}

impl Default for BlockStore {
    fn default() -> Self {
        Self::new()
    }
}

machine_static! {
    /// The block queue.
    pub fn store() -> BlockStore = BlockStore::new();
}

/// Free blocks.
pub fn free() -> usize {
    CAPACITY - used()
}

/// Blocks in the queue, with the one that runs; by a call.
#[inline(never)]
#[small]
pub fn used() -> usize {
    used_here()
}

/// Blocks in the queue, with the one that runs. Cost: 15 cycles.
#[inline(always)]
pub fn used_here() -> usize {
    store().ring.used()
}

/// What the planner remembers of the line pushed last.
#[derive(Clone, Copy)]
pub(super) struct Last {
    pub(super) cruise: f32,
    /// The highest velocity since the last key: many that are a little slower each do need one.
    pub(super) high: f32,
    kappa: f32,
    limits: (Short, Short),
}

impl Last {
    /// Whether `line` brakes otherwise, so that keys before and after it do not compare.
    fn jerk_limits_change(&self, line: &Line, kappa: f32) -> bool {
        self.limits != (line.accel, line.jerk) && (some(self.kappa) || some(kappa))
    }

    /// Whether a line has the same velocity, at its start as well.
    fn as_fast(&self, cruise: f32, entry: f32) -> bool {
        let cruise = cruise.to_bits();
        entry.to_bits() >= cruise
            && self.cruise.to_bits() == cruise
            && self.high.to_bits() == cruise
    }
}

/// The planner's end.
pub struct BlockQueue {
    pub(super) thread: Thread,
    pub(super) ring: Producer<Block, BLOCKS>,
    pub(super) constraints: &'static Shared<SpeedConstraints>,
    /// Sequence number of the block pushed last.
    pub(super) newest: Index,
    /// The line that the next one may follow without a stop.
    pub(super) last: Option<Last>,
    /// The overrides that keys are made for.
    pub(super) factors: Factors,
}

impl BlockQueue {
    /// Free blocks.
    pub fn free(&self) -> usize {
        self.ring.free()
    }

    /// Exec has dropped all blocks: what comes next begins at rest.
    pub fn restart(&mut self) {
        self.last = None;
    }

    /// Queues a block at whose start the machine stands still. False, and nothing done, when there is
    /// no room.
    pub fn push(&mut self, block: Block) -> bool {
        self.last = None;
        self.put(|| block, None, |_| {})
    }

    /// Queues a block at which the machine does not stop. False, and nothing done, when there is no room.
    pub fn push_aside(&mut self, block: Block) -> bool {
        self.put(|| block, None, |_| {})
    }

    /// Queues a move whose corner may be taken at `entry`, mm/s; fills in what depends on the queue. False,
    /// and nothing done, when there is no room.
    ///
    /// Cost: 1,200 on a curve at a steady feed; 2,000 more for a corner, and 900 for each key that it
    /// makes needless.
    #[inline(never)]
    pub fn push_line(&mut self, line: &mut Line, entry: f32, number: u32) -> bool {
        if self.ring.free() == 0 {
            return false;
        }
        line.start = self.refined(line);
        line.entry = Short::new(entry);
        let cruise = line.velocity(&self.factors);
        let key =
            if self.goes_on(line, cruise, entry) { None } else { self.corner(line, cruise, entry) };
        let end = line.start + line.gain();
        let make = || Block::new(Body::Line(*line), number);
        let entry = Short::new(least(line.entry.get(), cruise));
        self.put(make, key.map(|(key, firm)| (key, firm, entry)), |constraints| {
            constraints.end = end
        })
    }

    /// Potential at the end of the queue.
    fn end(&self) -> f32 {
        exec::lock(self.thread, |ceiling| {
            self.constraints.with(ceiling, |constraints| constraints.end)
        })
    }

    /// Whether the line is as fast as the one before, and the corner between them no limit.
    fn goes_on(&self, line: &Line, cruise: f32, entry: f32) -> bool {
        self.last.as_ref().is_some_and(|last| {
            last.limits == (line.accel, line.jerk) && last.as_fast(cruise, entry)
        })
    }

    /// The key of a line that does not simply go on, if it needs one.
    #[inline(never)]
    fn corner(&mut self, line: &mut Line, cruise: f32, entry: f32) -> Option<(f32, Index)> {
        let limits = (line.accel, line.jerk);
        let kappa =
            if line.jerk == Short::ZERO { 0.0 } else { kappa(line.accel.get(), line.jerk.get()) };
        if let Some(last) = &mut self.last {
            // Only the acceleration changes.
            if !last.jerk_limits_change(line, kappa) && last.as_fast(cruise, entry) {
                (last.kappa, last.limits) = (kappa, limits);
                return None;
            }
        }
        let entry = self.entry(line, entry, kappa);
        line.entry = Short::new(entry);
        let mut key = None;
        let mut high = cruise;
        match &self.last {
            // What comes before brakes with its own limits.
            Some(last) if last.jerk_limits_change(line, kappa) => {
                key = Some((
                    line.start + speed_constraints::key(line.entry(&self.factors), last.kappa),
                    FIRM,
                ));
            }
            Some(last) => {
                let limit = lesser(last.cruise, cruise) * WORTH;
                if entry < limit || cruise < last.high * WORTH {
                    key = Some((line.key(&self.factors), 0));
                } else {
                    high = greater(last.high, cruise);
                }
            }
            None => key = Some((line.key(&self.factors), 0)),
        }
        self.last = Some(Last { cruise, high, kappa, limits });
        key
    }

    /// Where limits change and there is a jerk limit, what was braked with before does not go on: the
    /// new line must be able to stop on its own.
    fn entry(&self, line: &Line, entry: f32, kappa: f32) -> f32 {
        match self.last {
            None => 0.0,
            Some(last) if !last.jerk_limits_change(line, kappa) => entry,
            Some(last) => {
                let k = if kappa < last.kappa { last.kappa } else { kappa };
                lesser(entry, sqrt(k * k + line.gain()) - k)
            }
        }
    }

    /// Potential at the end of the queue, counted anew if it has become large for this line.
    fn refined(&mut self, line: &Line) -> f32 {
        let end = self.end();
        // Nothing is there, or it is plainly fine: no need to compare.
        if !some(end) || log(end) < 2 * log(line.cruise) + FINE {
            return end;
        }
        if below(COARSE * line.cruise * line.cruise, end) {
            exec::lock(self.thread, |ceiling| {
                let next = self.newest.wrapping_add(1) & SEQ;
                let used = self.ring.used();
                self.constraints.with(ceiling, |constraints| {
                    constraints.count_anew(next);
                    if used == 0 {
                        constraints.oldest_is(next);
                    }
                });
            });
        }
        self.end()
    }

    /// Puts a block, which `make` makes, into the ring and what follows from it into the speed constraints, all at once for exec.
    fn put(
        &mut self,
        make: impl FnOnce() -> Block,
        key: Option<(f32, Index, Short)>,
        end: impl FnOnce(&mut SpeedConstraints) + Send,
    ) -> bool {
        if self.ring.free() == 0 {
            return false;
        }
        let seq = self.newest.wrapping_add(1) & SEQ;
        let needless = key.map_or(0, |(key, ..)| self.needless(key));
        let Some(slot) = self.ring.slot_with(make) else { return false };
        exec::lock(self.thread, |ceiling| {
            self.constraints.with(ceiling, |constraints| {
                if let Some((_, firm, entry)) = key {
                    constraints.drop_last(needless);
                    constraints.add(seq | firm, entry);
                }
                end(constraints);
                constraints.version = constraints.version.wrapping_add(1);
            });
            slot.publish();
        });
        self.newest = seq;
        true
    }

    /// How many of the last keys a lower one makes needless. Exec goes on meanwhile, which only passes the first ones: it
    /// must not wait for the mathematics of a whole queue.
    #[inline(never)]
    fn needless(&self, key: f32) -> Index {
        let newest = self.newest;
        let next = newest.wrapping_add(1) & SEQ;
        let mut count = 0;
        loop {
            let last = exec::lock(self.thread, |ceiling| {
                self.constraints.with(ceiling, move |constraints| {
                    let seq = constraints.nth_last(count)?;
                    Some((seq, constraints.older(next).of(newest.wrapping_sub(seq) & SEQ)))
                })
            });
            let needless = |(last, more)| last & FIRM == 0 && self.key(last) - more >= key;
            if !last.is_some_and(needless) {
                return count;
            }
            count += 1;
        }
    }

    fn key(&self, seq: Index) -> f32 {
        let back = usize::from(self.newest.wrapping_sub(seq) & SEQ);
        match self.ring.pushed(back) {
            Some(Block { body: Body::Line(line), .. }) => line.key(&self.factors),
            // Gone already: no limit.
            _ => f32::MAX,
        }
    }
}
