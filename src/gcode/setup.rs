//! The properties of the machine that the interpreter needs to know. In the firmware the settings provide them
//! (`tasks::setup`).

use super::heating::Part;
use super::modal::Defaults;
use crate::status::Status;
use crate::units::Length;

/// How an axis interprets its words. The discriminants are TinyG's numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum AxisMode {
    /// Words are accepted and ignored: the axis stays where it is.
    Disabled = 0,
    /// Words are lengths, or degrees for a rotary axis.
    Standard = 1,
    /// The position changes like that of a standard axis, but the motors stand still.
    Inhibited = 2,
    /// Words of a rotary axis are lengths along a circumference.
    Radius = 3,
}

/// The machine, as far as the language depends on it. Axes are X Y Z A B C from 0.
pub trait Setup {
    /// Returns how an axis interprets its words.
    fn mode(&self, axis: u8) -> AxisMode;
    /// Returns the radius that converts a length to an angle, nm. More than 0.
    fn radius(&self, axis: u8) -> u32;
    /// Returns the ends of an axis' travel in machine coordinates. Moves beyond them are refused. `None` for no limits.
    fn travel(&self, axis: u8) -> Option<(Length, Length)>;

    /// Returns how far from the origin of machine coordinates the steps of all motors can be counted. Moves from or to
    /// places beyond this distance are refused. `None` if the steps of every length can be counted.
    fn reach(&self) -> Option<Length> {
        None
    }

    /// Returns the modes at start-up and after M2 and M30.
    fn defaults(&self) -> Defaults {
        Defaults::USUAL
    }
    /// Whether lines that begin with a slash are skipped (block delete).
    fn deletes_blocks(&self) -> bool {
        true
    }
    /// Whether M1 stops the program.
    fn stops_at_m1(&self) -> bool {
        true
    }
    /// Whether there is a probe.
    fn has_probe(&self) -> bool {
        true
    }
    /// Returns `Ok` if an encoder measures the spindle, with `has_sync` one that has a sync sensor; else the reason why
    /// not.
    fn encoder(&self, has_sync: bool) -> Result<(), Status> {
        let _ = has_sync;
        Ok(())
    }
    /// Returns the highest temperature of a heater, eighths of a degree. 0 if there is no such heater.
    fn hottest(&self, _part: Part) -> u16 {
        275 * 8
    }
    /// Returns `Ok` if a heater may be switched on, else the reason why not.
    fn heats(&self, _part: Part) -> Result<(), Status> {
        Ok(())
    }
    /// Returns `Ok` if the hot end is hot enough to move filament, else the reason why not.
    fn extrudes(&self) -> Result<(), Status> {
        Ok(())
    }
    /// Returns `Ok` if the drivers of the motors are ready to move them, else the reason why not.
    fn drives(&self) -> Result<(), Status> {
        Ok(())
    }
    /// Returns the axes that have a homing switch, as bits.
    fn axes_that_home(&self) -> u8 {
        u8::MAX
    }
    /// Returns `Ok` if an axis can be homed, else the reason why not.
    fn homing(&self, _axis: u8) -> Result<(), Status> {
        Ok(())
    }
}

/// A machine with all axes in mode [`AxisMode::Standard`] and with all equipment.
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
