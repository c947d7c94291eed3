//! The interpreter: takes one line of G-code, returns canonical commands, and keeps the modal state and the position.
//!
//! The parser task calls it. It never waits. A line that is refused changes nothing. The position is the programmed
//! one: it is ahead of the machine by the moves that are queued.
//!
//! Order of execution (RS274/NGC section 3.8): feed mode, F, S, T, M6, spindle, coolant, overrides, dwell,
//! plane, units, tool length, coordinate system, path, distance, retract, group 0, motion, stop. One
//! departure: the units come first, so that F is in the units of its own line. LinuxCNC and TinyG read
//! `G20 F10` in the units of the previous line, which is 25.4 times too fast or too slow. Their users keep
//! reporting this as a bug.
//!
//! Cost on AVR: for a usual line see `fast_path`. For a typical G1 off the fast path, in millimetres or inches and
//! with all its words and comments, at most 6,000 cycles (`tests/sim/tests/interpreter.rs`).

use core::borrow::BorrowMut;

use super::block::Block;
use super::codes::NonModal;
use super::command::{Commands, Spindle, Surface};
use super::fast_path::Writer;
use super::language::{self, Language};
use super::modal::{Defaults, FeedMode, Modal, MotionMode, Plane, SpeedMode, Turn, Units, XMode};
use super::printing::Kept;
use super::setup::Setup;
use super::state::State;
use super::sticky::Sticky;
use super::tables::{Edit, Ram, TableRow, Tables};
use super::words::{I, R, X};
use crate::capability::Capability;
use crate::status::Status;
use crate::units::{AXES, Length, PerAxis};

/// What a line contained besides commands.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Info {
    /// Where in the line the text of its `(MSG ...)` lies: the index of the first byte, and of the byte behind the
    /// last.
    pub message: Option<(u8, u8)>,
    /// Whether a slash deleted the line. The answer to such a line is [`Status::Noop`].
    pub deleted: bool,
    /// Whether the line had a comment.
    pub commented: bool,
    /// Whether the line has asked for the length of a tool without a length, so that 0 is in force.
    pub lacks_length: bool,
}

/// The state of the G-code interpreter, and the tables that outlast a program.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Interpreter<T = Ram, L = Language> {
    pub(super) state: State,
    pub(super) tables: T,
    pub(super) language: L,
}

impl Interpreter {
    /// Returns an interpreter at power-up: everything is 0, and G80 and the usual modes are in force.
    pub const fn new() -> Self {
        Self::with(Ram::new())
    }
}

impl<T> Interpreter<T> {
    /// Returns an interpreter at power-up whose tables are kept by `tables`.
    pub const fn with(tables: T) -> Self {
        Self::with_language(tables, Language::new())
    }
}

impl<T, L> Interpreter<T, L> {
    /// Returns an interpreter at power-up, as [`Self::with`] does, whose parameters are kept by `language`.
    pub const fn with_language(tables: T, language: L) -> Self {
        Self { state: State::new(&Defaults::USUAL), tables, language }
    }
}

impl<T: Tables, L: BorrowMut<Language>> Interpreter<T, L> {
    /// Puts the default modes of the machine in force.
    pub fn start(&mut self, setup: &impl Setup) {
        self.state.modal = Modal::new(&setup.defaults());
        // Nothing else shifts the origin yet, so the sum cannot leave the range.
        self.restore_origin();
    }

    /// Puts G0 in force if no motion mode is in force, as at the start of grbl's dialect.
    pub fn begin_with_rapids(&mut self) {
        if self.state.modal.motion == MotionMode::None {
            self.state.modal.motion = MotionMode::Traverse;
        }
    }

    /// Does what a reset of grbl does in addition to the end of a program: G0, T0, S0, no tool length.
    #[inline(never)]
    #[small]
    pub fn reset(&mut self) {
        let state = &mut self.state;
        state.modal.motion = MotionMode::Traverse;
        (state.selected, state.speed) = (0, 0.0);
        for axis in 0..AXES as u8 {
            // Cannot fail: without the tool length the sum is within the range.
            let _ = state.set_tool_length(axis, Length::ZERO);
        }
    }

