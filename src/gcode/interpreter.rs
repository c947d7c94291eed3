//! The interpreter: one line of G-code in, canonical commands out, modal state and position kept.
//!
//! Called by the task that reads lines; never waits. A line that is refused changes nothing. The
//! position is the programmed one, ahead of the machine by whatever is queued.
//!
//! Order of execution (RS274/NGC section 3.8): feed mode, F, dwell, plane, units, distance mode,
//! position and offsets, motion, stop. One departure: the units come first, so that F is in the units
//! of its own line. LinuxCNC and TinyG read `G20 F10` in the units of the line before, which is 25.4
//! times too fast or too slow, and which their users keep reporting.
//!
//! Cost on AVR: of a usual line see `usual`; else, words and comments included: `X12.345 Y67.890` 3,600 cycles, with `G1` and `F1500`
//! 4,800; in inches 1,800 more for each axis; an arc 11,000, with R 14,000. Stack: 450 bytes, for an
//! arc 600.

use heapless::Vec;

use super::axes::{self, Axes};
use super::block::{Block, slot};
use super::codes::NonModal;
use super::command::{Commands, Motion, Stop};
use super::limits;
use super::modal::{FeedMode, Modal, PathMode, Units};
use crate::status::Status;
use crate::units::{AXES, Length, PerAxis};

/// What a line was, besides commands.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Info {
    /// Where in the line the text of its `(MSG ...)` lies: first byte, and the byte behind the last.
    pub message: Option<(u8, u8)>,
    /// A slash deleted the line: to be answered with [`Status::Noop`].
    pub deleted: bool,
    /// There was a comment.
    pub commented: bool,
}

/// The state of the G-code interpreter.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Interpreter {
    pub(super) modal: Modal,
    /// F as written, with G94 in force; 0 if none.
    pub(super) feed: f32,
    /// The units of `feed`.
    pub(super) feed_units: Units,
    /// End of the last move, machine coordinates.
    pub(super) position: PerAxis<Length>,
    /// What rounding took from `position`: ten-thousandths of a unit. Incremental moves carry it on.
    pub(super) residue: PerAxis<i16>,
    /// Machine coordinates of the work origin (G92).
    pub(super) offset: PerAxis<Length>,
    /// The axes whose position has been set to what it is (G28.3), as bits.
    homed: u8,
    pub(super) line: u32,
}

impl Interpreter {
    /// At power-up: everything 0; G80 G17 G21 G90 G94 G64.
    pub const fn new() -> Self {
        Self {
            modal: Modal::new(),
            feed: 0.0,
            feed_units: Units::Mm,
            position: [Length::ZERO; AXES],
            residue: [0; AXES],
            offset: [Length::ZERO; AXES],
            homed: 0,
            line: 0,
        }
    }

    /// Interprets one line without its terminator, for a machine with these `axes`.
    ///
    /// `Ok`: `out` is what the machine has to do, and the state has advanced as if it had done so.
    /// `Err`: the state is what it was, and `out` empty.
    pub fn interpret(
        &mut self,
        line: &[u8],
        axes: &impl Axes,
        out: &mut Commands,
    ) -> Result<Info, Status> {
        if self.usual(line, true, axes, out) {
            return Ok(Info::default());
        }
        self.general(line, axes, out)
    }

    /// The same for a line of any kind.
    #[inline(never)]
    pub(super) fn general(
        &mut self,
        line: &[u8],
        axes: &impl Axes,
        out: &mut Commands,
    ) -> Result<Info, Status> {
        clear(out);
        let mut block = Block::new();
        block.read(line)?;
        self.execute_or_undo(&mut block, axes, out)?;
        let Block { message, deleted, commented, .. } = block;
        Ok(Info { message, deleted, commented })
    }

    #[inline(never)]
    fn execute_or_undo(
        &mut self,
        block: &mut Block,
        axes: &impl Axes,
        out: &mut Commands,
    ) -> Result<(), Status> {
        if block.non_modal.is_some() {
            return self.execute_rarity(block, axes, out);
        }
        let mut before = Before::of(self);
        before.save_axes(self, block);
        let done = self.execute(block, axes, out);
        if done.is_err() {
            before.restore(self);
            clear(out);
        }
        done
    }

