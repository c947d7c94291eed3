//! A block: one straight move, dwell or synchronised command, as the planner leaves it for exec.
//!
//! Units: mm (degrees for a rotary-only move), seconds, motor steps. The size of a block decides how
//! far Kerf looks ahead: limits take two bytes each.

use super::factors::{Extent, Factors};
use super::pace::Drivers;
use super::short::Short;
use crate::boards::MOTORS;
use crate::gcode::overrides::Change;

/// One block.
#[derive(Clone, Copy, Debug, Default)]
pub struct Block {
    /// What it does.
    pub body: Body,
    /// The N word, 0 for none.
    pub line: u32,
}

/// What a block does.
#[derive(Clone, Copy, Debug, Default)]
pub enum Body {
    /// Nothing.
    #[default]
    Nothing,
    /// Moves the motors.
    Line(Line),
    /// Stands still for so many milliseconds.
    Dwell(u32),
    /// G28.3: from here on the motor positions are these.
    SetPosition([i32; MOTORS]),
    /// The drivers ask for something else from here on.
    Drivers(Drivers),
    /// M3 to M9, S: the outputs and the speed of the spindle are so from here on.
    Outputs(Outputs),
    /// M48 to M51. The machine goes on.
    Override(Change),
    /// M0, M1, M60.
    ProgramStop,
    /// M2, M30.
    ProgramEnd,
}

/// What a program switches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outputs {
    /// Bits of [`outputs`](crate::boards::outputs).
    pub on: u8,
    /// S, turns per minute; 0 while the spindle is off.
    pub speed: f32,
}

/// A straight move.
#[derive(Clone, Copy, Debug, Default)]
pub struct Line {
    /// Signed steps of each motor.
    pub steps: [i16; MOTORS],
    /// Path length, and how much faster than `cruise` it may be run.
    pub extent: Extent,
    /// Velocity limit on the path, mm/s, at 100 %: the feed, or what the slowest axis or motor allows.
    pub cruise: f32,
    /// Brake potential where it starts; see `horizon`.
    pub start: f32,
    /// Highest velocity at which it may be entered, mm/s: the corner with the line before, whatever feeds are.
    pub entry: Short,
    /// Acceleration limit on the path, mm/s^2.
    pub accel: Short,
    /// Jerk limit on the path, mm/s^3; 0 for none.
    pub jerk: Short,
}

impl Line {
    /// Path length, mm.
    #[inline(always)]
    pub fn length(&self) -> f32 {
        self.extent.length()
    }

    /// Velocity limit on the path under an override, mm/s.
    #[inline(always)]
    pub fn velocity(&self, factors: &Factors) -> f32 {
        self.extent.velocity(self.cruise, factors)
    }
}
