//! O words: which line comes next. Subroutines, loops and conditions, also over a stream that cannot be read twice.
//!
//! A subroutine is recorded while it comes, and runs when it is called. The first pass of a loop runs while its lines
//! come, and they are recorded; at the end of the loop the others are replayed. Lines of a branch that does not run are
//! skipped: only their O words are looked at. During a replay [`Flow::is_replay`] is true: the caller asks for line after
//! line, does other work in between, and answers the line that has begun the replay when it is over.
//!
//! If a line of a loop or a subroutine is refused while it is recorded, the record is [broken](Flow::is_broken): all lines
//! are refused up to the end of that loop or subroutine, because a part of it would do something else. If a line of a
//! replay is refused, the replay and all its loops and calls end. The end of a program and [`Flow::clear`] forget all.

use super::oword::Label;
use super::record::Record;
use crate::status::Status;

/// How many blocks may be within each other, those of calls counted too.
pub const BLOCKS: usize = 20;
/// How many calls may be within each other.
pub const CALLS: usize = 9;

/// What a block is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// `if`. The payload of no other block is in use.
    If,
    /// `while`.
    While,
    /// `do`.
    Do,
    /// `repeat`.
    Repeat,
}

/// A block whose end has not come.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Block {
    /// What names it.
    pub label: Label,
    /// What it is.
    pub kind: Kind,
    /// Of a loop: the line with which the next pass begins.
    pub start: u16,
    /// Of a repeat: how many passes there are, with this one.
    pub count: i32,
}

impl Block {
    /// In places that are not in use.
    const NONE: Self = Self { label: Label::NONE, kind: Kind::If, start: 0, count: 0 };
}

/// A call whose return has not come.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Call {
    /// The line behind it in the record; `None` if it has come from the sender.
    back: Option<u16>,
    /// How many blocks there were.
    depth: u8,
}

/// The lines that are skipped.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Skip {
    /// None.
    Nothing,
    /// Those up to the next branch of a condition.
    ToBranch(Label),
    /// Those up to the end of a block, which then ends.
    ToEnd(Label),
    /// Those up to the end of a loop, whose next pass may begin then.
    ToPass(Label),
}

/// Which line comes next.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Flow {
    /// The recorded lines.
    pub record: Record,
    blocks: [Block; BLOCKS],
    depth: u8,
    calls: [Call; CALLS],
    level: u8,
    /// The next line of the replay.
    next: Option<u16>,
    /// The lines that are skipped.
    pub skip: Skip,
    /// A loop is recorded: its first pass has not ended.
    pub records: bool,
    /// The subroutine that is recorded.
    pub defines: Option<Label>,
    /// The block or subroutine of which a line has been refused.
    broken: Option<Label>,
}

impl Flow {
    /// Each line comes from the sender, and there are no subroutines.
    pub const NONE: Self = Self {
        record: Record::NONE,
        blocks: [Block::NONE; BLOCKS],
        depth: 0,
        calls: [Call { back: None, depth: 0 }; CALLS],
        level: 0,
        next: None,
        skip: Skip::Nothing,
        records: false,
        defines: None,
        broken: None,
    };

    /// Forgets all.
    pub fn clear(&mut self) {
        *self = Self::NONE;
    }

    /// Ends the replay and all blocks. Subroutines stay.
    pub fn stop(&mut self) {
        self.record.drop_loop();
        let record = self.record;
        *self = Self { record, ..Self::NONE };
    }

    /// Whether lines are more than lines that run as they come.
    #[inline(always)]
    pub fn takes_all(&self) -> bool {
        self.depth > 0 || self.next.is_some() || self.defines.is_some() || self.broken.is_some()
    }

    /// Whether there is anything to forget at the end of a program.
    pub fn is_busy(&self) -> bool {
        self.takes_all() || self.record.has_subs()
    }

    /// Whether the next line is one of the record.
    #[inline(always)]
    pub fn is_replay(&self) -> bool {
        self.next.is_some()
    }

    /// Returns the next line of the replay.
    pub fn next(&self) -> Option<u16> {
        self.next
    }

    /// Sets the next line of the replay. At the end of the record, the next line comes from the sender.
    pub fn go_to(&mut self, at: Option<u16>) {
        self.next = at.filter(|at| *at < self.record.end());
    }

