//! Group 1: computes the target of a move from the axis words, and its feed from F.

use super::axes;
use super::block::Block;
use super::codes::NonModal;
use super::command::{Commands, Feed, Motion};
use super::modal::{Distance, FeedMode, MotionMode, Turn, Units};
use super::printing::EXTRUDER;
use super::setup::Setup;
use super::state::State;
use super::words::{AXES, F, ROTARY};
use crate::capability::Capability;
use crate::status::Status;
use crate::units::{FIRST_ROTARY, Length};

/// The least length of a probing move: 0.254 mm, in units (RS274/NGC 3.5.9).
const PROBE_MIN: u32 = 2_540;

impl State {
    /// Carries out the move of a line, if it has one. Axis words without a motion code move in the mode in force,
    /// unless another code has taken them.
    #[inline(never)]
    pub(super) fn motion(
        &mut self,
        block: &Block,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        let absolute = block.non_modal == Some(NonModal::MachineCoordinates);
        let Some(mode) = block.does() else {
            return if absolute { Err(Status::MachineCoordinatesMotion) } else { Ok(()) };
        };
        if absolute && !matches!(mode, MotionMode::Traverse | MotionMode::Feed) {
            return Err(Status::MachineCoordinatesMotion);
        }
        self.modal.motion = mode;
        match mode {
            MotionMode::None => Ok(()),
            MotionMode::Traverse => self.traverse(block, absolute, setup, out),
            MotionMode::Feed => self.straight_feed(block, absolute, setup, out),
            MotionMode::ClockwiseArc => self.arc(block, true, setup, out),
            MotionMode::CounterclockwiseArc => self.arc(block, false, setup, out),
            MotionMode::ProbeTowards
            | MotionMode::ProbeTowardsQuietly
            | MotionMode::ProbeAway
            | MotionMode::ProbeAwayQuietly => self.probe(block, mode, setup, out),
            MotionMode::Thread => self.thread(block, false, setup, out),
            MotionMode::RigidTap => self.thread(block, true, setup, out),
            MotionMode::ThreadCycle => self.thread_cycle(block, setup, out),
            // Canned cycles are carried out by `cycle_motion`.
            _ => Err(Status::InternalError),
        }
    }

    /// Carries out the canned cycle of a line.
    #[inline(never)]
    #[small]
    pub(super) fn cycle_motion(
        &mut self,
        block: &Block,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        if block.non_modal == Some(NonModal::MachineCoordinates) {
            return Err(Status::MachineCoordinatesMotion);
        }
        let Some(mode) = block.does() else { return Err(Status::InternalError) };
        let before = if block.cancels() { MotionMode::None } else { self.modal.motion };
        self.modal.motion = mode;
        self.cycle(block, mode, before, setup, out)
    }

    #[inline(never)]
    fn traverse(
        &mut self,
        block: &Block,
        absolute: bool,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        if block.has(AXES) {
            self.advance(block, absolute, setup)?;
            out.motion = Motion::Traverse { target: self.position };
        }
        Ok(())
    }

    #[inline(never)]
    fn straight_feed(
        &mut self,
        block: &Block,
        absolute: bool,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        let moved = self.advance(block, absolute, setup)?;
        // If only rotary axes move, F is in degrees per minute, with G20 too.
        let feed = self.rate(block, moved.rotary && !moved.linear)?;
        if block.has(AXES) {
            out.motion = Motion::Feed { target: self.position, feed };
        }
        Ok(())
    }

