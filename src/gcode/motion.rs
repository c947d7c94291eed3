//! Group 1: from axis words to a target, and from F to a feed.

use super::axes::{self, Axes};
use super::block::{Block, slot};
use super::command::{Commands, Feed, Motion};
use super::interpreter::Interpreter;
use super::modal::{Distance, FeedMode, MotionMode, Units};
use crate::status::Status;
use crate::units::FIRST_ROTARY;

impl Interpreter {
    /// The move of a line, if it has one: axis words move in the mode in force, unless a non-modal
    /// code has taken them.
    pub(super) fn motion(
        &mut self,
        block: &mut Block,
        axes: &impl Axes,
        out: &mut Commands,
    ) -> Result<(), Status> {
        let mode = block.motion.unwrap_or(self.modal.motion);
        self.modal.motion = mode;
        if block.non_modal.is_some_and(|code| code.uses_axes()) {
            return match block.motion {
                None | Some(MotionMode::None) => Ok(()),
                Some(_) => Err(Status::ModalGroupViolation),
            };
        }
        match mode {
            MotionMode::None => {}
            MotionMode::Traverse => self.traverse(block, axes, out)?,
            MotionMode::Feed => self.straight_feed(block, axes, out)?,
            MotionMode::ClockwiseArc => self.arc(block, true, axes, out)?,
            MotionMode::CounterclockwiseArc => self.arc(block, false, axes, out)?,
        }
        if self.modal.feed_mode == FeedMode::InverseTime {
            // An F that no feed move took means nothing with G93.
            block.take(slot::F);
        }
        Ok(())
    }

    fn traverse(
        &mut self,
        block: &mut Block,
        axes: &impl Axes,
        out: &mut Commands,
    ) -> Result<(), Status> {
        if block.has(slot::AXES) {
            self.advance(block, axes)?;
            out.motion = Motion::Traverse { target: self.position };
        }
        Ok(())
    }

    fn straight_feed(
        &mut self,
        block: &mut Block,
        axes: &impl Axes,
        out: &mut Commands,
    ) -> Result<(), Status> {
        let moves = block.has(slot::AXES);
        if !moves && block.motion.is_none() {
            return Ok(());
        }
        let moved = self.advance(block, axes)?;
        // Of rotary axes alone, F is the degrees per minute, in all units.
        let feed = self.rate(block, moved.rotary && !moved.linear)?;
        if moves {
            out.motion = Motion::Feed { target: self.position, feed };
        }
        Ok(())
    }

    /// Moves the model by the axis words.
    pub(super) fn advance(&mut self, block: &mut Block, axes: &impl Axes) -> Result<Moved, Status> {
        let mut moved = Moved::default();
        for (axis, word) in block.take_axes() {
            let i = usize::from(axis);
            let (Some(position), Some(residue)) =
                (self.position.get_mut(i), self.residue.get_mut(i))
            else {
                break;
            };
            let Some(mut by) = axes::value(word, axis, self.modal.units, axes)? else { continue };
            let from = match self.modal.distance {
                Distance::Absolute => self.offset.get(i).copied().unwrap_or_default(),
                Distance::Incremental => {
                    by = by.carry(*residue).ok_or(Status::OutOfRange)?;
                    *position
                }
            };
            let target = from.checked_add(by.units).ok_or(Status::OutOfRange)?;
            if target != *position {
                match i {
                    ..FIRST_ROTARY => moved.linear = true,
                    _ => moved.rotary = true,
                }
            }
            (*position, *residue) = (target, by.rest);
        }
        Ok(moved)
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
        // Neither negative nor NaN, so the bits tell as much as a comparison, and cost less.
        if per_minute.to_bits() == 0 {
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

/// Which kinds of axes a line moves.
#[derive(Clone, Copy, Default)]
pub(super) struct Moved {
    linear: bool,
    rotary: bool,
}
