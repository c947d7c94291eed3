//! A block: one straight move, dwell or synchronised command, as the planner leaves it for exec.
//!
//! Units: mm (degrees for a rotary-only move), seconds, motor steps. The size of a block bounds the look-ahead: RAM
//! holds 62 of them on AVR. So limits take two bytes each, and the line number three. The sign of a length tells in
//! which unit distances are counted ([`Extent`]). A line needs no tag, because no line has a [`Reserve`] of 0. A block
//! has 30 bytes on AVR.

use super::advance::Lead;
use super::backlash::Slack;
use super::factors::{Factors, Reserve};
use super::float::size;
use super::pace::Drivers;
use super::retract::Retract;
use super::short::Short;
use super::smooth::Spans;
use super::snapshot::Origin;
use crate::boards::MOTORS;
use crate::gcode::command::Surface;
use crate::gcode::heating::Heat;
use crate::gcode::overrides::Change;

/// Ends of blocks are stored to 1/16 step. This is the logarithm of the number of parts of a step.
pub const PARTS_LOG2: u8 = 4;

/// The least and the greatest fraction at a block's end, in 1/16 step from the nearest whole step. Both are less than
/// half a step, so that rounding errors cannot change which whole step is the nearest.
pub const FRACTIONS: (i8, i8) = (-7, 6);

/// A block of the queue.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// What the block does.
    pub body: Body,
    line: Number,
}

impl Block {
    /// Whether the block is an action that does not stop the machine.
    #[inline(never)]
    #[small]
    pub fn is_aside(&self) -> bool {
        matches!(
            self.body,
            Body::QueuedAction(
                QueuedAction::Override(_)
                    | QueuedAction::Lead(_)
                    | QueuedAction::PerTurn(_)
                    | QueuedAction::Heat(_)
                    | QueuedAction::Advance(_)
                    | QueuedAction::Backlash(_)
                    | QueuedAction::Origin(_)
            )
        )
    }

    /// Returns a block of the line with this N word, 0 for none; at most [`N_MAX`](crate::gcode::command::N_MAX).
    #[inline(always)]
    pub const fn new(body: Body, line: u32) -> Self {
        Self { body, line: Number::of(line) }
    }

    /// Makes it a block of the line with this N word.
    #[inline(always)]
    pub fn set_line(&mut self, line: u32) {
        self.line = Number::of(line);
    }

    /// Makes it a line with this N word.
    #[inline(always)]
    pub fn set(&mut self, line: &Line, number: u32) {
        self.body = Body::Line(*line);
        self.set_line(number);
    }

    /// A block that does something other than move.
    pub fn action(action: QueuedAction, line: u32) -> Self {
        Self::new(Body::QueuedAction(action), line)
    }

    /// The N word, 0 for none.
    #[inline(always)]
    pub fn line(&self) -> u32 {
        self.line.get()
    }
}

/// An N word, 0 for none, in three bytes.
#[derive(Clone, Copy, Debug)]
pub struct Number([u8; 3]);

impl Number {
    /// Keeps an N word, which is at most [`N_MAX`](crate::gcode::command::N_MAX).
    #[inline(always)]
    pub const fn of(line: u32) -> Self {
        let [a, b, c, _] = line.to_le_bytes();
        Self([a, b, c])
    }

    /// Returns the N word.
    #[inline(always)]
    pub fn get(self) -> u32 {
        let [a, b, c] = self.0;
        u32::from_le_bytes([a, b, c, 0])
    }
}

/// What a block does. Not one enum with [`QueuedAction`]: a line leaves one value free for a tag, no more.
#[derive(Clone, Copy, Debug)]
pub enum Body {
    /// Moves the motors.
    Line(Line),
    /// Does something else.
    QueuedAction(QueuedAction),
}

