//! A block: one straight move, dwell or synchronised command, as the planner leaves it for exec.
//!
//! Units: mm (degrees for a rotary-only move), seconds, motor steps.

use crate::boards::MOTORS;

/// What a block does.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[repr(u8)]
pub enum Kind {
    /// Moves the motors.
    #[default]
    Line,
    /// Stands still for `steps[0]` milliseconds.
    Dwell,
    /// G28.3: from here on the motor positions are `steps`.
    SetPosition,
    /// M0, M1, M60.
    ProgramStop,
    /// M2, M30.
    ProgramEnd,
}

/// One block.
#[derive(Clone, Copy, Debug, Default)]
pub struct Block {
    /// Signed steps of each motor.
    pub steps: [i32; MOTORS],
    /// Path length, mm.
    pub length: f32,
    /// Velocity limit on the path, mm/s: the feed, or what the slowest axis or motor allows.
    pub cruise: f32,
    /// Highest velocity at which the block may be entered, mm/s: the junction with the one before.
    pub entry_max: f32,
    /// Planned highest entry velocity, mm/s: `entry_max`, or less where the blocks behind it need
    /// the room to slow down. Exec may enter slower, never faster.
    pub entry: f32,
    /// Acceleration limit on the path, mm/s^2; 0 for none.
    pub accel: f32,
    /// Jerk limit on the path, mm/s^3.
    pub jerk: f32,
    /// The N word, 0 for none.
    pub line: u32,
    /// What it does.
    pub kind: Kind,
}