    /// How many calls there are within each other.
    pub fn level(&self) -> u8 {
        self.level
    }

    /// Whether a block or subroutine is refused up to its end.
    pub fn is_broken(&self) -> bool {
        self.broken.is_some()
    }

    /// Whether the block or subroutine that is refused has this label.
    pub fn is_broken_by(&self, label: Label) -> bool {
        self.broken == Some(label)
    }

    /// Has all lines refused up to the end of the outermost loop, or of a subroutine. `begun`: the loop whose first line
    /// has been refused.
    pub fn break_off(&mut self, begun: Option<Label>) {
        let outermost = self.blocks().iter().find(|block| block.kind != Kind::If);
        self.broken = self.defines.or(outermost.map(|block| block.label)).or(begun);
    }

    /// Begins a block.
    pub fn open(&mut self, block: Block) -> Result<(), Status> {
        if self.blocks().iter().skip(self.floor()).any(|other| other.label == block.label) {
            return Err(Status::OWordInvalid);
        }
        let place = self.blocks.get_mut(usize::from(self.depth)).ok_or(Status::FlowTooDeep)?;
        *place = block;
        self.depth += 1;
        Ok(())
    }

    fn blocks(&self) -> &[Block] {
        self.blocks.get(..self.depth.into()).unwrap_or_default()
    }

    /// Returns the number of blocks that belong to callers.
    fn floor(&self) -> usize {
        let call = usize::from(self.level).checked_sub(1).and_then(|at| self.calls.get(at));
        call.map_or(0, |call| call.depth.into())
    }

    /// Returns the innermost block if it has this label.
    pub fn top(&self, label: Label) -> Option<Block> {
        let own = self.blocks().get(self.floor()..)?;
        own.last().filter(|block| block.label == label).copied()
    }

    /// Ends the innermost block.
    pub fn close(&mut self) {
        self.depth = self.depth.saturating_sub(1);
        self.free(self.depth);
    }

    /// Ends the blocks within the loop of this label. Returns false if there is no such `while` or `do`.
    pub fn close_to(&mut self, label: Label) -> bool {
        let floor = self.floor();
        let is =
            |block: &Block| block.label == label && matches!(block.kind, Kind::While | Kind::Do);
        let Some(at) = self.blocks().iter().skip(floor).position(is) else { return false };
        self.free((floor + at + 1) as u8);
        true
    }

    /// Makes places of blocks as if they had never been in use.
    fn free(&mut self, depth: u8) {
        self.blocks.iter_mut().skip(depth.into()).for_each(|block| *block = Block::NONE);
        self.depth = depth;
    }

    /// Counts a pass of the innermost block, a repeat. Returns whether there is another one.
    pub fn count(&mut self) -> bool {
        let top = usize::from(self.depth).checked_sub(1).and_then(|at| self.blocks.get_mut(at));
        top.is_some_and(|block| {
            block.count -= 1;
            block.count > 0
        })
    }

    /// Whether a loop has begun and not ended, at any level.
    fn loops(&self) -> bool {
        self.blocks().iter().any(|block| block.kind != Kind::If)
    }

    /// Begins a call: `start` is the first line of the subroutine.
    pub fn call(&mut self, start: u16) -> Result<(), Status> {
        let call = self.calls.get_mut(usize::from(self.level)).ok_or(Status::FlowTooDeep)?;
        *call = Call { back: self.next, depth: self.depth };
        self.level += 1;
        self.next = Some(start);
        Ok(())
    }

    /// Ends a call. Returns false if there is none.
    pub fn call_ends(&mut self) -> bool {
        let Some(at) = self.level.checked_sub(1) else { return false };
        if let Some(call) = self.calls.get_mut(usize::from(at)) {
            let Call { back, depth } = core::mem::replace(call, Call { back: None, depth: 0 });
            self.free(depth);
            self.next = back;
            self.go_to(back);
        }
        self.level = at;
        true
    }

    /// Forgets the recorded loop when it has ended.
    pub fn settle(&mut self) {
        if self.records && self.next.is_none() && !self.loops() {
            self.records = false;
            self.record.drop_loop();
        }
    }
}
