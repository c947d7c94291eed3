//! What the interpreter asks about the machine that a program is for. The settings answer
//! (`tasks::setup`).

use super::heating::Part;
use super::modal::Defaults;
use crate::status::Status;
use crate::units::Length;

/// How an axis takes its words. The discriminants are TinyG's numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum AxisMode {
    /// Words are accepted and mean nothing: the axis stays where it is.
    Disabled = 0,
    /// Lengths, or degrees of an axis that turns.
    Standard = 1,
    /// The position moves as that of a standard axis, the motors stand still.
    Inhibited = 2,
    /// A rotary axis whose words are lengths along a circumference.
    Radius = 3,
}

/// The machine, as far as the language depends on it. Axes are X Y Z A B C from 0.
pub trait Setup {
    /// How an axis takes its words.
    fn mode(&self, axis: u8) -> AxisMode;
    /// The radius that turns a length into an angle, nm; more than 0.
    fn radius(&self, axis: u8) -> u32;
    /// The ends of its travel in machine coordinates, if moves beyond them are to be refused.
    fn travel(&self, axis: u8) -> Option<(Length, Length)>;

    /// How far from the origin of machine coordinates the steps of all motors can be counted, if these do not hold every length. Moves
    /// from or to places beyond are refused.
    fn reach(&self) -> Option<Length> {
        None
    }

    /// The modes at start-up and after M2 and M30.
    fn defaults(&self) -> Defaults {
        Defaults::USUAL
    }
    /// Whether lines that begin with a slash are left out.
    fn deletes_blocks(&self) -> bool {
        true
    }
    /// Whether M1 stops.
    fn stops_at_m1(&self) -> bool {
        true
    }
    /// Whether there is a probe.
    fn has_probe(&self) -> bool {
        true
    }
    /// Whether an encoder tells how the spindle turns, or why not.
    fn encoder(&self) -> Result<(), Status> {
        Ok(())
    }
    /// How hot a heater may be made, eighths of a degree; 0 if there is none.
    fn hottest(&self, _part: Part) -> u16 {
        275 * 8
    }
    /// Whether a heater may be switched on, or why not.
    fn heats(&self, _part: Part) -> Result<(), Status> {
        Ok(())
    }
    /// Whether the hot end is hot enough for filament to be moved, or why not.
    fn extrudes(&self) -> Result<(), Status> {
        Ok(())
    }
    /// Whether an axis can be homed, or why not.
    fn homing(&self, _axis: u8) -> Result<(), Status> {
        Ok(())
    }
}

/// A machine with all axes as usual, and everything else too.
#[derive(Clone, Copy, Debug, Default)]
pub struct Usual;

impl Setup for Usual {
    fn mode(&self, _axis: u8) -> AxisMode {
        AxisMode::Standard
    }
    fn radius(&self, _axis: u8) -> u32 {
        1
    }
    fn travel(&self, _axis: u8) -> Option<(Length, Length)> {
        None
    }
}
