//! From a straight move to a block: length, limits along the path, junction, steps.
//!
//! Called by the planner task. Owns the direction of the last move and the motor positions at the
//! end of the last block. Costs are AVR cycles.
//!
//! Steps are the difference of two exact absolute positions, so neither rounding errors nor moves shorter than a step
//! accumulate. A move without any steps (shorter than a step, or of an axis without a motor) is still a block that
//! takes its time; otherwise the next step would come too early. A fast move of less than half a step is merged with
//! the next one ([`Built::Merge`]). A block stores where between two steps its motors arrive, to 1/16 step. So each
//! motor position is known even when coordinates are redefined.
//!
//! A ramp may go over many blocks. Each block has its own acceleration limit: what its axes allow in its direction.

use super::blend::{BLENDS, is_dense};
use super::block::{Block, Extent, Line as Move, QueuedAction};
use super::curve::{Bend, Curve};
use super::dynamics::Dynamics;
use super::factors::Reserve;
use super::float::{least, some};
use super::junction::{self, Heading, Velocities};
use super::limits::LastFeed;
use super::path::{Path, Way};
use super::steps::Motor;
use crate::boards::{MOTORS, each_motor};
use crate::capability::Capability;
use crate::config::StepRatio;
use crate::gcode::command::Feed;
use crate::kinematics;
use crate::units::{Length, PerAxis};

/// Most steps of a motor in a block: phase units of a block fit 30 bits.
pub const STEPS_MAX: u16 = 0x7FFF;

/// What the builder needs to know of the motors.
pub trait Motors {
    /// What a motor drives: an axis, or X and Y together ([`kinematics`]).
    fn motor_axis(&self, motor: usize) -> u8;
    /// Steps of a motor for the travel of what it drives.
    fn ratio(&self, motor: usize) -> StepRatio;
}

/// A straight move.
#[derive(Clone, Copy, Debug)]
pub struct Line<'a> {
    /// Where the last move ended.
    pub from: &'a PerAxis<Length>,
    /// Where this one ends.
    pub to: &'a PerAxis<Length>,
    /// How fast; a traverse if `None`. Positive: the interpreter refuses a feed of 0.
    pub feed: Option<Feed>,
    /// The arc of which the move is a chord, if it is one.
    pub curve: Option<&'a Curve>,
    /// Whether the move may be merged with the next one.
    pub may_merge: bool,
    /// Whether the move is to be [blended](super::blend), unless it is too short for its velocity.
    pub blends: bool,
}

/// The result of building a move.
#[derive(Clone, Copy, Debug)]
pub enum Built {
    /// The move has no length.
    Nothing,
    /// A block. The value is the velocity limit of the corner before it, mm/s; it may be above any velocity of the
    /// block, and is then no limit.
    Line(f32),
    /// A block that is to be blended. The value says whether it begins at a standstill.
    Blended(bool),
    /// More steps than a block holds: the move must be divided into this many parts.
    Parts(u16),
    /// The move is less than half a step, and shorter than exec needs to prepare it: the next move begins where this
    /// move begins. The travel of each axis fits 16 bits.
    Merge,
}

/// Makes blocks.
#[derive(Clone, Copy, Debug, Default)]
// In this order: AVR reaches a field within 63 bytes of the first in one instruction.
#[repr(C)]
pub struct Builder {
    /// The highest velocity possible in the last move, mm/s; 0 if the machine stands still after it.
    top: f32,
    /// The feed of the last move.
    feed: LastFeed,
    /// The direction of the last move.
    heading: Heading,
    /// Motors at the end of the last block.
    motors: [Motor; MOTORS],
    /// The curvature of the path so far.
    bend: Bend,
}

