//! The words of canned cycles that stay in force from line to line (RS274/NGC 3.5.16).
//!
//! Numbers are kept as written, in units of a length: R and Z mean something else with G90 than with G91.
//! They hold for as long as the same cycle goes on, in the same plane.

use super::axes;
use super::block::Block;
use super::modal::{MotionMode, Plane, Units};
use super::words::{I, P, Q, R};
use crate::status::Status;
use crate::units::Length;

/// The words of the cycle in force.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sticky {
    /// Whose they are: none of another mode counts.
    mode: MotionMode,
    /// The plane of the cycle.
    plane: Plane,
    /// Where the axis stood before the first cycle of the series, machine coordinates.
    pub initial: Length,
    /// R.
    pub retract: Option<Length>,
    /// The word of the axis across the plane.
    pub depth: Option<Length>,
    /// Q.
    pub peck: Option<Length>,
    /// P.
    pub dwell_ms: Option<u32>,
    /// I, J and K of G87.
    pub offsets: [Option<Length>; 3],
}

#[small]
impl Sticky {
    /// No words. All zeros, so that it needs no memory.
    pub const NONE: Self = Self {
        mode: MotionMode::Traverse,
        plane: Plane::Xy,
        initial: Length::ZERO,
        retract: None,
        depth: None,
        peck: None,
        dwell_ms: None,
        offsets: [None; 3],
    };

    /// Takes what is in force on a line of `mode`, after `before` was: its words, and the others of the series.
    /// `here`: where the axis across the plane is.
    #[inline(never)]
    pub fn on(
        &mut self,
        block: &Block,
        mode: MotionMode,
        before: MotionMode,
        plane: Plane,
        units: Units,
        here: Length,
    ) -> Result<(), Status> {
        match () {
            // Along another axis, heights mean nothing.
            () if self.plane != plane => self.forget(here),
            () if before == mode && self.mode == mode => {}
            () if before.is_cycle() => self.forget(self.initial),
            () => self.forget(here),
        }
        (self.mode, self.plane) = (mode, plane);
        let length = |slot: u8, kept: &mut Option<Length>| {
            if let Some(word) = block.get(slot) {
                *kept = Some(axes::length(word, units)?.units);
            }
            Ok(())
        };
        length(R, &mut self.retract)?;
        length(plane.axes()[2], &mut self.depth)?;
        length(Q, &mut self.peck)?;
        for (slot, offset) in (I..).zip(&mut self.offsets) {
            length(slot, offset)?;
        }
        if let Some(word) = block.get(P) {
            self.dwell_ms = Some(word.milliseconds()?);
        }
        Ok(())
    }

    /// No words; the series begins where the axis is at `initial`.
    fn forget(&mut self, initial: Length) {
        // One by one: whole, it would be copied from a constant, which has its place in RAM.
        self.initial = initial;
        (self.retract, self.depth, self.peck, self.dwell_ms) = (None, None, None, None);
        for offset in &mut self.offsets {
            *offset = None;
        }
    }
}
