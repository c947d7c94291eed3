//! Canned cycles: converts the words of a line to the holes that it asks for (RS274/NGC 3.5.16).
//!
//! The operations at each hole are in `steps`. R, the depth, Q and P stay in force (`sticky`). With G91 the holes are
//! measured from the present place, R from the present height, and the depth from R.

use kerf_macros::small;

use super::axes::{self, Value};
use super::block::Block;
use super::command::{BACK, Commands, Cycle, Feed, Motion, Spindle};
use super::modal::{Distance, FeedMode, MotionMode, Plane, Retract, Turn};
use super::setup::{AxisMode, Setup};
use super::state::State;
use super::sticky::Sticky;
use super::words::{AXES, L, ROTARY};
use crate::capability::Capability;
use crate::status::Status;
use crate::units::Length;

#[small]
impl State {
    /// Carries out G73, G81 to G89. `before` is the motion mode of the previous line.
    #[inline(never)]
    #[small]
    pub(super) fn cycle(
        &mut self,
        block: &Block,
        mode: MotionMode,
        before: MotionMode,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        self.check_cycle(block, mode, setup)?;
        let plane = self.modal.plane;
        let [first, second, across] = plane.axes();
        let here = self.at(across);
        // If the line is refused, the caller undoes all of this.
        self.sticky.on(block, mode, before, plane, self.modal.units, here)?;
        // Built in its final place, because it is too large to be copied.
        out.motion = Motion::Cycle(blank(mode, plane, self.spindle()));
        let Motion::Cycle(cycle) = &mut out.motion else { return Err(Status::InternalError) };
        self.levels(here, across, cycle)?;
        cycle.holes = holes(block)?;
        for (i, axis) in [first, second].into_iter().enumerate() {
            self.row(block, axis, cycle.from.get_mut(i), cycle.pitch.get_mut(i))?;
        }
        cycle.feed = self.rate(block, false)?;
        cycle.peck = peck(mode, &self.sticky)?;
        cycle.dwell_ms = dwell_ms(mode, &self.sticky)?;
        if Capability::Boring.is_built_in() && mode == MotionMode::BackBore {
            self.back_bore(cycle)?;
        }
        self.end_at_last(cycle)
    }

    /// Moves the model to the last hole, where the cycle ends.
    #[inline(never)]
    #[small]
    fn end_at_last(&mut self, cycle: &Cycle) -> Result<(), Status> {
        let [first, second, across] = cycle.plane.axes();
        let last = cycle.hole(cycle.holes).ok_or(Status::OutOfRange)?;
        for (axis, hole) in [first, second].into_iter().zip(last) {
            self.move_to(axis, hole);
        }
        self.move_to(across, Value { units: cycle.clear, rest: 0 });
        Ok(())
    }

    #[inline(never)]
    fn check_cycle(
        &self,
        block: &Block,
        mode: MotionMode,
        setup: &impl Setup,
    ) -> Result<(), Status> {
        if block.has(ROTARY) {
            return Err(Status::RotaryNotAllowed);
        }
        if !block.has(AXES) {
            return Err(Status::AxisWordMissing);
        }
        if self.modal.plane.axes().iter().any(|axis| setup.mode(*axis) == AxisMode::Disabled) {
            return Err(Status::AxisDisabled);
        }
        if self.modal.feed_mode == FeedMode::InverseTime {
            return Err(Status::InverseTimeNotAllowed);
        }
        let turns = match mode {
            _ if !Capability::Boring.is_built_in() => true,
            MotionMode::Tap => self.modal.spindle == Turn::Clockwise,
            MotionMode::BoreStop | MotionMode::BackBore | MotionMode::BoreByHand => {
                self.modal.spindle != Turn::Off
            }
            _ => true,
        };
        if turns { Ok(()) } else { Err(Status::SpindleMustTurn) }
    }

    /// Sets R, the bottom, and the height between holes, in machine coordinates.
    #[inline(never)]
    fn levels(&self, here: Length, across: u8, cycle: &mut Cycle) -> Result<(), Status> {
        let words = &self.sticky;
        let retract = words.retract.ok_or(Status::RWordMissing)?;
        let depth = words.depth.ok_or(Status::AxisTargetMissing)?;
        let origin = self.origin.get(usize::from(across)).copied().unwrap_or_default();
        let sum = |a: Length, b| a.checked_add(b).ok_or(Status::OutOfRange);
        let (retract, bottom) = match self.modal.distance {
            Distance::Absolute => (sum(origin, retract)?, sum(origin, depth)?),
            Distance::Incremental => {
                let retract = sum(here, retract)?;
                (retract, sum(retract, depth)?)
            }
        };
        if retract < bottom {
            return Err(Status::RWordInvalid);
        }
        (cycle.retract, cycle.bottom) = (retract, bottom);
        cycle.clear = match self.modal.retract {
            Retract::ToR => retract,
            Retract::Initial => retract.max(words.initial),
        };
        Ok(())
    }

