//! The block queue, seen from the planner's side and from exec's: a ring of blocks, and the horizon that
//! says how fast they may be run.
//!
//! The planner changes the horizon under the ceiling lock only, exec at any time. When the ring is
//! full the planner waits ([`BlockQueue::free`]).

use core::cell::UnsafeCell;

use super::block::{Block, Body, Line};
use super::float::{greater, lesser};
use super::horizon::{self, Horizon, kappa};
use super::short::Short;
use crate::hal::imp::exec;
use crate::hal::ring::{Ceiling, Consumer, Producer, Ring};
use crate::math::sqrt;

/// Blocks the planner can queue, plus one slot that stays empty. At most 128: sequence numbers have
/// seven bits.
pub const BLOCKS: usize = 73;

/// Blocks that can wait at once; what `qr` shows of an idle machine.
pub const CAPACITY: usize = BLOCKS - 1;

/// Sequence numbers.
const SEQ: u8 = 0x7F;

/// Marks a key that stays even before a lower one.
const FIRM: u8 = 0x80;

/// A corner is worth a key if it is slower than this share of what holds on both sides.
const WORTH: f32 = 0.999;

/// Potentials beyond so many times the square of the velocity are made small again.
const COARSE: f32 = 1024.0;

/// The storage.
pub struct BlockStore {
    ring: Ring<Block, BLOCKS>,
    horizon: UnsafeCell<Horizon>,
}

// SAFETY: the ends of the ring are safe to share; the horizon belongs to exec, and to whoever keeps exec
// from running (`with_horizon`).
unsafe impl Sync for BlockStore {}

impl BlockStore {
    /// Without blocks.
    pub const fn new() -> Self {
        Self { ring: Ring::new(), horizon: UnsafeCell::new(Horizon::new()) }
    }

    /// The planner's end and exec's. `None` after the first time.
    pub fn split(&'static self) -> Option<(BlockQueue, BlockSource)> {
        let (producer, consumer) = self.ring.split()?;
        let queue = BlockQueue { ring: producer, store: self, newest: SEQ, last: None };
        Some((queue, BlockSource { ring: consumer, store: self, oldest: 0 }))
    }