    /// Carries out G38.2 to G38.5 (RS274/NGC 3.5.9).
    #[inline(never)]
    #[small]
    fn probe(
        &mut self,
        block: &Block,
        mode: MotionMode,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        Capability::Probing.check()?;
        if !setup.has_probe() {
            return Err(Status::ProbeFailed);
        }
        if block.has(ROTARY) {
            return Err(Status::RotaryNotAllowed);
        }
        if !block.has(AXES) {
            return Err(Status::AxisWordMissing);
        }
        if self.modal.feed_mode == FeedMode::InverseTime {
            return Err(Status::InverseTimeNotAllowed);
        }
        let feed = self.rate(block, false)?;
        let start = self.position;
        self.advance(block, false, setup)?;
        let target = self.position;
        // The longest distance of an axis stands for the length of the move. It is right within a factor of 1.7.
        let way = |(a, b): (&Length, &Length)| a.0.abs_diff(b.0);
        if start.iter().zip(&target).map(way).max().unwrap_or(0) < PROBE_MIN {
            return Err(Status::ProbeTooShort);
        }
        out.motion = Motion::Probe { target, feed, mode };
        Ok(())
    }

    /// Moves the model by the axis words. With `absolute` they are machine coordinates. Returns the kinds of axes that
    /// move.
    #[inline(never)]
    pub(super) fn advance(
        &mut self,
        block: &Block,
        absolute: bool,
        setup: &impl Setup,
    ) -> Result<Moved, Status> {
        let mut moved = Moved::default();
        for (axis, word) in block.axes() {
            let i = usize::from(axis);
            let (Some(position), Some(residue)) =
                (self.position.get_mut(i), self.residue.get_mut(i))
            else {
                break;
            };
            let Some(mut by) = axes::value(word, axis, self.modal.units, setup)? else { continue };
            let extrudes = i == EXTRUDER && !self.printing.is_usual();
            let distance = match self.printing.distance() {
                Some(own) if extrudes => own,
                _ => self.modal.distance,
            };
            let from = match distance {
                _ if absolute => Length::ZERO,
                Distance::Absolute => self.origin.get(i).copied().unwrap_or_default(),
                Distance::Incremental => {
                    by = by.carry(*residue).ok_or(Status::OutOfRange)?;
                    *position
                }
            };
            let target = from.checked_add(by.units).ok_or(Status::OutOfRange)?;
            if extrudes {
                let end = self.flow_to(target)?;
                if let (Some(position), Some(residue)) =
                    (self.position.get_mut(i), self.residue.get_mut(i))
                {
                    moved.rotary |= end != *position;
                    (*position, *residue) = (end, by.rest);
                }
                continue;
            }
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

    /// Returns the feed of a move, or error 142 if no feed is in force. `rotary` says that only rotary axes move.
    pub(super) fn rate(&self, block: &Block, rotary: bool) -> Result<Feed, Status> {
        let rate = match self.modal.feed_mode {
            FeedMode::InverseTime => block.get(F).map_or(0.0, |value| value.to_f32()),
            _ => self.feed,
        };
        // The rate is neither negative nor NaN, so a comparison of its bits with 0 is right, and cheaper.
        if rate.to_bits() == 0 {
            return Err(Status::FeedrateMissing);
        }
        let rate = match self.feed_units {
            _ if self.modal.feed_mode == FeedMode::InverseTime => {
                return Ok(Feed::Minutes(1.0 / rate));
            }
            Units::Inch if !rotary => rate * 25.4,
            _ => rate,
        };
        match self.modal.feed_mode {
            FeedMode::PerTurn => self.per_turn(rate),
            _ => Ok(Feed::PerMinute(rate)),
        }
    }

    /// Converts a feed of G95 to a feed per minute at the commanded speed of the spindle.
    #[inline(never)]
    fn per_turn(&self, rate: f32) -> Result<Feed, Status> {
        if self.modal.spindle == Turn::Off {
            return Err(Status::SpindleMustTurn);
        }
        if self.speed.to_bits() == 0 {
            return Err(Status::SWordMissing);
        }
        let [x, ..] = self.position;
        let turns = self.surface().map_or(self.speed, |surface| surface.turns(x));
        Ok(Feed::PerMinute(rate * turns))
    }
}

/// The kinds of axes that a line moves.
#[derive(Clone, Copy, Default)]
pub(super) struct Moved {
    linear: bool,
    rotary: bool,
}