    /// The same for a block that may change more than modes and the position of its axes.
    #[inline(never)]
    fn execute_rarity(
        &mut self,
        block: &mut Block,
        axes: &impl Axes,
        out: &mut Commands,
    ) -> Result<(), Status> {
        let before = *self;
        let done = self.execute(block, axes, out);
        if done.is_err() {
            *self = before;
            clear(out);
        }
        done
    }

    /// The order of execution.
    #[inline(never)]
    fn execute(
        &mut self,
        block: &mut Block,
        axes: &impl Axes,
        out: &mut Commands,
    ) -> Result<(), Status> {
        if block.deleted {
            return Ok(());
        }
        self.number(block, out)?;
        self.modes(block);
        self.feed(block)?;
        self.non_modal(block, axes, out)?;
        // Limits are for homed axes alone; most machines are spared the copy.
        let start = if self.homed == 0 { None } else { Some(self.position) };
        self.motion(block, axes, out)?;
        if let Some(start) = &start {
            limits::check(start, &out.motion, self.homed, axes)?;
        }
        out.exact_stop = self.modal.path == PathMode::ExactStop;
        block.finish()?;
        self.stop(block, out);
        Ok(())
    }

    fn number(&mut self, block: &mut Block, out: &mut Commands) -> Result<(), Status> {
        self.line = block.take(slot::N).map_or(Ok(0), |value| value.integer())?;
        out.line = self.line;
        Ok(())
    }

    fn modes(&mut self, block: &Block) {
        let modal = &mut self.modal;
        set(&mut modal.feed_mode, block.feed_mode);
        set(&mut modal.plane, block.plane);
        set(&mut modal.units, block.units);
        set(&mut modal.distance, block.distance);
        set(&mut modal.path, block.path);
    }

    /// F with G94. With G93 it is for the move of its line alone, which takes it; afterwards G94
    /// needs an F of its own.
    fn feed(&mut self, block: &mut Block) -> Result<(), Status> {
        if self.modal.feed_mode == FeedMode::InverseTime {
            self.feed = 0.0;
        } else if let Some(value) = block.take(slot::F) {
            if value.negative {
                return Err(Status::OutOfRange);
            }
            self.feed = value.to_f32();
            self.feed_units = self.modal.units;
        }
        Ok(())
    }

    fn non_modal(
        &mut self,
        block: &mut Block,
        axes: &impl Axes,
        out: &mut Commands,
    ) -> Result<(), Status> {
        let Some(code) = block.non_modal else { return Ok(()) };
        if code.uses_axes() && !block.has(slot::AXES) {
            return Err(Status::AxisWordMissing);
        }
        match code {
            NonModal::Dwell => {
                let seconds = block.take(slot::P).ok_or(Status::PWordMissing)?;
                out.dwell_ms = Some(seconds.milliseconds()?);
            }
            NonModal::SetPosition => {
                out.set_position = Some(self.redefine_position(block, axes)?);
            }
            NonModal::SetOffset => self.redefine_offset(block, axes)?,
            NonModal::ClearOffset => self.offset = [Length::ZERO; AXES],
        }
        Ok(())
    }

    /// G28.3: the position is called the axis words, in machine coordinates.
    fn redefine_position(
        &mut self,
        block: &mut Block,
        axes: &impl Axes,
    ) -> Result<PerAxis<Option<Length>>, Status> {
        let mut named = [None; AXES];
        let all = self.position.iter_mut().zip(&mut self.residue).zip(&mut named);
        for (axis, ((position, residue), named)) in (0..).zip(all) {
            let value = axes::take(block, axis, self.modal.units, axes)?;
            let Some(value) = value else { continue };
            (*position, *residue, *named) = (value.units, value.rest, Some(value.units));
            self.homed |= 1 << axis;
        }
        Ok(named)
    }