    fn with_horizon<R>(&self, _: &Ceiling, change: impl FnOnce(&mut Horizon) -> R) -> R {
        // SAFETY: the witness says that exec does not run; thread mode comes here from the planner only,
        // and `change` does not come back here.
        change(unsafe { &mut *self.horizon.get() })
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

/// Blocks in the queue, with the one that runs.
pub fn used() -> usize {
    store().ring.used()
}

/// What the planner remembers of the line pushed last.
#[derive(Clone, Copy)]
struct Last {
    cruise: f32,
    /// The highest velocity since the last key: many that are a little slower each do need one.
    high: f32,
    kappa: f32,
    limits: (Short, Short),
}

impl Last {
    /// Whether `line` brakes otherwise, so that keys before and after it do not compare.
    fn jerk_limits_change(&self, line: &Line, kappa: f32) -> bool {
        self.limits != (line.accel, line.jerk) && (self.kappa > 0.0 || kappa > 0.0)
    }
}

/// The planner's end.
pub struct BlockQueue {
    ring: Producer<Block, BLOCKS>,
    store: &'static BlockStore,
    /// Sequence number of the block pushed last.
    newest: u8,
    /// The line that the next one may follow without a stop.
    last: Option<Last>,
}

impl BlockQueue {
    /// Free blocks.
    pub fn free(&self) -> usize {
        self.ring.free()
    }

    /// Queues a block at whose start the machine stands still. False, and nothing done, when there is
    /// no room.
    pub fn push(&mut self, block: Block) -> bool {
        self.last = None;
        self.put(block, None, |horizon| horizon.version = horizon.version.wrapping_add(1))
    }

    /// Queues a move that may be entered at `entry`, mm/s. False, and nothing done, when there is no
    /// room.
    ///
    /// Cost: 3,000, and 900 for each key that it makes needless.
    #[inline(never)]
    pub fn push_line(&mut self, mut line: Line, entry: f32, number: u32) -> bool {
        let (accel, jerk) = (line.accel.get(), line.jerk.get());
        let kappa = kappa(accel, jerk);
        line.start = self.start(&line);
        let entry = self.entry(&line, entry, kappa);
        line.entry = Short::new(entry);
        let needed = match self.last {
            None => true,
            Some(last) => {
                let limit = lesser(last.cruise, line.cruise) * WORTH;
                entry < limit || line.cruise < last.high * WORTH
            }
        };
        let mut key = None;
        match self.last {
            // What comes before brakes with its own limits.
            Some(last) if last.jerk_limits_change(&line, kappa) => {
                key = Some((line.start + horizon::key(line.entry.get(), last.kappa), FIRM));
            }
            _ if needed => key = Some((line.key(), 0)),
            _ => {}
        }
        let high = match self.last {
            Some(last) if key.is_none() => greater(last.high, line.cruise),
            _ => line.cruise,
        };
        let end = line.start + line.gain();
        let pushed = self.put(Block { body: Body::Line(line), line: number }, key, |horizon| {
            horizon.end = end;
            horizon.version = horizon.version.wrapping_add(1);
        });
        if pushed {
            let limits = (line.accel, line.jerk);
            self.last = Some(Last { cruise: line.cruise, high, kappa, limits });
        }
        pushed
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

    /// The potential at the end of the queue, made small if it has become large for this line.
    fn start(&mut self, line: &Line) -> f32 {
        let end = exec::lock(|ceiling| self.store.with_horizon(ceiling, |horizon| horizon.end));
        if end <= COARSE * line.cruise * line.cruise {
            return end;
        }
        exec::lock(|ceiling| self.rebase(ceiling));
        exec::lock(|ceiling| self.store.with_horizon(ceiling, |horizon| horizon.end))
    }

    /// Takes the potential of the oldest line in the queue off all of them. Cost: 400 a block, exec
    /// waiting.
    fn rebase(&mut self, ceiling: &Ceiling) {
        let mut base = None;
        for back in (0..self.ring.used()).rev() {
            self.ring.amend(ceiling, back, |block| {
                if let Body::Line(line) = &mut block.body {
                    let base = *base.get_or_insert(line.start);
                    line.start -= base;
                }
            });
        }
        self.store.with_horizon(ceiling, |horizon| {
            let base = base.unwrap_or(horizon.end);
            horizon.end -= base;
            horizon.version = horizon.version.wrapping_add(1);
        });
    }

    /// Puts a block into the ring and what follows from it into the horizon, all at once for exec.
    fn put(
        &mut self,
        block: Block,
        key: Option<(f32, u8)>,
        end: impl FnOnce(&mut Horizon),
    ) -> bool {
        if self.ring.free() == 0 {
            return false;
        }
        let seq = self.newest.wrapping_add(1) & SEQ;
        exec::lock(|ceiling| {
            self.store.with_horizon(ceiling, |horizon| {
                if let Some((key, firm)) = key {
                    let needless = |last| last & FIRM == 0 && self.key(last) >= key;
                    while horizon.last().is_some_and(needless) {
                        horizon.drop_last();
                    }
                    horizon.add(seq | firm);
                }
                end(horizon);
            });
            // There is room.
            let _ = self.ring.push(block);
        });
        self.newest = seq;
        true
    }

    fn key(&self, seq: u8) -> f32 {
        let back = usize::from(self.newest.wrapping_sub(seq) & SEQ);
        match self.ring.pushed(back) {
            Some(Block { body: Body::Line(line), .. }) => line.key(),
            // Gone already: no limit.
            _ => f32::MAX,
        }
    }
}

/// A limit ahead of exec.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// Velocity there, mm/s.
    pub velocity: f32,
    /// Brake potential from the end of the oldest block to there.
    pub ahead: f32,
    /// Limits change there: what comes after is for the line that begins there.
    pub firm: bool,
}

/// Exec's end.
pub struct BlockSource {
    ring: Consumer<Block, BLOCKS>,
    store: &'static BlockStore,
    /// Sequence number of the oldest block.
    oldest: u8,
}

impl BlockSource {
    /// Blocks waiting, with the one that runs.
    pub fn len(&self) -> usize {
        self.ring.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.ring.is_empty()
    }

    /// A copy of the oldest block.
    pub fn oldest(&self) -> Option<Block> {
        self.ring.peek(0, |block| *block)
    }

    /// The oldest block is done.
    pub fn release(&mut self) {
        if !self.is_empty() {
            self.ring.release();
            self.oldest = self.oldest.wrapping_add(1) & SEQ;
        }
    }

    /// The oldest block begins: what limited its start is of the past.
    pub fn enter(&mut self) {
        let oldest = self.oldest;
        let horizon = self.horizon_mut();
        if horizon.nth(0).is_some_and(|seq| seq & SEQ == oldest) {
            horizon.pass();
        }
    }

    /// Changes when what is ahead changes.
    pub fn version(&self) -> u8 {
        self.horizon().version
    }

    /// The square of the velocity, (mm/s)^2, at which the oldest block, a line, may be left for the
    /// sake of all that follow, if there is no jerk limit. Cost: 900.
    pub fn headroom(&self) -> f32 {
        let horizon = self.horizon();
        let key = match horizon.nth(0).and_then(|seq| self.line(seq, Line::sharp_key)) {
            Some(key) => lesser(key, horizon.end),
            None => horizon.end,
        };
        key - self.end()
    }

    /// The `n`th limit ahead, nearest first, seen from the end of the oldest block. The last is the
    /// end of the queue. Cost: 1,000.
    pub fn anchor(&self, n: u8) -> Option<Anchor> {
        let horizon = self.horizon();
        let Some(seq) = horizon.nth(n) else {
            let last = n == 0 || horizon.nth(n - 1).is_some();
            let ahead = horizon.end - self.end();
            return last.then_some(Anchor { velocity: 0.0, ahead, firm: true });
        };
        let firm = seq & FIRM != 0;
        self.line(seq, |line| (line.entry.get(), line.start)).map(|(velocity, start)| Anchor {
            velocity,
            ahead: start - self.end(),
            firm,
        })
    }

    /// Potential at the end of the oldest block.
    fn end(&self) -> f32 {
        self.ring
            .peek(0, |block| match &block.body {
                Body::Line(line) => line.start + line.gain(),
                _ => 0.0,
            })
            .unwrap_or(0.0)
    }

    /// Something of a line in the queue.
    fn line<R: Copy>(&self, seq: u8, look: impl FnOnce(&Line) -> R) -> Option<R> {
        let ahead = usize::from(seq.wrapping_sub(self.oldest) & SEQ);
        self.ring.peek(ahead, |block| match &block.body {
            Body::Line(line) => Some(look(line)),
            _ => None,
        })?
    }

    fn horizon(&self) -> &Horizon {
        // SAFETY: exec runs, so nobody holds the ceiling lock.
        unsafe { &*self.store.horizon.get() }
    }

    fn horizon_mut(&mut self) -> &mut Horizon {
        // SAFETY: as in `horizon`; the borrow of `self` keeps the others away.
        unsafe { &mut *self.store.horizon.get() }
    }
}
