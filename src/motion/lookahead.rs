//! Look-ahead: entry velocities from which the machine can always slow down in time.
//!
//! Called by the planner task after each push of a block. Backwards only: whether the machine can
//! speed up so far is for exec to see, which enters each block with the velocity it has, at most
//! the planned one. Units: mm, s. Costs are AVR cycles.
//!
//! **What holds between calls.** With `exit` = the entry velocity of the block behind it, 0 for the
//! newest, every block the pass may still change has
//!
//! ```text
//! entry = min(entry_max, brake(exit, length))        0 if it is not a line
//! ```
//!
//! **Why the pass may stop early.** A block's entry is a function of that block's constants and of
//! the entry behind it, nothing else. A push changes one thing: the block that was the newest, and
//! had `exit` 0, now has the new block's entry as its `exit`. So if the new block's entry is 0, or
//! once a block's recomputed entry is what it was, no equation further ahead has changed. If exec
//! has committed itself to a block's entry, that entry stays what exec believes, and the equations
//! further ahead still hold with it; the block itself may then be left faster than it was planned
//! for, which [`brake`] allows for.
//!
//! Entries may be read by exec in the middle of a pass: newest first means that a block's `exit`
//! rises before its entry does.

use super::block::{Block, Kind};
use super::profile::{Limits, brake, lesser};

/// The blocks between planner and exec, seen from the planner.
pub trait Queue {
    /// A block; 0 is the newest. `None` if exec has taken it away.
    fn block(&self, back: usize) -> Option<&Block>;
    /// Plans a block's entry velocity. False, and nothing done, if exec has committed itself to the
    /// present one: the block is gone or running, or the one before it is too far run.
    fn set_entry(&mut self, back: usize, velocity: f32) -> bool;
}

/// Plans the entry velocities anew after a push. The entry of the pushed block does not matter.
///
/// Cost: for each block that it visits 300, or up to 6,000 for one whose length limits its entry.
/// It visits the new block, those whose entry changes, and one more.
pub fn replan(queue: &mut impl Queue) {
    let mut exit = 0.0;
    let mut back = 0;
    while let Some(block) = queue.block(back) {
        let entry = entry(block, exit);
        if back > 0 && entry == block.entry {
            return;
        }
        // The block before the new one has been planned to end at rest.
        if !queue.set_entry(back, entry) || (back == 0 && entry == 0.0) {
            return;
        }
        exit = entry;
        back += 1;
    }
}

/// The highest entry velocity of a block that is left at `exit`.
fn entry(block: &Block, exit: f32) -> f32 {
    if block.kind != Kind::Line || block.entry_max <= 0.0 {
        return 0.0;
    }
    // Nothing to slow down for; `brake` is never below `exit`.
    if exit >= block.entry_max {
        return block.entry_max;
    }
    let limits = Limits { accel: block.accel, jerk: block.jerk };
    lesser(brake(exit, block.length, &limits), block.entry_max)
}
