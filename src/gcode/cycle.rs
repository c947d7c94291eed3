//! Canned cycles: from the words of a line to the holes it asks for (RS274/NGC 3.5.16).
//!
//! What is done at each hole is in `steps`. R, the depth, Q and P stay in force (`sticky`). With G91 the
//! holes are counted from the present place, R from the present height, and the depth from R.

use super::axes::{self, Value};
use super::block::Block;
use super::command::{Commands, Cycle, Motion};
use super::modal::{Distance, FeedMode, MotionMode, Retract, Turn};
use super::setup::{AxisMode, Setup};
use super::state::State;
use super::sticky::Sticky;
use super::words::{AXES, L, ROTARY};
use crate::status::Status;
use crate::units::Length;

#[small]
impl State {
    /// G73, G81 to G89; `before` is the motion mode of the line before.
    #[inline(never)]
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
        let words = self.sticky.on(block, mode, before, plane, self.modal.units, here)?;
        let (retract, bottom) = self.levels(&words, here, across)?;
        let clear = match self.modal.retract {
            Retract::ToR => retract,
            Retract::Initial => retract.max(words.initial),
        };
        let holes = holes(block)?;
        let rows = [self.row(block, first)?, self.row(block, second)?];
        let feed = self.rate(block, false)?;
        out.motion = Motion::Cycle(Cycle {
            mode,
            plane,
            from: rows.map(|row| row.0),
            pitch: rows.map(|row| row.1),
            holes,
            retract,
            bottom,
            clear,
            peck: peck(mode, &words)?,
            dwell_ms: dwell_ms(mode, &words)?,
            aside: [Length::ZERO; 2],
            top: Length::ZERO,
            feed,
            spindle: self.spindle(),
        });
        let Motion::Cycle(cycle) = &mut out.motion else { return Err(Status::InternalError) };
        if mode == MotionMode::BackBore {
            self.back_bore(&words, cycle)?;
        }
        let last = cycle.hole(holes).ok_or(Status::OutOfRange)?;
        for (axis, hole) in [first, second].into_iter().zip(last) {
            self.move_to(axis, hole);
        }
        self.move_to(across, Value { units: clear, rest: 0 });
        self.sticky = words;
        Ok(())
    }

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
            MotionMode::Tap => self.modal.spindle == Turn::Clockwise,
            MotionMode::BoreStop | MotionMode::BackBore | MotionMode::BoreByHand => {
                self.modal.spindle != Turn::Off
            }
            _ => true,
        };
        if turns { Ok(()) } else { Err(Status::SpindleMustTurn) }
    }

    /// R and the bottom, machine coordinates.
    fn levels(&self, words: &Sticky, here: Length, across: u8) -> Result<(Length, Length), Status> {
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
        if retract < bottom { Err(Status::RWordInvalid) } else { Ok((retract, bottom)) }
    }

    /// Where holes are counted from along an axis, and from one to the next: nothing with G90, where all of
    /// them are at the word.
    #[inline(never)]
    fn row(&self, block: &Block, axis: u8) -> Result<(Value, Value), Status> {
        let i = usize::from(axis);
        let rest = self.residue.get(i).copied().unwrap_or_default();
        let here = Value { units: self.at(axis), rest };
        let Some(word) = block.get(axis) else { return Ok((here, Value::default())) };
        let value = axes::length(word, self.modal.units)?;
        match self.modal.distance {
            Distance::Incremental => Ok((here, value)),
            Distance::Absolute => {
                let origin = self.origin.get(i).copied().unwrap_or_default();
                let units = origin.checked_add(value.units).ok_or(Status::OutOfRange)?;
                Ok((Value { units, ..value }, Value::default()))
            }
        }
    }

    /// G87: I, J, K.
    fn back_bore(&self, words: &Sticky, cycle: &mut Cycle) -> Result<(), Status> {
        let [first, second, across] = self.modal.plane.axes();
        let word = |axis: u8| words.offsets.get(usize::from(axis)).copied().flatten();
        let missing = Status::ArcOffsetsMissing;
        cycle.aside = [word(first).ok_or(missing)?, word(second).ok_or(missing)?];
        let top = word(across).ok_or(missing)?;
        let base = match self.modal.distance {
            Distance::Absolute => self.origin.get(usize::from(across)).copied().unwrap_or_default(),
            Distance::Incremental => cycle.bottom,
        };
        cycle.top = base.checked_add(top).ok_or(Status::OutOfRange)?;
        if cycle.top < cycle.bottom { Err(Status::AxisInvalid) } else { Ok(()) }
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

/// L: how many holes.
fn holes(block: &Block) -> Result<u16, Status> {
    let Some(word) = block.get(L) else { return Ok(1) };
    let holes = word.integer().ok().and_then(|holes| u16::try_from(holes).ok());
    holes.filter(|holes| *holes > 0).ok_or(Status::LWordInvalid)
}

/// Q, for the cycles that peck.
fn peck(mode: MotionMode, words: &Sticky) -> Result<Length, Status> {
    if !matches!(mode, MotionMode::ChipBreak | MotionMode::PeckDrill) {
        return Ok(Length::ZERO);
    }
    let peck = words.peck.ok_or(Status::QWordMissing)?;
    if peck > Length::ZERO { Ok(peck) } else { Err(Status::QWordInvalid) }
}

/// P, for the cycles that dwell; tapping may.
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
    /// Where a hole is, counted from 1; `None` beyond the range of a length.
    pub(super) fn hole(&self, number: u16) -> Option<[Value; 2]> {
        let along = |from: Value, pitch: Value| {
            let number = i32::from(number);
            // 16 by 15 bits, and 15.
            let rest = i32::from(from.rest) + number * i32::from(pitch.rest);
            let carry = (rest + HALF).div_euclid(2 * HALF);
            // In 64 bits: on AVR `checked_mul` of an `i32` calls a routine that writes 32 bits where the
            // compiler has left 16 for it.
            let way = i64::from(pitch.units.0) * i64::from(number) + i64::from(carry);
            let units = from.units.checked_add(Length(i32::try_from(way).ok()?))?;
            Some(Value { units, rest: (rest - carry * 2 * HALF) as i16 })
        };
        let [first, second] = [0, 1].map(|i| along(*self.from.get(i)?, *self.pitch.get(i)?));
        Some([first?, second?])
    }
}

/// Half a unit, in the scale of a rest.
const HALF: i32 = 5_000;