    /// Sets the reference point along an axis, and the pitch from hole to hole. With G90 the pitch is 0, so that all
    /// holes are at the place that the word gives.
    #[inline(never)]
    fn row(
        &self,
        block: &Block,
        axis: u8,
        from: Option<&mut Value>,
        pitch: Option<&mut Value>,
    ) -> Result<(), Status> {
        let (Some(from), Some(pitch)) = (from, pitch) else { return Err(Status::InternalError) };
        let i = usize::from(axis);
        let rest = self.residue.get(i).copied().unwrap_or_default();
        *from = Value { units: self.at(axis), rest };
        let Some(word) = block.get(axis) else { return Ok(()) };
        let value = axes::length(word, self.modal.units)?;
        match self.modal.distance {
            Distance::Incremental => *pitch = value,
            Distance::Absolute => {
                let origin = self.origin.get(i).copied().unwrap_or_default();
                let units = origin.checked_add(value.units).ok_or(Status::OutOfRange)?;
                *from = Value { units, ..value };
            }
        }
        Ok(())
    }

    /// Carries out I, J and K of G87.
    #[inline(never)]
    fn back_bore(&self, cycle: &mut Cycle) -> Result<(), Status> {
        let [first, second, across] = self.modal.plane.axes();
        let word = |axis: u8| self.sticky.offsets.get(usize::from(axis)).copied().flatten();
        let missing = Status::ArcOffsetsMissing;
        let aside = [word(first).ok_or(missing)?, word(second).ok_or(missing)?];
        let top = word(across).ok_or(missing)?;
        let base = match self.modal.distance {
            Distance::Absolute => self.origin.get(usize::from(across)).copied().unwrap_or_default(),
            Distance::Incremental => cycle.bottom,
        };
        let top = base.checked_add(top).ok_or(Status::OutOfRange)?;
        for (length, value) in cycle.back.iter_mut().zip([aside[0], aside[1], top]) {
            *length = value;
        }
        if top < cycle.bottom { Err(Status::AxisInvalid) } else { Ok(()) }
    }

    fn at(&self, axis: u8) -> Length {
        self.position.get(usize::from(axis)).copied().unwrap_or_default()
    }

    fn move_to(&mut self, axis: u8, to: Value) {
        let i = usize::from(axis);
        if let (Some(position), Some(residue)) = (self.position.get_mut(i), self.residue.get_mut(i))
        {
            (*position, *residue) = (to.units, to.rest);
        }
    }
}

/// Returns a cycle whose words have not been read yet.
#[inline(never)]
#[small]
fn blank(mode: MotionMode, plane: Plane, spindle: Spindle) -> Cycle {
    let (nowhere, zero) = ([Value::default(); 2], Length::ZERO);
    Cycle {
        mode,
        plane,
        from: nowhere,
        pitch: nowhere,
        holes: 1,
        retract: zero,
        bottom: zero,
        clear: zero,
        peck: zero,
        dwell_ms: 0,
        back: [zero; BACK],
        feed: Feed::PerMinute(0.0),
        spindle,
    }
}

/// Returns L, the number of holes.
#[inline(never)]
#[small]
fn holes(block: &Block) -> Result<u16, Status> {
    let Some(word) = block.get(L) else { return Ok(1) };
    let holes = word.integer().ok().and_then(|holes| u16::try_from(holes).ok());
    holes.filter(|holes| *holes > 0).ok_or(Status::LWordInvalid)
}

/// Returns Q for the cycles that peck, 0 for all others.
#[inline(never)]
#[small]
fn peck(mode: MotionMode, words: &Sticky) -> Result<Length, Status> {
    if !matches!(mode, MotionMode::ChipBreak | MotionMode::PeckDrill) {
        return Ok(Length::ZERO);
    }
    let peck = words.peck.ok_or(Status::QWordMissing)?;
    if peck > Length::ZERO { Ok(peck) } else { Err(Status::QWordInvalid) }
}

/// Returns P in milliseconds. Cycles that dwell need P. For all others it is optional, and 0 without P.
#[inline(never)]
#[small]
fn dwell_ms(mode: MotionMode, words: &Sticky) -> Result<u32, Status> {
    match (mode, words.dwell_ms) {
        (_, Some(dwell)) => Ok(dwell),
        (
            MotionMode::DrillDwell
            | MotionMode::BoreStop
            | MotionMode::BoreByHand
            | MotionMode::BoreDwell,
            None,
        ) => Err(Status::PWordMissing),
        (_, None) => Ok(0),
    }
}

#[small]
impl Cycle {
    /// Returns the place of a hole in the plane. Holes are counted from 1. `None` beyond the range of a length.
    pub(super) fn hole(&self, number: u16) -> Option<[Value; 2]> {
        let along = |from: Value, pitch: Value| {
            let number = i32::from(number);
            // Fits 32 bits: a product of 16 by 15 bits, plus 15 bits.
            let rest = i32::from(from.rest) + number * i32::from(pitch.rest);
            let carry = (rest + HALF).div_euclid(2 * HALF);
            // In 64 bits, because `checked_mul` of an `i32` is faulty on AVR: it calls a routine that writes 32 bits
            // where the compiler has reserved 16.
            let way = i64::from(pitch.units.0) * i64::from(number) + i64::from(carry);
            let units = from.units.checked_add(Length(i32::try_from(way).ok()?))?;
            Some(Value { units, rest: (rest - carry * 2 * HALF) as i16 })
        };
        let [first, second] = [0, 1].map(|i| along(*self.from.get(i)?, *self.pitch.get(i)?));
        Some([first?, second?])
    }
}

/// Half a unit, in the scale of [`Value::rest`].
const HALF: i32 = 5_000;
