//! A block: one straight move, dwell or synchronised command, as the planner leaves it for exec.
//!
//! Units: mm (degrees for a rotary-only move), seconds, motor steps. The size of a block decides how
//! far Kerf looks ahead, and each byte of it is there 62 times. So limits take two bytes each, the line
//! number three, the sign of a length tells what distances are counted in ([`Extent`]), and a line, which knows no [`Reserve`] of 0, has no tag:
//! 30 bytes on AVR.

use super::advance::Lead;
use super::factors::{Factors, Reserve};
use super::float::size;
use super::pace::Drivers;
use super::retract::Retract;
use super::short::Short;
use crate::boards::MOTORS;
use crate::gcode::command::Surface;
use crate::gcode::heating::Heat;
use crate::gcode::overrides::Change;

/// Parts of a step to which blocks know where they end: the logarithm of their number.
pub const PARTS_LOG2: u8 = 4;

/// The least and the greatest fraction at a block's end, in 1/16 step from the whole step next to it. Nearly half a step: what
/// rounding leaves must not tell which one is next.
pub const FRACTIONS: (i8, i8) = (-7, 6);

/// A block of the queue.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// What it does.
    pub body: Body,
    line: [u8; 3],
}

impl Block {
    /// Whether the machine goes on over it, and it is no line.
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
            )
        )
    }

    /// A block of the line with this N word, 0 for none; at most [`N_MAX`](crate::gcode::command::N_MAX).
    #[inline(always)]
    pub fn new(body: Body, line: u32) -> Self {
        Self { body, line: number(line) }
    }

    /// It is of the line with this N word.
    #[inline(always)]
    pub fn set_line(&mut self, line: u32) {
        self.line = number(line);
    }

    /// A block that does something other than move.
    pub fn action(action: QueuedAction, line: u32) -> Self {
        Self::new(Body::QueuedAction(action), line)
    }

    /// The N word, 0 for none.
    #[inline(always)]
    pub fn line(&self) -> u32 {
        let [a, b, c] = self.line;
        u32::from_le_bytes([a, b, c, 0])
    }
}

/// The bytes of an N word that a block keeps.
#[inline(always)]
fn number(line: u32) -> [u8; 3] {
    let [a, b, c, _] = line.to_le_bytes();
    [a, b, c]
}

/// What a block does. Not one enum with [`QueuedAction`]: there is one value that a line cannot have.
#[derive(Clone, Copy, Debug)]
pub enum Body {
    /// Moves the motors.
    Line(Line),
    /// Does something else.
    QueuedAction(QueuedAction),
}

/// What a block does that moves nothing.
#[derive(Clone, Copy, Debug)]
pub enum QueuedAction {
    /// Stands still for so many milliseconds.
    Dwell(u32),
    /// G28.3: from here on the motor positions are these.
    SetPosition([i32; MOTORS]),
    /// The drivers ask for something else from here on.
    Drivers(Drivers),
    /// M3 to M9, S: the outputs and the speed of the spindle are so from here on.
    Outputs(Outputs),
    /// M3 to M9, S, under G96: the outputs are so from here on, and the speed of the spindle follows X by this surface speed. [`Surface::NONE`] ends that.
    Surface(Outputs, Surface),
    /// G33: from here on, at rest, lines follow the spindle.
    Thread(Pass),
    /// From here on lines do not follow the spindle any more.
    EndThread,
    /// G33.1, at rest: the spindle has turned round, and lines follow it back. It is to turn again as far before the end of the line.
    Return,
    /// In the midst of a pass of G33 or G76: the lines from here on have this lead, mm a turn. The machine goes on.
    Lead(f32),
    /// G95, or its end: from here on feeds go by the measured speed of the spindle, or not. The machine goes on.
    PerTurn(bool),
    /// M48 to M51. The machine goes on.
    Override(Change),
    /// M104 to M190: heaters and the fan are to be so. The machine goes on.
    Heat(Heat),
    /// M900: from here on this is the extruder's lead. The machine goes on.
    Advance(Lead),
    /// M0, M1, M60.
    ProgramStop,
    /// M2, M30.
    ProgramEnd,
}

/// A pass in step with the spindle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pass {
    /// How far its first line goes in a turn, along its path, mm.
    pub lead: f32,
    /// How far the axes may be off, once they have been in step, mm; 0 for no limit.
    pub limit: Short,
    /// How it is left before its end.
    pub retract: Retract,
    /// G33.1: the spindle is to turn round so many mm before the end of the line; 0 for a pass that does not return.
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

/// How long a line is, and what its way is counted in. The last 8 bits of a float's 24 are room for what its way does not say of an extruder
/// ([`Extent::refine`]): they make the length as good as 16 bits are, 0.002 %.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extent(f32);

impl Extent {
    /// The extent of a line `length` mm long, with a way in whole steps or in 1/16 step.
    #[inline(always)]
    pub fn new(length: f32, whole_steps: bool) -> Self {
        Self(if whole_steps { -length } else { length })
    }

    /// mm.
    #[inline(always)]
    pub fn length(self) -> f32 {
        size(self.0)
    }

    /// Keeps how much farther an extruder goes than its way says, in 1/32 of what that is counted in.
    #[inline(always)]
    pub fn refine(&mut self, more: i8) {
        self.0 = f32::from_bits(self.0.to_bits() & !0xFF | u32::from(more as u8));
    }

    /// See [`Extent::refine`]; any number if nothing has been kept.
    #[inline(always)]
    pub fn more(self) -> i8 {
        self.0.to_bits() as i8
    }

    /// Whether the way is in steps, not in 1/16 step.
    #[inline(always)]
    pub fn has_whole_steps(self) -> bool {
        self.0.is_sign_negative()
    }
}

/// A straight move.
#[derive(Clone, Copy, Debug, Default)]
pub struct Line {
    /// Signed way of each motor, from the end of the block before; in 1/16 step or, if that is too far, in steps.
    pub way: [i16; MOTORS],
    /// Path length, and which it is.
    pub extent: Extent,
    /// How much faster than `cruise` it may be run.
    pub reserve: Reserve,
    /// Velocity limit on the path, mm/s, at 100 %: the feed, or what the slowest axis or motor allows.
    pub cruise: f32,
    /// Brake potential where it starts; see `speed_constraints`.
    pub start: f32,
    /// Highest velocity at which it may be entered, mm/s: the corner with the line before, whatever feeds are.
    pub entry: Short,
    /// Acceleration limit on the path, mm/s^2.
    pub accel: Short,
    /// Jerk limit on the path, mm/s^3; 0 for none.
    pub jerk: Short,
}

impl Line {
    /// Velocity limit on the path under an override, mm/s.
    #[inline(always)]
    pub fn velocity(&self, factors: &Factors) -> f32 {
        self.reserve.velocity(self.cruise, factors)
    }
}
