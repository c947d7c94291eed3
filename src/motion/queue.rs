//! The block queue, seen from the planner's side: a ring of blocks, and the speed constraints that say how fast they
//! may be run. Exec's side is `source`.
//!
//! The planner changes the speed constraints only under the ceiling lock; exec changes them at any time. When the
//! ring is full the planner waits ([`BlockQueue::free`]).

use avr_embassy::{InterruptEnd, Shared};

use super::blend::{Blend, Ready, SPARE, STAGES};
use super::block::{Block, Body, Line, QueuedAction};
use super::factors::Factors;
use super::float::{OCTAVE, below, log, some};
use super::short::Short;
pub use super::source::BlockSource;
use super::speed_constraints::SpeedConstraints;
use super::tail::Tail;
use crate::hal::exec;
use crate::hal::ring::{Index, Prefilled, Ring};
use crate::hal::{Ceiling, Interrupt, LOOK_AHEAD, Thread};
use crate::units::PerAxis;

/// Blocks the planner can queue, plus one slot that stays empty. Sequence numbers have one bit less than an
/// [`Index`].
pub const BLOCKS: usize = LOOK_AHEAD + 1;
const _: () = assert!(BLOCKS <= SEQ as usize + 1);

/// Blocks that can wait at once; what `qr` shows of an idle machine.
pub const CAPACITY: usize = BLOCKS - 1;

/// The bits of sequence numbers.
pub(super) const SEQ: Index = Index::MAX >> 1;

/// Potentials above this many times the square of the velocity are counted from zero again.
const COARSE: f32 = 1024.0;

/// The queue is short if its potential is below this many times the square of the velocity: exec brakes at 1.
const AHEAD: f32 = 2.0;

/// The logarithm of half of [`COARSE`].
const FINE: i32 = 9 * OCTAVE;

/// The storage of the block queue.
pub struct BlockStore {
    ring: Ring<Block, BLOCKS>,
    constraints: Shared<SpeedConstraints>,
}

impl BlockStore {
    /// A store without blocks.
    pub const fn new() -> Self {
        Self { ring: Ring::new(), constraints: Shared::new(SpeedConstraints::new()) }
    }

    /// Returns the planner's end, with the stage; `None` after the first time.
    pub fn queue(&'static self, thread: Thread, stage: Stage) -> Option<BlockQueue> {
        let ring = self.ring.producer()?;
        exec::lock(thread, |ceiling| self.constraints.with(ceiling, SpeedConstraints::begin));
        Some(BlockQueue {
            thread,
            ring: ring.prefilled(Block::new(Body::Line(Line::default()), 0)),
            constraints: &self.constraints,
            newest: SEQ,
            tail: Tail { last: None, factors: Factors::ONE },
            stage,
        })
    }

    /// Returns exec's end; `None` after the first time.
    ///
    /// Thread mode cannot take exec's end, nor be given it:
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

