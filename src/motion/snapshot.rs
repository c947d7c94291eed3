//! The state of motion, as exec publishes it.
//!
//! Exec keeps one [`Snapshot`] up to date, and thread mode copies it (`tasks::common`). Reports show a [`Moment`] of
//! it, which costs 1,000 cycles while something moves. All values of a report come from one [`Moment`], because exec
//! may run between any two readings.

use kerf_macros::small;

use super::block::{Number, Outputs, QueuedAction};
use crate::boards::MOTORS;
use crate::capability::Capability;
use crate::gcode::command::Surface;
use crate::units::Length;

/// How many surface speeds there are: none in an image without a lathe.
const LATHES: usize = Capability::Lathe.is_built_in() as usize;

/// What the coordinates of a move count from, as reports show it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Origin {
    /// The work offset of the axis that each motor moves.
    pub offset: [Length; MOTORS],
    /// The coordinate system: 1 for G54, to 9 for G59.3; 0 before the first line.
    pub system: u8,
    /// The tool in the spindle, 0 for none.
    pub tool: u16,
}

impl Origin {
    /// Nothing is known of the origin.
    pub const NONE: Self = Self { offset: [Length::ZERO; MOTORS], system: 0, tool: 0 };
}

/// What reports show of the motion that is being prepared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// Motor positions at the end of the block being run, in steps.
    pub target: [i32; MOTORS],
    /// Signed steps of the block being run.
    pub steps: [i16; MOTORS],
    /// The remaining distance of the block, mm.
    pub left: f32,
    /// The length of the block, mm; 0 in a dwell.
    pub length: f32,
    /// Velocity along the path, mm/s.
    pub velocity: f32,
    /// The N word of the block being run.
    pub line: u32,
    /// The N word of the line finished last, to its last step.
    pub finished: u32,
    /// Whether something moves, or dwells.
    pub running: bool,
    /// Whether a feedhold has brought the machine to a standstill.
    pub held: bool,
    /// The last state of the program.
    pub program: Program,
    /// The origin of the block being run.
    pub origin: Origin,
    /// The commanded outputs, bits of [`outputs`](crate::boards::outputs).
    pub outputs: u8,
    /// The commanded speed of the spindle, turns per minute.
    pub speed: f32,
    /// The commanded surface speed (G96), by which the speed of the spindle follows X, in an image with
    /// [`Capability::Lathe`].
    pub surface: [Surface; LATHES],
}

impl Snapshot {
    /// At rest, at zero.
    pub const fn new() -> Self {
        Self {
            target: [0; MOTORS],
            steps: [0; MOTORS],
            left: 0.0,
            length: 0.0,
            velocity: 0.0,
            line: 0,
            finished: 0,
            running: false,
            held: false,
            program: Program::Ready,
            origin: Origin::NONE,
            outputs: 0,
            speed: 0.0,
            surface: [Surface::NONE; LATHES],
        }
    }

    /// Returns where the motors are, to the nearest step, rounded as the step generator rounds. Cost: 1,400 in
    /// motion, and 900 for each motor that moves.
    #[inline(never)]
    #[small]
    pub fn positions(&self) -> [i32; MOTORS] {
        if self.left <= 0.0 {
            return self.target;
        }
        let share = self.left / self.length;
        let mut positions = self.target;
        for (position, steps) in positions.iter_mut().zip(self.steps) {
            if steps != 0 {
                let half = if steps < 0 { -0.5 } else { 0.5 };
                *position = position.wrapping_sub((f32::from(steps) * share + half) as i32);
            }
        }
        positions
    }

    /// Sets the outputs, S, or the surface speed of a program's action. With a surface speed S follows X, whatever else
    /// the action sets.
    #[inline(always)]
    pub fn switch(&mut self, outputs: &Outputs, action: &QueuedAction) {
        self.outputs = outputs.on;
        if let (Some(surface), QueuedAction::Surface(_, new)) = (self.surface.first_mut(), action) {
            *surface = *new;
        } else if self.surface.first().is_some_and(Surface::is_on) {
            return;
        }
        self.speed = outputs.speed;
    }

    /// Returns the part of the state that reports show.
    #[small]
    pub fn moment(&self) -> Moment {
        Moment {
            position: self.positions(),
            velocity: self.velocity,
            line: Number::of(self.line),
            finished: Number::of(self.finished),
            running: self.running,
            held: self.held,
            program: self.program,
            origin: self.origin,
            speed: self.speed,
        }
    }
}

/// The part of [`Snapshot`] that reports show.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Motor positions, in steps.
    pub position: [i32; MOTORS],
    /// Velocity along the path, mm/s.
    pub velocity: f32,
    /// The N word of the block being run.
    pub line: Number,
    /// The N word of the line finished last.
    pub finished: Number,
    /// Whether something moves, or dwells.
    pub running: bool,
    /// Whether a feedhold has brought the machine to a standstill.
    pub held: bool,
    /// The last state of the program.
    pub program: Program,
    /// The origin of the block being run.
    pub origin: Origin,
    /// The commanded speed of the spindle, turns per minute; 0 while it is off.
    pub speed: f32,
}

/// The state of the program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Program {
    /// Nothing has run since the reset.
    #[default]
    Ready,
    /// The queue has run empty, or M0 has stopped the program.
    Stopped,
    /// M2 or M30 has ended the program.
    Ended,
}
