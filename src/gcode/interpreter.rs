//! The interpreter: one line of G-code in, canonical commands out, modal state and position kept.
//!
//! Called by the task that reads lines; never waits. A line that is refused changes nothing. The
//! position is the programmed one, ahead of the machine by whatever is queued.
//!
//! Order of execution (RS274/NGC section 3.8): feed mode, F, S, T, M6, spindle, coolant, overrides, dwell,
//! plane, units, tool length, coordinate system, path, distance, retract, group 0, motion, stop. One
//! departure: the units come first, so that F is in the units of its own line. LinuxCNC and TinyG read
//! `G20 F10` in the units of the line before, which is 25.4 times too fast or too slow, and which their
//! users keep reporting.
//!
//! Cost on AVR: of a usual line see `fast_path`; of others, words and comments included, at most 6,000 cycles for
//! a typical G1, in inches too (`tests/sim/tests/interpreter.rs`).

use super::block::Block;
use super::codes::NonModal;
use super::command::{Commands, Spindle, Surface};
use super::fast_path::Writer;
use super::modal::{Defaults, FeedMode, Modal, MotionMode, SpeedMode, Turn, Units, XMode};
use super::printing::Kept;
use super::setup::Setup;
use super::state::State;
use super::sticky::Sticky;
use super::tables::{Edit, Ram, TableRow, Tables};
use crate::capability::Capability;
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

/// The state of the G-code interpreter, and who keeps its tables.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Interpreter<T = Ram> {
    pub(super) state: State,
    tables: T,
}

impl Interpreter {
    /// At power-up: everything 0; G80 and the usual modes.
    pub const fn new() -> Self {
        Self::with(Ram::new())
    }
}

impl<T> Interpreter<T> {
    /// An interpreter at power-up whose tables are kept elsewhere.
    pub const fn with(tables: T) -> Self {
        Self { state: State::new(&Defaults::USUAL), tables }
    }
}

impl<T: Tables> Interpreter<T> {
    /// Starts in the modes that the machine starts in.
    pub fn start(&mut self, setup: &impl Setup) {
        self.state.modal = Modal::new(&setup.defaults());
        // Nothing else shifts the origin yet, so that the sum is within the range.
        self.restore_origin();
    }

    /// G0 is in force unless another motion mode is: where grbl's dialect begins.
    pub fn begin_with_rapids(&mut self) {
        if self.state.modal.motion == MotionMode::None {
            self.state.modal.motion = MotionMode::Traverse;
        }
    }

    /// What a reset of grbl does besides the end of a program: G0, T0, S0, no tool length.
    #[inline(never)]
    #[small]
    pub fn reset(&mut self) {
        let state = &mut self.state;
        state.modal.motion = MotionMode::Traverse;
        (state.selected, state.speed) = (0, 0.0);
        for axis in 0..AXES as u8 {
            // The sum of what is left is within the range.
            let _ = state.set_tool_length(axis, Length::ZERO);
        }
    }

    /// Sets a value of a row as G10 does: it is in force when this returns. [`Status::Again`] as of
    /// [`Self::interpret`]; after an error everything is what it was.
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

    /// Sets the tool length on one axis, machine coordinates, as G43.1 does; lines that are interpreted later go by it.
    #[small]
    pub fn set_tool_length(&mut self, axis: u8, length: Length) -> Result<(), Status> {
        self.state.set_tool_length(axis, length)
    }

    /// Interprets one line without its terminator, for a machine that is `setup` so.
    ///
    /// `Ok`: `out` is what the machine has to do, and the state has advanced as if it had done so.
    /// `Err`: the state is what it was, and `out` empty. [`Status::Again`]: the tables are not ready for the line,
    /// which is to be tried again.
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