    /// G92: the position is called the axis words, in work coordinates.
    fn redefine_offset(&mut self, block: &mut Block, axes: &impl Axes) -> Result<(), Status> {
        let all = self.position.iter().zip(&mut self.residue).zip(&mut self.offset);
        for (axis, ((position, residue), offset)) in (0..).zip(all) {
            let value = axes::take(block, axis, self.modal.units, axes)?;
            let Some(value) = value else { continue };
            *offset = position.checked_sub(value.units).ok_or(Status::OutOfRange)?;
            *residue = value.rest;
        }
        Ok(())
    }

    fn stop(&mut self, block: &Block, out: &mut Commands) {
        set(&mut out.stop, block.stop);
        if out.stop == Stop::End {
            self.modal.end_program();
            self.offset = [Length::ZERO; AXES];
        }
    }
}

/// What a block of moves and modes may change of the state, as it was: all of it would take 600 cycles
/// to copy.
struct Before {
    modal: Modal,
    feed: f32,
    feed_units: Units,
    line: u32,
    /// Position and residue of the axes that the block names.
    axes: Vec<(u8, Length, i16), AXES>,
}

impl Before {
    #[inline(always)]
    fn of(state: &Interpreter) -> Self {
        let Interpreter { modal, feed, feed_units, line, .. } = *state;
        Self { modal, feed, feed_units, line, axes: Vec::new() }
    }

    #[inline(always)]
    fn save_axes(&mut self, state: &Interpreter, block: &Block) {
        for axis in block.axes() {
            let i = usize::from(axis);
            if let (Some(position), Some(residue)) = (state.position.get(i), state.residue.get(i)) {
                // There is room for all axes.
                let _ = self.axes.push((axis, *position, *residue));
            }
        }
    }

    #[inline(never)]
    fn restore(&self, state: &mut Interpreter) {
        state.modal = self.modal;
        state.feed = self.feed;
        state.feed_units = self.feed_units;
        state.line = self.line;
        for (axis, position, residue) in &self.axes {
            let i = usize::from(*axis);
            if let (Some(p), Some(r)) = (state.position.get_mut(i), state.residue.get_mut(i)) {
                (*p, *r) = (*position, *residue);
            }
        }
    }
}

/// What reports read, and what the machine corrects.
impl Interpreter {
    /// The modes in force.
    pub fn modal(&self) -> &Modal {
        &self.modal
    }

    /// End of the last move, machine coordinates.
    pub fn position(&self) -> &PerAxis<Length> {
        &self.position
    }

    /// Machine coordinates of the work origin: work position = machine position - this.
    pub fn work_offset(&self) -> &PerAxis<Length> {
        &self.offset
    }

    /// F in mm/min; 0 if none is in force, as always with G93.
    pub fn feed_rate(&self) -> f32 {
        match self.feed_units {
            Units::Inch => self.feed * 25.4,
            Units::Mm => self.feed,
        }
    }

    /// The coordinate system: 1, which is G54.
    pub fn coordinate_system(&self) -> u8 {
        1
    }

    /// Whether an axis is homed: soft limits are for such axes alone.
    pub fn is_homed(&self, axis: u8) -> bool {
        self.homed & 1 << axis != 0
    }

    /// The N word of the last line, 0 if it had none.
    pub fn line(&self) -> u32 {
        self.line
    }

    /// Moves the model to where the machine is: after homing, and after the queue was dropped.
    pub fn set_position(&mut self, machine: &PerAxis<Length>) {
        self.position = *machine;
        self.residue = [0; AXES];
    }
}

impl Default for Interpreter {
    fn default() -> Self {
        Self::new()
    }
}

/// Empties `out`, touching nothing but the tags: it is large.
fn clear(out: &mut Commands) {
    out.line = 0;
    out.dwell_ms = None;
    out.set_position = None;
    out.motion = Motion::None;
    out.exact_stop = false;
    out.stop = Stop::None;
}

fn set<T>(mode: &mut T, new: Option<T>) {
    if let Some(new) = new {
        *mode = new;
    }
}