    /// Sets one value of a table row, as G10 does. The value is in force when this returns. After an error nothing has
    /// changed. For [`Status::Again`] see [`Self::interpret`].
    #[inline(never)]
    pub fn set(&mut self, row: TableRow, axis: u8, value: Length) -> Result<(), Status> {
        let mut values = self.tables.row(row);
        *values.get_mut(usize::from(axis)).ok_or(Status::AxisInvalid)? = value;
        let edit = Edit::new(row, values, &self.tables)?;
        if row == TableRow::system(self.state.modal.system) {
            let before = self.state.origin;
            self.state.update_origin(&values).inspect_err(|_| self.state.origin = before)?;
        }
        self.tables.apply(&edit);
        Ok(())
    }

    /// Sets the tool length on one axis, in machine coordinates, as G43.1 does. It applies to the lines that are
    /// interpreted from now on.
    #[small]
    pub fn set_tool_length(&mut self, axis: u8, length: Length) -> Result<(), Status> {
        self.state.set_tool_length(axis, length)
    }

    /// Interprets one line without its terminator. `setup` describes the machine.
    ///
    /// After `Ok`, `out` contains what the machine has to do, and the state has advanced as if that were done. After
    /// `Err`, the state is unchanged and `out` is empty. [`Status::Again`] says that the tables are not ready for the
    /// line: the caller tries it again later.
    pub fn interpret(
        &mut self,
        line: &[u8],
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<Info, Status> {
        if self.fast_path(line, Writer::Numbers, setup, out) {
            return Ok(Info::default());
        }
        self.slow_path(line, setup, out)
    }

    /// Carries a line out by the fast path. Returns false if the fast path declines the line: see [`State::fast_path`].
    pub fn fast_path(
        &mut self,
        line: &[u8],
        writer: Writer,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> bool {
        if Capability::Language.is_built_in() && self.takes_all() {
            return false;
        }
        self.state.fast_path(line, writer, setup, out)
    }

    /// Interprets a line as [`Self::interpret`] does, without trying [`Self::fast_path`] first. Call it when the fast
    /// path has declined the line.
    #[inline(never)]
    pub fn slow_path(
        &mut self,
        line: &[u8],
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<Info, Status> {
        out.clear();
        if Capability::Language.is_built_in() && (self.has_flow() || language::is_needed(line)) {
            return self.computed(line, setup, out);
        }
        let mut block = Block::new();
        let deletes = setup.deletes_blocks();
        let read = block.read(line, deletes);
        if let Err(status) = read.and_then(|()| block.check(self.state.modal.motion)) {
            return if block.named {
                Ok(Info::default())
            } else {
                Err(language::refusal(line, status))
            };
        }
        self.finish(&mut block, deletes, setup, out)
    }

    /// Executes a block that has been read and checked.
    #[inline(always)]
    pub(super) fn finish(
        &mut self,
        block: &mut Block,
        deletes: bool,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<Info, Status> {
        self.halve(block);
        self.execute_or_undo(block, setup, out)?;
        let lacks_length = self.state.lacks_length(block);
        let Block { message, slashed, commented, .. } = *block;
        Ok(Info { message, deleted: slashed && deletes, commented, lacks_length })
    }

    /// Interprets the words of a jog: one feed move. The words have to give the feed rate. They may give units and a
    /// distance mode, else those in force apply. The modal state does not change.
    #[inline(never)]
    #[small]
    pub fn jog(
        &mut self,
        words: &[u8],
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<Info, Status> {
        out.clear();
        let mut block = Block::new();
        block.read(words, false)?;
        block.check(MotionMode::Feed)?;
        self.halve(&mut block);
        // The only rare code in a jog is G53, which affects nothing but the move.
        if block.is_rare() && block.non_modal != Some(NonModal::MachineCoordinates) {
            return Err(Status::GcodeUnsupported);
        }
        let State { modal, feed, feed_units, line, .. } = self.state;
        self.state.modal.motion = MotionMode::Feed;
        self.state.modal.feed_mode = FeedMode::PerMinute;
        self.state.feed = 0.0;
        let done = self.execute_common(&block, setup, out);
        let state = &mut self.state;
        (state.modal, state.feed, state.feed_units, state.line) = (modal, feed, feed_units, line);
        done.map(|()| Info::default())
    }

    /// Converts the X word from a diameter to a radius if G7 is in force, whatever the word is used for. In a canned
    /// cycle along X also the other words that are coordinates of X: R, and I of G87.
    #[inline(always)]
    fn halve(&self, block: &mut Block) {
        let mode = block.x_mode.unwrap_or(self.state.modal.x_mode);
        if Capability::Lathe.is_built_in() && mode == XMode::Diameter {
            self.halve_words(block);
        }
    }

    #[inline(never)]
    #[small]
    fn halve_words(&self, block: &mut Block) {
        block.halve(X);
        let plane = block.plane.unwrap_or(self.state.modal.plane);
        if plane == Plane::Yz && block.does().is_some_and(MotionMode::is_cycle) {
            block.halve(R);
            block.halve(I);
        }
    }

    #[inline(never)]
    fn execute_or_undo(
        &mut self,
        block: &Block,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        if block.is_rare() || block.does().is_some_and(MotionMode::is_cycle) {
            return self.execute_rare(block, setup, out);
        }
        self.execute_common(block, setup, out)
    }

    /// Executes a block that changes only modes, the feed and the position of its axes. If the block is refused, undoes
    /// all of it.
    #[inline(never)]
    fn execute_common(
        &mut self,
        block: &Block,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        let before = Before::of(&self.state);
        let done = self.state.execute(block, &before.position, &self.tables, setup, out);
        self.state.carry_flow(done.is_ok());
        if done.is_err() {
            before.restore(&mut self.state);
            out.clear();
        }
        done
    }

    /// Executes a block that may change more than modes, the feed and the position of its axes. If the block is
    /// refused, undoes all of it.
    #[inline(never)]
    #[small]
    fn execute_rare(
        &mut self,
        block: &Block,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        let before = RareBefore::of(&self.state);
        let mut edit = None;
        let done = self.state.execute_rare(
            block,
            &before.usual.position,
            &self.tables,
            setup,
            out,
            &mut edit,
        );
        self.state.carry_flow(done.is_ok());
        self.state.moves_origin |= done.is_ok() && before.has_other_origin(&self.state);
        match (&done, &edit) {
            (Ok(()), Some(edit)) => self.tables.apply(edit),
            (Ok(()), None) => {}
            (Err(_), _) => {
                before.restore(&mut self.state);
                out.clear();
            }
        }
        done
    }

    /// Computes the origin again as the sum of its parts. The sum was within the range before, so this cannot fail.
    #[inline(never)]
    #[small]
    fn restore_origin(&mut self) {
        let _ =
            self.state.update_origin(&self.tables.row(TableRow::system(self.state.modal.system)));
    }
}

/// A copy of those parts of the state that a block of moves and modes may change. A copy of the whole state would take
/// 1,500 cycles.
struct Before {
    modal: Modal,
    feed: f32,
    feed_units: Units,
    line: u32,
    position: PerAxis<Length>,
    residue: PerAxis<i16>,
    printing: Kept,
}

impl Before {
    #[inline(always)]
    fn of(state: &State) -> Self {
        let State { modal, feed, feed_units, line, position, residue, printing, .. } = *state;
        Self { modal, feed, feed_units, line, position, residue, printing: printing.kept() }
    }

    #[inline(never)]
    fn restore(&self, state: &mut State) {
        state.modal = self.modal;
        state.feed = self.feed;
        state.feed_units = self.feed_units;
        state.line = self.line;
        state.position = self.position;
        state.residue = self.residue;
        state.printing.take_back(self.printing);
    }
}

/// A copy of those parts of the state that any block may change, except the words of a canned cycle, which `State`
/// restores itself. It is kept small because the deepest stack is reached while it exists. The origin is copied because
/// the tables do not have what G10 has set in check mode.
struct RareBefore {
    usual: Before,
    origin: PerAxis<Length>,
    homed: u8,
    shift: PerAxis<Length>,
    shifted: bool,
    tool_length: PerAxis<Length>,
    speed: f32,
    limit: u16,
    selected: u16,
    tool: u16,
}

#[small]
impl RareBefore {
    fn of(state: &State) -> Self {
        let State { homed, shift, shifted, tool_length, speed, limit, selected, tool, .. } = *state;
        let (usual, origin) = (Before::of(state), state.origin);
        Self { usual, origin, homed, shift, shifted, tool_length, speed, limit, selected, tool }
    }

    /// Whether a state differs in the origin, the coordinate system or the tool.
    #[inline(never)]
    fn has_other_origin(&self, state: &State) -> bool {
        let mut differs = self.usual.modal.system != state.modal.system || self.tool != state.tool;
        for (before, now) in self.origin.iter().zip(&state.origin) {
            differs |= before != now;
        }
        differs
    }

    #[inline(never)]
    fn restore(&self, state: &mut State) {
        self.usual.restore(state);
        state.origin = self.origin;
        state.homed = self.homed;
        (state.shift, state.shifted) = (self.shift, self.shifted);
        state.tool_length = self.tool_length;
        (state.speed, state.limit) = (self.speed, self.limit);
        (state.selected, state.tool) = (self.selected, self.tool);
    }
}

/// Modes and words of the program before check mode began. Together with [`Offsets`] this is all that is kept; the
/// position and the words of canned cycles are not.
#[derive(Clone, Copy, Debug)]
pub struct Modes {
    modal: Modal,
    feed: f32,
    feed_units: Units,
    line: u32,
    homed: u8,
    speed: f32,
    limit: u16,
    selected: u16,
    tool: u16,
}

/// The offsets that are in no table, as they were before check mode began.
#[derive(Clone, Copy, Debug)]
pub struct Offsets {
    shift: PerAxis<Length>,
    shifted: bool,
    tool_length: PerAxis<Length>,
}

#[small]
impl<T: Tables, L: BorrowMut<Language>> Interpreter<T, L> {
    /// Returns what lines in check mode may change. [`Self::give_back`] restores it afterwards.
    #[inline(never)]
    pub fn keep(&self) -> (Modes, Offsets) {
        let State { modal, feed, feed_units, line, homed, speed, limit, selected, tool, .. } =
            self.state;
        let State { shift, shifted, tool_length, .. } = self.state;
        (
            Modes { modal, feed, feed_units, line, homed, speed, limit, selected, tool },
            Offsets { shift, shifted, tool_length },
        )
    }

    /// Restores what [`Self::keep`] has returned, and moves the model to `place`, the position of the machine. Cancels
    /// a canned cycle that was in force. An axis that was marked as not homed in the meantime stays so.
    #[inline(never)]
    pub fn give_back(&mut self, modes: &Modes, offsets: &Offsets, place: &PerAxis<Length>) {
        let state = &mut self.state;
        state.modal = modes.modal;
        if modes.modal.motion.is_cycle() {
            state.modal.motion = MotionMode::None;
        }
        (state.feed, state.feed_units) = (modes.feed, modes.feed_units);
        state.line = modes.line;
        state.homed &= modes.homed;
        (state.speed, state.limit) = (modes.speed, modes.limit);
        (state.selected, state.tool) = (modes.selected, modes.tool);
        (state.shift, state.shifted) = (offsets.shift, offsets.shifted);
        state.tool_length = offsets.tool_length;
        state.sticky = Sticky::NONE;
        self.set_position(place);
        self.restore_origin();
    }
}

/// Getters for reports, and setters for what the machine itself changes.
impl<T, L> Interpreter<T, L> {
    /// Returns the modes in force.
    pub fn modal(&self) -> &Modal {
        &self.state.modal
    }

    /// Returns the end of the last move, machine coordinates.
    pub fn position(&self) -> &PerAxis<Length> {
        &self.state.position
    }

    /// Returns the machine coordinates of the work origin: work position = machine position - work offset.
    pub fn work_offset(&self) -> &PerAxis<Length> {
        &self.state.origin
    }

    /// Returns the offsets of G92, whether or not they are in force.
    pub fn shift(&self) -> &PerAxis<Length> {
        &self.state.shift
    }

    /// Returns the tool length in force, on each axis. It is a part of the work offset.
    pub fn tool_length(&self) -> &PerAxis<Length> {
        &self.state.tool_length
    }

    /// Returns the feed in force: mm/min with G94, mm a turn with G95. Returns 0 before the first F word, and always
    /// with G93.
    pub fn feed_rate(&self) -> f32 {
        match self.state.feed_units {
            Units::Inch => self.state.feed * 25.4,
            Units::Mm => self.state.feed,
        }
    }

    /// Returns S: turns per minute, or m/min with G96.
    pub fn spindle_speed(&self) -> f32 {
        self.state.speed
    }

    /// Returns the surface speed of G96. `None` with G97.
    pub fn surface(&self) -> Option<Surface> {
        self.state.surface()
    }

    /// Returns the coordinate system in force: 1 for G54, to 9 for G59.3.
    pub fn coordinate_system(&self) -> u8 {
        self.state.modal.system + 1
    }

    /// Whether lines have changed the origin, the coordinate system or the tool. Resets the answer.
    pub fn take_moved_origin(&mut self) -> bool {
        core::mem::take(&mut self.state.moves_origin)
    }

    /// Returns the tool in the spindle, 0 for none.
    pub fn tool(&self) -> u16 {
        self.state.tool
    }

    /// Returns the tool of the last T word.
    pub fn selected_tool(&self) -> u16 {
        self.state.selected
    }

    /// Whether an axis is homed. Soft limits apply to homed axes only.
    pub fn is_homed(&self, axis: u8) -> bool {
        self.state.homed & 1 << axis != 0
    }

    /// Marks all axes as not homed.
    pub fn forget_homes(&mut self) {
        self.state.homed = 0;
    }

    /// Sets whether an axis is homed.
    pub fn set_homed(&mut self, axis: u8, homed: bool) {
        let bit = 1 << axis;
        self.state.homed = self.state.homed & !bit | if homed { bit } else { 0 };
    }

    /// Returns the axis whose homing failed last, because the line was refused or during the homing cycle.
    pub fn blamed(&self) -> u8 {
        self.state.blamed
    }

    /// Records the axis whose homing has failed.
    pub fn blame(&mut self, axis: u8) {
        self.state.blamed = axis;
    }

    /// Cancels the motion mode, as G28.2 does; with `only_cycles` only that of a canned cycle.
    pub fn cancel_motion(&mut self, only_cycles: bool) {
        if !only_cycles || self.state.modal.motion.is_cycle() {
            self.state.modal.motion = MotionMode::None;
        }
    }

    /// Returns the N word of the last line, 0 if the line had none.
    pub fn line(&self) -> u32 {
        self.state.line
    }

    /// Takes over the actual state of spindle and coolant, after commands that would have switched them were dropped.
    /// If the spindle is off, S stays.
    pub fn set_outputs(&mut self, spindle: &Spindle, surface: Option<&Surface>, coolant: u8) {
        let state = &mut self.state;
        state.modal.spindle = spindle.turn;
        if spindle.turn != Turn::Off {
            let mode = surface.map(|_| SpeedMode::Surface);
            state.modal.speed_mode = mode.unwrap_or(SpeedMode::Turns);
            state.speed = surface.map_or(spindle.speed, |surface| surface.speed);
            state.limit = surface.map_or(0, |surface| surface.limit);
        }
        state.modal.coolant = coolant;
    }

    /// Sets the coolants that run, after something other than a line of the program has switched them.
    pub fn set_coolant(&mut self, coolant: u8) {
        self.state.modal.coolant = coolant;
    }

    /// Moves the model to the position of the machine: after homing, and after the queue was dropped.
    pub fn set_position(&mut self, machine: &PerAxis<Length>) {
        self.state.position = *machine;
        self.state.residue = [0; AXES];
    }
}

impl Default for Interpreter {
    fn default() -> Self {
        Self::new()
    }
}