impl Builder {
    /// Makes the block for a move, and writes it to `out` if it returns [`Built::Line`]. Otherwise nothing is changed.
    ///
    /// Cost: 3,500 + 1,300 for each axis that moves with its motor, for short moves.
    #[inline(never)]
    pub fn line(
        &mut self,
        line: &Line,
        dynamics: &Dynamics,
        machine: &impl Motors,
        out: &mut Move,
    ) -> Built {
        let mut path = Path::default();
        match path.measure(line.from, line.to) {
            Way::None => return Built::Nothing,
            Way::Far => return Built::Parts(2),
            Way::Near => {}
        }
        out.way = [0; MOTORS];
        let driven = path.drive(&mut self.motors, line.to, dynamics, machine, &mut out.way);
        let near = driven == MOTORS as u8;
        if !near {
            self.undo(driven, &path, line, dynamics, machine, &out.way);
            let parts = self.stride(&mut path, line, dynamics, machine, &mut out.way);
            if parts > 0 {
                return Built::Parts(parts);
            }
        }
        out.extent = Extent::new(path.length, !near);
        path.limit(line.feed, &mut self.feed, dynamics);
        if line.may_merge && path.is_brief() {
            self.undo(driven, &path, line, dynamics, machine, &out.way);
            return Built::Merge;
        }
        path.limit_change(dynamics);
        // The chords of an arc have its limits, and no corners between them.
        let goes_on = matches!(line.curve, Some(curve) if curve.goes_on);
        let blends = BLENDS && line.blends && !is_dense(path.length, path.cruise);
        let turned = match line.curve {
            Some(curve) => {
                self.bend.chord(&mut path, curve);
                if goes_on { 0 } else { junction::turn(&self.heading.unit, &path.heading.unit) }
            }
            None if some(self.top) && !blends => self.bend.line(&self.heading, &mut path, dynamics),
            None => {
                self.bend = Bend::default();
                0
            }
        };
        path.limit_steps(&dynamics.rates, line.curve.is_some());
        let mut entry = least(path.top, self.top);
        if some(entry) && !goes_on && !blends {
            let deviations = (self.heading.deviation, path.heading.deviation);
            let velocities = Velocities { cruise: path.cruise, top: entry };
            entry = junction::limit(turned, deviations, dynamics.junction, &velocities);
            if dynamics.rounds {
                let units = (&self.heading.unit, &path.heading.unit);
                entry = junction::limit_axes(units, turned, dynamics, least(entry, velocities.top));
            }
        }
        self.heading = path.heading;
        self.top = path.top;
        out.reserve = match line.feed {
            Some(_) => Reserve::new(path.cruise, path.top),
            None => Reserve::TRAVERSE,
        };
        out.cruise = path.cruise;
        out.accel = path.accel;
        if blends { Built::Blended(!some(entry)) } else { Built::Line(entry) }
    }

    /// Moves in whole steps, for distances too long for parts of a step; motors keep their fraction of a step. Returns
    /// 0, or the number of parts in which the steps would fit blocks; nothing has moved then.
    #[inline(never)]
    #[small]
    fn stride(
        &mut self,
        path: &mut Path,
        line: &Line,
        dynamics: &Dynamics,
        machine: &impl Motors,
        steps: &mut [i16; MOTORS],
    ) -> u16 {
        *steps = [0; MOTORS];
        (path.most, path.moving, path.whole_steps) = (0, 0, true);
        let before = self.motors;
        let mut parts = 0;
        for (m, motor) in self.motors.iter_mut().enumerate() {
            let drives = dynamics.drives[m];
            let place = |at| kinematics::place_of(drives, at);
            let (Some(from), Some(to)) = (place(line.from), place(line.to)) else { continue };
            if from == to {
                continue;
            }
            let way = motor.stride(machine.ratio(m), to);
            let size = way.unsigned_abs();
            if size > u64::from(STEPS_MAX) {
                parts = parts.max(parts_of(size));
            }
            steps[m] = way as i16;
            path.go(size as u16);
        }
        if parts > 0 {
            self.motors = before;
        }
        parts
    }