    /// Requests these overrides. They apply at once, as far as they do not exceed the overrides that the keys are made
    /// for.
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

/// The number of free blocks.
pub fn free() -> usize {
    CAPACITY - used()
}

/// The number of blocks in the queue, the running one included; not inlined.
#[inline(never)]
#[small]
pub fn used() -> usize {
    used_here()
}

/// The number of blocks in the queue, the running one included. Cost: 15 cycles.
#[inline(always)]
pub fn used_here() -> usize {
    store().ring.used()
}

/// Returns the potential at the end of the queue.
#[inline(always)]
fn end(thread: Thread, constraints: &Shared<SpeedConstraints>) -> f32 {
    exec::lock(thread, |ceiling| constraints.with(ceiling, |constraints| constraints.end))
}

/// Returns the potential at the end of the queue. Potentials are counted from zero again if they have become large for
/// this line. `used` blocks are queued, and `newest` is the last of them.
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

/// Where blocks wait to be blended, on a chip that blends.
pub type Stage = [&'static mut Blend; STAGES];

/// The planner's end of the queue.
pub struct BlockQueue {
    pub(super) thread: Thread,
    pub(super) ring: Prefilled<Block, BLOCKS>,
    pub(super) constraints: &'static Shared<SpeedConstraints>,
    /// Sequence number of the block pushed last.
    pub(super) newest: Index,
    /// The state at the end of the queue, which the next line follows.
    pub(super) tail: Tail,
    stage: Stage,
}

impl BlockQueue {
    /// The number of free blocks. Those that wait to be blended are not free.
    pub fn free(&self) -> usize {
        match self.stage.first() {
            Some(stage) if stage.is_on() => self.ring.free().saturating_sub(stage.len() + SPARE),
            _ => self.ring.free(),
        }
    }

    /// Whether lines wait besides the one that runs.
    #[inline(always)]
    pub fn is_busy(&self) -> bool {
        self.ring.free() < CAPACITY - 1 || self.has_staged()
    }

    /// Whether exec soon brakes for the end of the queue. Cost: 300.
    pub fn is_short(&self) -> bool {
        let used = self.ring.used();
        let oldest = self.ring.pushed(used.saturating_sub(1));
        let Some(Block { body: Body::Line(oldest), .. }) = oldest else { return false };
        let constraints = self.constraints;
        exec::lock(self.thread, |ceiling| {
            constraints.with(ceiling, |constraints| {
                let left = constraints.end - oldest.start;
                !constraints.is_mixed() && below(left, AHEAD * oldest.cruise * oldest.cruise)
            })
        })
    }

    /// Notes that exec has dropped all blocks: the next block begins at a standstill.
    pub fn restart(&mut self) {
        self.tail.last = None;
        if let Some(stage) = self.stage.first_mut() {
            stage.clear();
        }
    }

    /// Queues a block at whose start the machine stands still. Returns false, with nothing done, when there is no
    /// room.
    pub fn push(&mut self, block: Block) -> bool {
        self.flush(true);
        if let Some(stage) = self.stage.first_mut() {
            match block.body {
                Body::QueuedAction(QueuedAction::Thread(_)) => stage.follow(true),
                Body::QueuedAction(QueuedAction::EndThread) => stage.follow(false),
                _ => {}
            }
        }
        self.tail.last = None;
        self.put_whole(block)
    }

    /// Queues a block at which the machine does not stop. Returns false, with nothing done, when there is no room.
    pub fn push_aside(&mut self, block: Block) -> bool {
        match self.stage.first_mut() {
            Some(stage) if !stage.is_empty() => {
                stage.pass(block);
                self.forward();
                true
            }
            _ => self.put_whole(block),
        }
    }

    /// The stage, on a chip that blends.
    #[inline(always)]
    pub fn stage(&mut self) -> Option<&mut Blend> {
        self.stage.first_mut().map(|stage| &mut **stage)
    }

    /// Whether lines are blended.
    #[inline(always)]
    pub fn blends(&self) -> bool {
        self.stage.first().is_some_and(|stage| stage.is_on())
    }

    /// Whether blocks wait to be blended.
    #[inline(always)]
    pub fn has_staged(&self) -> bool {
        self.stage.first().is_some_and(|stage| !stage.is_empty())
    }

    /// When the first of the lines that wait to be blended came, or the last one while others ran: [`Blend::since`].
    #[inline(always)]
    pub fn waits_since(&self) -> u16 {
        self.stage.first().map_or(0, |stage| stage.since)
    }

    /// Queues the blocks that wait to be blended. `stops` says whether the machine stops there.
    #[inline(always)]
    pub fn flush(&mut self, stops: bool) {
        if let Some(stage) = self.stage.first_mut() {
            stage.flush(stops);
            self.forward();
        }
    }

    /// Takes the move in [`BlockQueue::next_line`], with this direction, to be blended and queued. There is room. If it
    /// `begins` at a standstill, all moves before it are queued first.
    pub fn blend(&mut self, unit: &PerAxis<i16>, number: u32, begins: bool) {
        if begins {
            self.flush_ahead(true);
            self.tail.last = None;
        }
        let line = self.ring.vacant_mut();
        if let (Some(stage), Some(Block { body: Body::Line(line), .. })) =
            (self.stage.first_mut(), line)
        {
            stage.add(line, number, unit);
            self.forward();
        }
    }

    /// Queues the move in [`BlockQueue::next_line`], as [`BlockQueue::push_line`], behind those that wait to be blended.
    #[inline(always)]
    pub fn push_unblended(&mut self, entry: f32, unit: &PerAxis<i16>, number: u32) -> bool {
        if self.blends() {
            self.flush_ahead(false);
            let length = self.next_line().map_or(0.0, |line| line.extent.length());
            if let Some(stage) = self.stage.first_mut() {
                stage.went_past(unit, length);
            }
        }
        self.push_line(entry, number)
    }

    /// Queues the blocks that wait to be blended, and keeps the move in [`BlockQueue::next_line`].
    #[inline(never)]
    fn flush_ahead(&mut self, stops: bool) {
        if !self.has_staged() {
            return self.flush(stops);
        }
        let Some(line) = self.next_line().copied() else { return };
        self.flush(stops);
        if let Some(slot) = self.next_line() {
            *slot = line;
        }
    }

    /// Drops the moves that wait to be blended. What else waits is queued: exec carries it out as it drops its blocks.
    #[inline(always)]
    pub fn drop_staged(&mut self) {
        if let Some(stage) = self.stage.first_mut() {
            stage.drop_lines();
            self.forward();
        }
    }

    /// Queues the blocks that are ready. There is room.
    fn forward(&mut self) {
        while let Some(stage) = self.stage.first_mut()
            && let Some(Ready { block, entry, room }) = stage.take()
            && let Some(slot) = self.ring.vacant_mut()
        {
            *slot = *block;
            if let Body::Line(line) = &mut slot.body {
                if room < 1.0 {
                    line.accel = Short::new(line.accel.get() * room);
                }
                let number = slot.line();
                self.push_line(entry, number);
            } else {
                self.put(|_| {}, None, |_| {});
            }
        }
    }

    /// Queues a block that is complete. Returns false, with nothing done, when there is no room.
    #[inline(always)]
    fn put_whole(&mut self, block: Block) -> bool {
        self.put(|slot| *slot = block, None, |_| {})
    }

    /// Returns the slot in which to build the next move for [`BlockQueue::push_line`], because copying a block takes
    /// time. `None` if there is no room.
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

    /// Queues the move in [`BlockQueue::next_line`], whose corner may be taken at `entry`, mm/s. Fills in what
    /// depends on the queue. Returns false, with nothing done, when there is no room.
    ///
    /// Cost: 1,000 on a curve at a steady feed; 2,000 more for a corner, and 900 for each key that the corner makes
    /// needless.
    #[inline(never)]
    pub fn push_line(&mut self, entry: f32, number: u32) -> bool {
        let (thread, constraints, newest) = (self.thread, self.constraints, self.newest);
        let used = self.ring.used();
        let Some(Block { body: Body::Line(line), .. }) = self.ring.vacant_mut() else {
            return false;
        };
        line.start = end(thread, constraints);
        // Mostly the queue is empty, or floats are certainly fine enough.
        if some(line.start) && log(line.start) >= 2 * log(line.cruise) + FINE {
            line.start = refined(thread, constraints, line, (newest, used));
        }
        let key = self.tail.follow(line, entry);
        let behind = line.start + line.gain();
        self.put(|slot| slot.set_line(number), key, |constraints| constraints.end = behind)
    }

    /// Puts a block, completed by `complete`, into the ring, and updates the speed constraints. Exec sees both changes
    /// at once. Returns false, with nothing done, when there is no room.
    fn put(
        &mut self,
        complete: impl FnOnce(&mut Block),
        key: Option<f32>,
        end: impl FnOnce(&mut SpeedConstraints) + Send,
    ) -> bool {
        if self.ring.free() == 0 {
            return false;
        }
        let seq = self.newest.wrapping_add(1) & SEQ;
        let needless = key.map_or(0, |key| self.needless(key));
        let Some(mut slot) = self.ring.slot() else { return false };
        complete(&mut slot);
        exec::lock(self.thread, |ceiling| {
            self.constraints.with(ceiling, |constraints| {
                if key.is_some() {
                    constraints.drop_last(needless);
                    constraints.add(seq);
                }
                end(constraints);
                constraints.version = constraints.version.wrapping_add(1);
            });
            slot.publish();
        });
        self.newest = seq;
        true
    }

    /// Returns how many of the last keys a lower `key` makes needless. Takes the lock again for each key, so that exec
    /// does not wait for the mathematics of a whole queue. Meanwhile exec removes only the first keys.
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
            if !last.is_some_and(|(last, more)| self.key(last) - more >= key) {
                return count;
            }
            count += 1;
        }
    }

    fn key(&self, seq: Index) -> f32 {
        let back = usize::from(self.newest.wrapping_sub(seq) & SEQ);
        match self.ring.pushed(back) {
            Some(Block { body: Body::Line(line), .. }) => line.key(&self.tail.factors),
            // The block has been released already: no limit.
            _ => f32::MAX,
        }
    }
}