    /// Carries a line out by the fast path: see [`State::fast_path`].
    pub fn fast_path(
        &mut self,
        line: &[u8],
        writer: Writer,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> bool {
        self.state.fast_path(line, writer, setup, out)
    }

    /// Interprets a line as [`Self::interpret`] does, without trying [`Self::fast_path`] first. Call it when that has declined the line.
    #[inline(never)]
    pub fn slow_path(
        &mut self,
        line: &[u8],
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<Info, Status> {
        out.clear();
        let mut block = Block::new();
        let deletes = setup.deletes_blocks();
        block.read(line, deletes)?;
        block.check(self.state.modal.motion)?;
        self.halve(&mut block);
        self.execute_or_undo(&block, setup, out)?;
        let Block { message, slashed, commented, .. } = block;
        Ok(Info { message, deleted: slashed && deletes, commented })
    }

    /// Interprets the words of a jog: a move at their feed rate, in their units and distance mode or those in force, after which everything
    /// modal is as it was.
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
        // Of what is rare a jog has G53 alone, which is a matter of its move.
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

    /// Makes a radius of the X word if it is a diameter, for whatever it is used.
    #[inline(always)]
    fn halve(&self, block: &mut Block) {
        let mode = block.x_mode.unwrap_or(self.state.modal.x_mode);
        if Capability::Lathe.is_built_in() && mode == XMode::Diameter {
            block.halve_x();
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

    /// Executes a block of modes, the feed, and the position of the axes that it names, or nothing of it.
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

    /// Executes a block that may change more than modes, the feed and the position of its axes.
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
        match (&done, &edit) {
            (Ok(()), Some(edit)) => self.tables.apply(edit),
            (Ok(()), None) => {}
            (Err(_), _) => {
                before.restore(&mut self.state);
                self.state.lacks_length = false;
                self.restore_origin();
                out.clear();
            }
        }
        done
    }

    /// The origin by what it is the sum of, which was within the range before.
    #[inline(never)]
    #[small]
    fn restore_origin(&mut self) {
        let _ =
            self.state.update_origin(&self.tables.row(TableRow::system(self.state.modal.system)));
    }
}

/// What a block of moves and modes may change of the state, as it was: all of it would take 1,500 cycles
/// to copy.
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

/// What a block of any kind may change, but for the words of a cycle, which `State` sees to, and the origin:
/// the less of it there is the better, for the deepest stack is below it.
struct RareBefore {
    usual: Before,
    homed: u8,
    shift: PerAxis<Length>,
    shifted: bool,
    tool_length: PerAxis<Length>,
    speed: f32,
    limit: u16,
    selected: u8,
    tool: u8,
}

#[small]
impl RareBefore {
    fn of(state: &State) -> Self {
        let State { homed, shift, shifted, tool_length, speed, limit, selected, tool, .. } = *state;
        let usual = Before::of(state);
        Self { usual, homed, shift, shifted, tool_length, speed, limit, selected, tool }
    }

    #[inline(never)]
    fn restore(&self, state: &mut State) {
        self.usual.restore(state);
        state.homed = self.homed;
        (state.shift, state.shifted) = (self.shift, self.shifted);
        state.tool_length = self.tool_length;
        (state.speed, state.limit) = (self.speed, self.limit);
        (state.selected, state.tool) = (self.selected, self.tool);
    }
}

/// Modes and words of the program, as they were before lines were checked: what [`Offsets`] do not have. Position and the words of canned
/// cycles are not kept.
#[derive(Clone, Copy, Debug)]
pub struct Modes {
    modal: Modal,
    feed: f32,
    feed_units: Units,
    line: u32,
    homed: u8,
    speed: f32,
    limit: u16,
    selected: u8,
    tool: u8,
}

/// Offsets that are in no table, as they were before lines were checked.
#[derive(Clone, Copy, Debug)]
pub struct Offsets {
    shift: PerAxis<Length>,
    shifted: bool,
    tool_length: PerAxis<Length>,
}

#[small]
impl<T: Tables> Interpreter<T> {
    /// What lines that are only checked may change, to [give it back](Self::give_back) afterwards.
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

    /// Everything is as it was kept, and the machine at this place. A canned cycle that was in force is not any more; nor is an axis
    /// homed that has lost its place meanwhile.
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

/// What reports read, and what the machine corrects.
impl<T> Interpreter<T> {
    /// The modes in force.
    pub fn modal(&self) -> &Modal {
        &self.state.modal
    }

    /// End of the last move, machine coordinates.
    pub fn position(&self) -> &PerAxis<Length> {
        &self.state.position
    }

    /// Machine coordinates of the work origin: work position = machine position - this.
    pub fn work_offset(&self) -> &PerAxis<Length> {
        &self.state.origin
    }

    /// G92, whether or not it is in force.
    pub fn shift(&self) -> &PerAxis<Length> {
        &self.state.shift
    }

    /// The tool length in force, on each axis; a part of the work offset.
    pub fn tool_length(&self) -> &PerAxis<Length> {
        &self.state.tool_length
    }

    /// F in mm/min (or mm a turn); 0 if none is in force, as always with G93.
    pub fn feed_rate(&self) -> f32 {
        match self.state.feed_units {
            Units::Inch => self.state.feed * 25.4,
            Units::Mm => self.state.feed,
        }
    }

    /// S, in turns per minute.
    pub fn spindle_speed(&self) -> f32 {
        self.state.speed
    }

    /// G96, if it is in force.
    pub fn surface(&self) -> Option<Surface> {
        self.state.surface()
    }

    /// The coordinate system: 1, which is G54, to 9, which is G59.3.
    pub fn coordinate_system(&self) -> u8 {
        self.state.modal.system + 1
    }

    /// Whether the line before asked for the length of a tool that has none, so that 0 is in force. Asked once.
    pub fn take_lack(&mut self) -> bool {
        core::mem::take(&mut self.state.lacks_length)
    }

    /// The tool in the spindle; 0 for none.
    pub fn tool(&self) -> u8 {
        self.state.tool
    }

    /// The tool of the last T.
    pub fn selected_tool(&self) -> u8 {
        self.state.selected
    }

    /// Whether an axis is homed: soft limits are for such axes alone.
    pub fn is_homed(&self, axis: u8) -> bool {
        self.state.homed & 1 << axis != 0
    }

    /// No axis is homed any more.
    pub fn forget_homes(&mut self) {
        self.state.homed = 0;
    }

    /// An axis is homed, or no more.
    pub fn set_homed(&mut self, axis: u8, homed: bool) {
        let bit = 1 << axis;
        self.state.homed = self.state.homed & !bit | if homed { bit } else { 0 };
    }

    /// The axis that could not be homed last: refused, or on the way.
    pub fn blamed(&self) -> u8 {
        self.state.blamed
    }

    /// An axis could not be homed.
    pub fn blame(&mut self, axis: u8) {
        self.state.blamed = axis;
    }

    /// No motion mode is in force any more, as after G28.2.
    pub fn cancel_motion(&mut self) {
        self.state.modal.motion = MotionMode::None;
    }

    /// The N word of the last line, 0 if it had none.
    pub fn line(&self) -> u32 {
        self.state.line
    }

    /// Spindle and coolant are so: commands to switch them have been dropped. S of a spindle that is off stays.
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

    /// The coolants that run are these: not a line has switched them.
    pub fn set_coolant(&mut self, coolant: u8) {
        self.state.modal.coolant = coolant;
    }

    /// Moves the model to where the machine is: after homing, and after the queue was dropped.
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