    /// Moves the first `driven` motors back to where the move begins. `ways` are the distances they have moved, in
    /// parts of a step. Cost: 1,500 for each motor that has moved.
    #[inline(never)]
    #[small]
    fn undo(
        &mut self,
        driven: u8,
        path: &Path,
        line: &Line,
        dynamics: &Dynamics,
        machine: &impl Motors,
        ways: &[i16; MOTORS],
    ) {
        let all = self.motors.iter_mut().zip(ways).zip(&dynamics.drives);
        for (m, ((motor, &way), &drives)) in all.enumerate().take(driven.into()) {
            let from = kinematics::place_of(drives, line.from);
            match (from, kinematics::travel(drives, &path.travel)) {
                (Some(from), Some(travel)) if travel != 0 => {
                    motor.put_back(machine.ratio(m), from, way);
                }
                _ => {}
            }
        }
    }

    /// The direction of the last move.
    pub fn unit(&self) -> &PerAxis<i16> {
        &self.heading.unit
    }

    /// Notes that the next move starts from rest.
    pub fn stopped(&mut self) {
        self.top = 0.0;
    }

    /// Returns the block that renames the present position. Motors without an axis keep their positions.
    #[small]
    pub fn set_position(
        &mut self,
        position: &PerAxis<Length>,
        machine: &impl Motors,
    ) -> QueuedAction {
        for (m, motor) in self.motors.iter_mut().enumerate() {
            if let Some(position) = kinematics::place_of(machine.motor_axis(m), position) {
                motor.rename(machine.ratio(m), position);
            }
        }
        self.stopped();
        QueuedAction::SetPosition(self.motors.map(|motor| motor.steps()))
    }

    /// Notes that the machine stands still, with its motors at these steps.
    #[small]
    pub fn place(&mut self, steps: &[i32; MOTORS]) {
        self.motors = steps.map(Motor::counted);
        self.stopped();
    }

    /// Returns the block for an action that is done at a standstill.
    pub fn pause(&mut self, action: QueuedAction, line: u32) -> Block {
        self.stopped();
        Block::action(action, line)
    }
}

/// Returns into how many parts of at most [`STEPS_MAX`] steps a distance divides.
#[inline(never)]
fn parts_of(steps: u64) -> u16 {
    // Rounding the ends of a part may add a step.
    u16::try_from(steps / u64::from(STEPS_MAX - 1) + 1).unwrap_or(u16::MAX)
}

impl Path {
    /// Moves the motors to the end of the move, and writes the distance of each to `ways`, in parts of a step. Returns
    /// how many motors have been moved: all, or those before the first whose distance does not fit.
    #[inline(never)]
    fn drive(
        &mut self,
        motors: &mut [Motor; MOTORS],
        to: &PerAxis<Length>,
        dynamics: &Dynamics,
        machine: &impl Motors,
        ways: &mut [i16; MOTORS],
    ) -> u8 {
        let mut drive = |m: usize| {
            let drives = dynamics.drives[m];
            let travel = kinematics::travel(drives, &self.travel).filter(|way| *way != 0);
            let (Some(travel), Some(to)) = (travel, kinematics::place(drives, to)) else {
                return true;
            };
            let parts = motors[m].go(machine.ratio(m), travel, to);
            let way = parts.unwrap_or_default();
            ways[m] = way;
            self.go(way.unsigned_abs());
            parts.is_some()
        };
        if Capability::CoreXy.is_built_in() {
            for m in 0..MOTORS {
                if !drive(m) {
                    return m as u8;
                }
            }
        } else {
            // Without a loop this takes 190 cycles less. With CoreXY it would take 1,000 bytes more.
            each_motor!(M => if !drive(M) {
                return M as u8;
            });
        }
        MOTORS as u8
    }

    /// Takes into account that a motor moves by `way`.
    #[inline(always)]
    fn go(&mut self, way: u16) {
        if way != 0 {
            self.moving += 1;
            self.most = self.most.max(way);
        }
    }
}
