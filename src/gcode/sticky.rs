//! Sticky words: the words of canned cycles that stay in force from line to line (RS274/NGC 3.5.16).
//!
//! Numbers are kept as they were written, in units of a length, because R and Z have a different meaning with G90 and
//! with G91. They stay in force while the same cycle goes on in the same plane.

use super::axes;
use super::block::Block;
use super::command::BACK;
use super::modal::{MotionMode, Plane, Units};
use super::words::{I, P, Q, R};
use crate::status::Status;
use crate::units::Length;

/// The words of the cycle in force.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sticky {
    /// The cycle that the words belong to. They do not count for another cycle.
    mode: MotionMode,
    /// The plane of the cycle.
    plane: Plane,
    /// The height before the first cycle of the series, machine coordinates.
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
    pub offsets: [Option<Length>; BACK],
}

#[small]
impl Sticky {
    /// No words. The value is all zeros, so that it needs no memory for an initial value.
    pub const NONE: Self = Self {
        mode: MotionMode::Traverse,
        plane: Plane::Xy,
        initial: Length::ZERO,
        retract: None,
        depth: None,
        peck: None,
        dwell_ms: None,
        offsets: [None; BACK],
    };

    /// Takes the words of a line with the cycle `mode`. Words that the line lacks stay in force if the same cycle goes
    /// on. `before` is the motion mode of the previous line, and `here` the coordinate of the axis across the plane.
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
            // Heights along the axis of another plane have no meaning.
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

    /// Forgets all words. `initial` is the height before the first cycle of the series.
    fn forget(&mut self, initial: Length) {
        // Field by field: a whole value would be copied from a constant, which takes RAM on AVR.
        self.initial = initial;
        (self.retract, self.depth, self.peck, self.dwell_ms) = (None, None, None, None);
        for offset in &mut self.offsets {
            *offset = None;
        }
    }
}
