//! The block ring, seen from the planner's side and from exec's.

use super::block::Block;
use super::lookahead;
use crate::hal::imp::exec;
use crate::hal::ring::{Consumer, Producer, Ring};

/// Blocks the planner can queue, plus one slot that stays empty.
pub const BLOCKS: usize = 41;

/// Blocks that can wait at once; what `qr` shows of an idle machine.
pub const CAPACITY: usize = BLOCKS - 1;

/// The storage.
pub type BlockRing = Ring<Block, BLOCKS>;
/// Exec's end.
pub type BlockSource = Consumer<Block, BLOCKS>;

machine_static! {
    /// The block ring.
    pub fn ring() -> BlockRing = BlockRing::new();
}

/// Free blocks.
pub fn free() -> usize {
    CAPACITY - used()
}

/// Blocks in the queue, with the one that runs.
pub fn used() -> usize {
    ring().used()
}

/// The planner's end.
pub struct BlockQueue(Producer<Block, BLOCKS>);

impl BlockQueue {
    /// Takes over the producer's end of a ring.
    pub fn new(producer: Producer<Block, BLOCKS>) -> Self {
        Self(producer)
    }

    /// Free blocks.
    pub fn free(&self) -> usize {
        self.0.free()
    }

    /// Queues a block and plans again. False, and nothing done, when there is no room.
    ///
    /// A function of its own in the image: the bench finds it by its name.
    #[inline(never)]
    pub fn push(&mut self, block: Block) -> bool {
        let pushed = self.0.push(block).is_ok();
        if pushed {
            lookahead::replan(self);
        }
        pushed
    }
}

impl lookahead::Queue for BlockQueue {
    fn block(&self, back: usize) -> Option<&Block> {
        self.0.pushed(back)
    }

    fn set_entry(&mut self, back: usize, velocity: f32) -> bool {
        exec::lock(|ceiling| self.0.amend(ceiling, back, |block| block.entry = velocity))
    }
}
