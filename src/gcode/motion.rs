//! Group 1: from axis words to a target, and from F to a feed.

use super::block::{Block, slot};
use super::command::{Commands, Feed, Motion};
use super::interpreter::{Interpreter, exact};
use super::modal::{Distance, FeedMode, MotionMode, Units};
use crate::status::Status;
use crate::units::{FIRST_ROTARY, Length, PerAxis};

impl Interpreter {
    /// The move of a line, if it has one: axis words move in the mode in force, unless a non-modal
    /// code has taken them.
    pub(super) fn motion(&mut self, block: &mut Block, out: &mut Commands) -> Result<(), Status> {
        let mode = block.motion.unwrap_or(self.modal.motion);
        self.modal.motion = mode;
        if block.non_modal.is_some_and(|code| code.uses_axes()) {
            return match block.motion {
                None | Some(MotionMode::None) => Ok(()),
                Some(_) => Err(Status::ModalGroupViolation),
            };
        }
        out.motion = match mode {
            MotionMode::None => Motion::None,
            MotionMode::Traverse => self.traverse(block)?,
            MotionMode::Feed => self.straight_feed(block)?,
            MotionMode::ClockwiseArc => self.arc(block, true)?,
            MotionMode::CounterclockwiseArc => self.arc(block, false)?,
        };
        if self.modal.feed_mode == FeedMode::InverseTime {
            // An F that no feed move took means nothing with G93.
            block.take(slot::F);
        }
        Ok(())
    }

    fn traverse(&mut self, block: &mut Block) -> Result<Motion, Status> {
        if !block.has(slot::AXES) {
            return Ok(Motion::None);
        }
        self.advance(block)?;
        Ok(Motion::Traverse { target: self.position })
    }

    fn straight_feed(&mut self, block: &mut Block) -> Result<Motion, Status> {
        let moves = block.has(slot::AXES);
        if !moves && block.motion.is_none() {
            return Ok(Motion::None);
        }
        let start = self.position;
        self.advance(block)?;
        let feed = self.rate(block, turns_only(&start, &self.position))?;
        Ok(if moves { Motion::Feed { target: self.position, feed } } else { Motion::None })
    }

    /// Moves the model by the axis words.
    pub(super) fn advance(&mut self, block: &mut Block) -> Result<(), Status> {
        let axes = self.position.iter_mut().zip(&mut self.residue).zip(&self.offset);
        for (axis, ((position, residue), offset)) in (0..).zip(axes) {
            let Some(word) = block.take(axis) else { continue };
            let word = exact(&word, axis, self.modal.units)?;
            let (from, by) = match self.modal.distance {
                Distance::Absolute => (*offset, Some(word)),
                Distance::Incremental => (*position, word.carry(*residue)),
            };
            let target = by.and_then(|by| Some((from.checked_add(by.units)?, by.rest)));
            (*position, *residue) = target.ok_or(Status::OutOfRange)?;
        }
        Ok(())
    }

    /// The feed of a move; 142 if there is none.
    pub(super) fn rate(&self, block: &mut Block, rotary: bool) -> Result<Feed, Status> {
        let per_minute = match self.modal.feed_mode {
            FeedMode::PerMinute => self.feed,
            FeedMode::InverseTime => match block.take(slot::F) {
                Some(value) if value.negative => return Err(Status::OutOfRange),
                Some(value) => value.to_f32(),
                None => 0.0,
            },
        };
        if per_minute <= 0.0 {
            return Err(Status::FeedrateMissing);
        }
        Ok(match self.modal.feed_mode {
            FeedMode::InverseTime => Feed::Minutes(1.0 / per_minute),
            FeedMode::PerMinute => Feed::PerMinute(match self.feed_units {
                Units::Inch if !rotary => per_minute * 25.4,
                _ => per_minute,
            }),
        })
    }
}

/// Whether a move turns rotary axes and nothing else: F is then degrees per minute, in all units.
fn turns_only(start: &PerAxis<Length>, target: &PerAxis<Length>) -> bool {
    let differs = |(a, b): (&Length, &Length)| a != b;
    let mut linear = start.iter().zip(target).take(FIRST_ROTARY);
    let mut rotary = start.iter().zip(target).skip(FIRST_ROTARY);
    !linear.any(differs) && rotary.any(differs)
}
