//! The block queue, seen from the planner's side: a ring of blocks, and the speed constraints that say how fast they
//! may be run. Exec's side is `source`.
//!
//! The planner changes the speed constraints under the ceiling lock only, exec at any time. When the ring is
//! full the planner waits ([`BlockQueue::free`]).

use avr_embassy::{InterruptEnd, Shared};

use super::block::{Block, Body, Line};
use super::factors::Factors;
use super::float::{OCTAVE, below, log, some};
pub use super::source::{BlockSource, Constraint};
use super::speed_constraints::SpeedConstraints;
use super::tail::{Key, Tail};
use crate::hal::exec;
use crate::hal::ring::{Ceiling, Index, Prefilled, Ring};
use crate::hal::{Interrupt, LOOK_AHEAD, Thread};

/// Blocks the planner can queue, plus one slot that stays empty. Sequence numbers have a bit less than an [`Index`].
pub const BLOCKS: usize = LOOK_AHEAD + 1;
const _: () = assert!(BLOCKS <= SEQ as usize + 1);

/// Blocks that can wait at once; what `qr` shows of an idle machine.
pub const CAPACITY: usize = BLOCKS - 1;

/// Sequence numbers.
pub(super) const SEQ: Index = Index::MAX >> 1;

/// Marks a key that stays even before a lower one.
pub(super) const FIRM: Index = !SEQ;

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
            ring: ring.prefilled(Block::new(Body::Line(Line::default()), 0)),
            constraints: &self.constraints,
            newest: SEQ,
            tail: Tail { last: None, factors: Factors::ONE },
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

/// Potential at the end of the queue.
#[inline(always)]
fn end(thread: Thread, constraints: &Shared<SpeedConstraints>) -> f32 {
    exec::lock(thread, |ceiling| constraints.with(ceiling, |constraints| constraints.end))
}

/// Potential at the end of the queue, counted anew if it has become large for this line. There are so many blocks, up to the `newest`.
#[inline(never)]
#[small]
fn refined(
    thread: Thread,
    constraints: &Shared<SpeedConstraints>,
    line: &Line,
    (newest, used): (Index, usize),
) -> f32 {
    if below(COARSE * line.cruise * line.cruise, line.start) {
        exec::lock(thread, |ceiling| {
            let next = newest.wrapping_add(1) & SEQ;
            constraints.with(ceiling, |constraints| {
                constraints.count_anew(next);
                if used == 0 {
                    constraints.oldest_is(next);
                }
            });
        });
    }
    end(thread, constraints)
}

/// The planner's end.
pub struct BlockQueue {
    pub(super) thread: Thread,
    pub(super) ring: Prefilled<Block, BLOCKS>,
    pub(super) constraints: &'static Shared<SpeedConstraints>,
    /// Sequence number of the block pushed last.
    pub(super) newest: Index,
    /// What the next line follows.
    pub(super) tail: Tail,
}

impl BlockQueue {
    /// Free blocks.
    pub fn free(&self) -> usize {
        self.ring.free()
    }

    /// Exec has dropped all blocks: what comes next begins at rest.
    pub fn restart(&mut self) {
        self.tail.last = None;
    }

    /// Queues a block at whose start the machine stands still. False, and nothing done, when there is
    /// no room.
    pub fn push(&mut self, block: Block) -> bool {
        self.tail.last = None;
        self.put(|slot| *slot = block, None, |_| {})
    }

    /// Queues a block at which the machine does not stop. False, and nothing done, when there is no room.
    pub fn push_aside(&mut self, block: Block) -> bool {
        self.put(|slot| *slot = block, None, |_| {})
    }

    /// Where the next move is to be put together, for [`BlockQueue::push_line`]: to copy a block takes time. `None` if there is no room.
    #[inline(always)]
    pub fn next_line(&mut self) -> Option<&mut Line> {
        let body = &mut self.ring.vacant_mut()?.body;
        if !matches!(body, Body::Line(_)) {
            *body = Body::Line(Line::default());
        }
        match body {
            Body::Line(line) => Some(line),
            Body::QueuedAction(_) => None,
        }
    }

    /// Queues the move in [`BlockQueue::next_line`], whose corner may be taken at `entry`, mm/s; fills in what depends on the queue. False,
    /// and nothing done, when there is no room.
    ///
    /// Cost: 1,000 on a curve at a steady feed; 2,000 more for a corner, and 900 for each key that it
    /// makes needless.
    #[inline(never)]
    pub fn push_line(&mut self, entry: f32, number: u32) -> bool {
        let (thread, constraints, newest) = (self.thread, self.constraints, self.newest);
        let used = self.ring.used();
        let Some(Block { body: Body::Line(line), .. }) = self.ring.vacant_mut() else {
            return false;
        };
        line.start = end(thread, constraints);
        // Nothing is there, or it is plainly fine: no need to compare.
        if some(line.start) && log(line.start) >= 2 * log(line.cruise) + FINE {
            line.start = refined(thread, constraints, line, (newest, used));
        }
        let key = self.tail.follow(line, entry);
        let behind = line.start + line.gain();
        self.put(|slot| slot.set_line(number), key, |constraints| constraints.end = behind)
    }

    /// Puts a block, which `complete` completes, into the ring and what follows from it into the speed constraints, all at once for exec.
    fn put(
        &mut self,
        complete: impl FnOnce(&mut Block),
        key: Option<Key>,
        end: impl FnOnce(&mut SpeedConstraints) + Send,
    ) -> bool {
        if self.ring.free() == 0 {
            return false;
        }
        let seq = self.newest.wrapping_add(1) & SEQ;
        let needless = key.map_or(0, |key| self.needless(key.key));
        let Some(mut slot) = self.ring.slot() else { return false };
        complete(&mut slot);
        exec::lock(self.thread, |ceiling| {
            self.constraints.with(ceiling, |constraints| {
                if let Some(Key { firm, entry, .. }) = key {
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
            Some(Block { body: Body::Line(line), .. }) => line.key(&self.tail.factors),
            // Gone already: no limit.
            _ => f32::MAX,
        }
    }
}