/// What a block does if it moves nothing.
#[derive(Clone, Copy, Debug)]
pub enum QueuedAction {
    /// Stands still for this many milliseconds.
    Dwell(u32),
    /// G28.3: sets the motor positions.
    SetPosition([i32; MOTORS]),
    /// Changes the timing that the drivers require, from here on.
    Drivers(Drivers),
    /// M3 to M9, S: sets the outputs and the speed of the spindle.
    Outputs(Outputs),
    /// M3 to M9, S, under G96: sets the outputs. From here on the speed of the spindle follows X by this surface
    /// speed; [`Surface::NONE`] ends that.
    Surface(Outputs, Surface),
    /// G33: from here on lines follow the spindle. Done at a standstill.
    Thread(Pass),
    /// From here on lines do not follow the spindle any more.
    EndThread,
    /// G33.1, at a standstill: the spindle has reversed, and lines follow it back. It is to reverse again at the
    /// distance [`Pass::turn_at`] before the end of the line.
    Return,
    /// Within a pass of G33 or G76: sets the lead of the lines from here on, mm a turn. Does not stop the machine.
    Lead(f32),
    /// G95, or its end: sets whether feeds are scaled to the measured speed of the spindle from here on. Does not stop
    /// the machine.
    PerTurn(bool),
    /// M48 to M51. Does not stop the machine.
    Override(Change),
    /// M104 to M190: sets heaters and the fan. Does not stop the machine.
    Heat(Heat),
    /// M900: sets the extruder's lead. Does not stop the machine.
    Advance(Lead),
    /// The backlash of the motors, from their next reversal on. Does not stop the machine.
    Backlash([Slack; MOTORS]),
    /// The origin of the lines from here on, for reports. Does not stop the machine.
    Origin(Origin),
    /// The means for the motion from here on. Done at a standstill.
    Smooth(Spans),
    /// M0, M1, M60.
    ProgramStop,
    /// M2, M30.
    ProgramEnd,
}

/// A pass in step with the spindle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pass {
    /// The lead of the first line of the pass along its path, mm a turn.
    pub lead: f32,
    /// Limit of the error of the axes, once they have been in step, mm; 0 for no limit.
    pub limit: Short,
    /// How the pass is left before its end.
    pub retract: Retract,
    /// G33.1: how many mm before the end of the line the spindle is to reverse; 0 for a pass that does not return.
    pub turn_at: f32,
}

/// What a program switches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outputs {
    /// Bits of [`outputs`](crate::boards::outputs).
    pub on: u8,
    /// S, turns per minute; 0 while the spindle is off.
    pub speed: f32,
}

/// The length of a line, and the unit of its motor distances. The last 8 of the float's 24 bits hold the finer part of
/// an extruder's distance ([`Extent::refine`]). So the length has 16 bits, 0.002 %.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extent(f32);

impl Extent {
    /// Returns the extent of a line `length` mm long, with distances in whole steps or in 1/16 step.
    #[inline(always)]
    pub fn new(length: f32, whole_steps: bool) -> Self {
        Self(if whole_steps { -length } else { length })
    }

    /// The length, mm.
    #[inline(always)]
    pub fn length(self) -> f32 {
        size(self.0)
    }

    /// Stores how much farther an extruder moves than its `way`, in 1/32 of the unit of `way`.
    #[inline(always)]
    pub fn refine(&mut self, more: i8) {
        self.0 = f32::from_bits(self.0.to_bits() & !0xFF | u32::from(more as u8));
    }

    /// Returns what [`Extent::refine`] has stored; any number if nothing has been stored.
    #[inline(always)]
    pub fn more(self) -> i8 {
        self.0.to_bits() as i8
    }

    /// Whether distances are in whole steps, not in 1/16 step.
    #[inline(always)]
    pub fn has_whole_steps(self) -> bool {
        self.0.is_sign_negative()
    }
}

/// A straight move.
#[derive(Clone, Copy, Debug, Default)]
pub struct Line {
    /// Signed distance of each motor, from the end of the block before: in 1/16 step, or in steps if it is too long for
    /// that.
    pub way: [i16; MOTORS],
    /// Path length, and the unit of `way`.
    pub extent: Extent,
    /// How much faster than `cruise` the line may be run.
    pub reserve: Reserve,
    /// Velocity limit on the path, mm/s, at 100 %: the feed, or what the slowest axis or motor allows.
    pub cruise: f32,
    /// Brake potential at the start of the line; see `speed_constraints`.
    pub start: f32,
    /// Highest velocity at which the line may be entered, mm/s: that of the corner with the line before, whatever the
    /// feeds are.
    pub entry: Short,
    /// Acceleration limit on the path, mm/s^2.
    pub accel: Short,
}

impl Line {
    /// A line of no length.
    pub const NONE: Self = Self {
        way: [0; MOTORS],
        extent: Extent(0.0),
        reserve: Reserve::NONE,
        cruise: 0.0,
        start: 0.0,
        entry: Short::ZERO,
        accel: Short::ZERO,
    };

    /// Velocity limit on the path under an override, mm/s.
    #[inline(always)]
    pub fn velocity(&self, factors: &Factors) -> f32 {
        self.reserve.velocity(self.cruise, factors)
    }

    /// Whether these motors, as bits, stand still in the line. They may have a debt to make good.
    #[small]
    pub fn keeps(&self, motors: u8) -> bool {
        let mut bit = 1;
        let mut keeps = true;
        for way in self.way {
            keeps &= way == 0 || motors & bit == 0;
            bit <<= 1;
        }
        keeps
    }
}
