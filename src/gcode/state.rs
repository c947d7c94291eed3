//! The state that one line leaves to the next, and the order in which a line changes it.
//!
//! The functions here may leave the state half changed when they refuse a line. [`Interpreter`](super::interpreter)
//! then restores it.

use super::block::Block;
use super::codes::{NonModal, OverrideCode, StopCode, Switch};
use super::command::{Commands, N_MAX, Spindle, Stop};
use super::limits;
use super::modal::{
    Coolant, Defaults, FeedMode, Modal, MotionMode, PathMode, TOLERANCE_MAX, Turn, USUAL, Units,
};
use super::overrides::{Change, Override};
use super::printing::Printing;
use super::setup::Setup;
use super::sticky::Sticky;
use super::tables::{Edit, TableRow, Tables};
use super::words::{F, N, P, S, T};
use crate::capability::Capability;
use crate::status::Status;
use crate::units::{AXES, Length, PerAxis};

/// Everything that a line may change, except the tables.
#[derive(Clone, Copy, PartialEq, Debug)]
// The fields have a fixed order because AVR accesses those within 63 bytes of the first in one instruction.
#[repr(C)]
pub struct State {
    pub modal: Modal,
    /// The units of `feed`.
    pub feed_units: Units,
    /// F as written, while G94 or G95 is in force. 0 if no F is in force.
    pub feed: f32,
    pub line: u32,
    /// The residue of rounding in `position`, in ten-thousandths of a unit. Incremental moves add it to the next
    /// length.
    pub residue: PerAxis<i16>,
    /// End of the last move, machine coordinates.
    pub position: PerAxis<Length>,
    /// Machine coordinates of the work origin: coordinate system, G92 and tool length together.
    pub origin: PerAxis<Length>,
    /// The axes that are homed: whose position has been set by a homing cycle or by G28.3, as bits.
    pub homed: u8,
    /// The axis whose homing failed last.
    pub blamed: u8,
    /// The offsets of G92, whether or not they are in force.
    pub shift: PerAxis<Length>,
    pub shifted: bool,
    /// The tool length in force (G43, G43.1, G43.2).
    pub tool_length: PerAxis<Length>,
    /// A line has changed the origin, the coordinate system or the tool. The parser takes this.
    pub moves_origin: bool,
    /// S: turns a minute, or m/min with G96.
    pub speed: f32,
    /// D of G96: the most turns a minute; 0 for no limit.
    pub limit: u16,
    /// The tool of the last T word.
    pub selected: u16,
    /// The tool in the spindle: the one that was selected at the last M6.
    pub tool: u16,
    /// How the extruder of a printer interprets its words.
    pub printing: Printing,
    /// The words of canned cycles that stay in force.
    pub sticky: Sticky,
}

impl State {
    /// Returns the state at power-up: everything is 0.
    pub const fn new(defaults: &Defaults) -> Self {
        Self {
            modal: Modal::new(defaults),
            feed: 0.0,
            feed_units: Units::Mm,
            position: [Length::ZERO; AXES],
            residue: [0; AXES],
            origin: [Length::ZERO; AXES],
            homed: 0,
            blamed: 0,
            line: 0,
            shift: [Length::ZERO; AXES],
            shifted: false,
            tool_length: [Length::ZERO; AXES],
            moves_origin: false,
            speed: 0.0,
            limit: 0,
            selected: 0,
            tool: 0,
            printing: Printing::NONE,
            sticky: Sticky::NONE,
        }
    }

    /// Carries out a block of modes and moves. `start` is where the previous line has ended.
    #[inline(never)]
    pub fn execute(
        &mut self,
        block: &Block,
        start: &PerAxis<Length>,
        tables: &impl Tables,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        self.begin(block, out)?;
        self.machine_modes(block, out);
        self.finish(block, start, tables, setup, out)
    }

    /// Carries out a block of any kind. A change of the tables is returned in `edit`.
    #[inline(never)]
    #[small]
    pub fn execute_rare(
        &mut self,
        block: &Block,
        start: &PerAxis<Length>,
        tables: &impl Tables,
        setup: &impl Setup,
        out: &mut Commands,
        edit: &mut Option<Edit>,
    ) -> Result<(), Status> {
        self.begin(block, out)?;
        self.tools(block, out)?;
        self.machine_modes(block, out);
        Self::overrides(block, out)?;
        self.offsets(block, tables, setup)?;
        self.non_modal(block, tables, setup, out, edit)?;
        if Capability::Lathe.is_built_in() && self.moves_axis_of_rotation(block) {
            out.spindle = Some(self.spindle());
        }
        if block.does().is_some_and(MotionMode::is_cycle) {
            return self.finish_cycle(block, start, tables, edit, setup, out);
        }
        self.finish(block, start, tables, setup, out)?;
        self.stop(block, tables, edit, setup, out)
    }

    /// Carries out N, the modes, and F.
    fn begin(&mut self, block: &Block, out: &mut Commands) -> Result<(), Status> {
        let line = block.rare(N).map_or(Ok(0), |value| value.integer())?;
        if line > N_MAX {
            return Err(Status::OutOfRange);
        }
        self.line = line;
        out.line = line;
        self.modes(block);
        if block.path == Some(PathMode::Continuous) {
            self.modal.tolerance = tolerance(block, self.modal.units)?;
        }
        self.feed(block)
    }

    fn modes(&mut self, block: &Block) {
        let modal = &mut self.modal;
        if block.feed_mode.is_some_and(|mode| mode != modal.feed_mode) {
            // A rate of one feed mode has no meaning in another.
            self.feed = 0.0;
        }
        set(&mut modal.feed_mode, block.feed_mode);
        set(&mut modal.plane, block.plane);
        set(&mut modal.units, block.units);
        if block.distance.is_some() {
            self.printing.follow();
        }
        set(&mut modal.distance, block.distance);
        set(&mut modal.arc_distance, block.arc_distance);
        set(&mut modal.retract, block.retract);
        if Capability::Lathe.is_built_in() {
            set(&mut modal.x_mode, block.x_mode);
        }
        set(&mut modal.path, block.path);
    }

    /// Carries out F. With G93 F applies only to the move of its own line, which reads the word itself.
    fn feed(&mut self, block: &Block) -> Result<(), Status> {
        let Some(value) = block.rare(F) else { return Ok(()) };
        if value.negative {
            return Err(Status::OutOfRange);
        }
        if self.modal.feed_mode != FeedMode::InverseTime {
            self.feed = value.to_f32();
            self.feed_units = self.modal.units;
        }
        Ok(())
    }

    /// Carries out S, T and M6.
    #[small]
    fn tools(&mut self, block: &Block, out: &mut Commands) -> Result<(), Status> {
        if Capability::Lathe.is_built_in()
            && let Some(mode) = block.speed_mode
        {
            self.set_speed_mode(block, mode)?;
            if self.modal.spindle != Turn::Off {
                out.spindle = Some(self.spindle());
            }
        }
        if block.heats() {
            return Ok(());
        }
        if let Some(value) = block.get(S) {
            if value.negative {
                return Err(Status::SWordInvalid);
            }
            self.speed = value.to_f32();
            self.take_feet();
            if self.modal.spindle != Turn::Off {
                out.spindle = Some(self.spindle());
            }
        }
        if let Some(value) = block.get(T) {
            let number = value.integer().ok().and_then(|number| number.try_into().ok());
            self.selected = number.ok_or(Status::TWordInvalid)?;
        }
        if block.changes_tool() {
            self.tool = self.selected;
            out.changes_tool = true;
            // The tool change stops the spindle. S on the same line must not start it again.
            self.modal.spindle = Turn::Off;
            out.spindle = None;
        }
        Ok(())
    }

    /// Carries out the codes of spindle and coolant.
    fn machine_modes(&mut self, block: &Block, out: &mut Commands) {
        if let Some(turn) = block.spindle {
            self.modal.spindle = turn;
            out.spindle = Some(self.spindle());
        }
        if let Some(coolant) = block.coolant {
            self.modal.coolant = match coolant {
                Coolant::Off => 0,
                more => self.modal.coolant | more as u8,
            };
            out.coolant = Some(self.modal.coolant);
        }
    }

    /// Returns what the spindle does.
    pub fn spindle(&self) -> Spindle {
        Spindle { turn: self.modal.spindle, speed: self.speed }
    }

    /// Carries out M48 to M51.
    #[small]
    fn overrides(block: &Block, out: &mut Commands) -> Result<(), Status> {
        out.overrides = match block.overrides {
            None => return Ok(()),
            Some(OverrideCode::All(true)) => Some(Change::ALL_ON),
            Some(OverrideCode::All(false)) => Some(Change::ALL_OFF),
            Some(OverrideCode::One(which, how)) => Some(override_one(block, which, how)?),
        };
        Ok(())
    }

    /// Carries out the motion, and checks it against the limits.
    #[inline(never)]
    fn finish(
        &mut self,
        block: &Block,
        start: &PerAxis<Length>,
        tables: &impl Tables,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        match block.non_modal {
            Some(NonModal::GoStored(which)) => {
                self.go_stored(block, tables, TableRow::stored(which), setup, out)?
            }
            _ => self.motion(block, setup, out)?,
        }
        self.end_motion(start, setup, out)
    }

    /// Carries out a canned cycle and what comes after it. The words of the cycle stay in force, unless the line is
    /// refused.
    #[inline(never)]
    #[small]
    fn finish_cycle(
        &mut self,
        block: &Block,
        start: &PerAxis<Length>,
        tables: &impl Tables,
        edit: &Option<Edit>,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        let before = self.sticky;
        let done = self
            .cycle_motion(block, setup, out)
            .and_then(|()| self.end_motion(start, setup, out))
            .and_then(|()| self.stop(block, tables, edit, setup, out));
        done.inspect_err(|_| self.sticky = before)
    }

    #[inline(never)]
    fn end_motion(
        &self,
        start: &PerAxis<Length>,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        limits::check_reach(start, &self.position, &out.motion, setup)?;
        if Capability::Printer.is_built_in() {
            self.check_extrusion(start, &out.motion, setup)?;
        }
        if Capability::Drivers.is_built_in() && out.motion.moves() {
            setup.drives()?;
        }
        // Soft limits apply to homed axes only.
        if self.homed != 0 {
            limits::check(start, &out.motion, self.homed, setup)?;
        }
        out.exact_stop = self.modal.path == PathMode::ExactStop;
        // A line without a straight move is not merged with others.
        out.blend = self.modal.blend();
        Ok(())
    }

    #[inline(never)]
    #[small]
    fn stop(
        &mut self,
        block: &Block,
        tables: &impl Tables,
        edit: &Option<Edit>,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        out.stop = match block.stop {
            None => Stop::None,
            Some(StopCode::Optional) if !setup.stops_at_m1() => Stop::None,
            Some(StopCode::Program | StopCode::Optional) => Stop::Program,
            Some(StopCode::End) => {
                self.end_program(tables, edit, setup)?;
                Stop::End
            }
        };
        Ok(())
    }

    /// Carries out M2 and M30: the modes become those of power-up, except that G1 is in force; F is 0, and G92 is
    /// cleared. A change of the tables by the same line is taken into account.
    #[small]
    fn end_program(
        &mut self,
        tables: &impl Tables,
        edit: &Option<Edit>,
        setup: &impl Setup,
    ) -> Result<(), Status> {
        let defaults = setup.defaults();
        let system = match edit {
            Some(edit) if edit.row == TableRow::system(defaults.system) => edit.values,
            _ => self.system(defaults.system, tables),
        };
        self.modal = Modal { motion: MotionMode::Feed, ..Modal::new(&defaults) };
        self.printing.compare(self.modal.distance);
        self.feed = 0.0;
        (self.shift, self.shifted) = ([Length::ZERO; AXES], false);
        self.update_origin(&system)
    }
}

/// Returns the change of one override that a line asks for.
#[small]
fn override_one(block: &Block, which: Override, how: Switch) -> Result<Change, Status> {
    let word = block.get(P);
    let off = match how {
        Switch::Off => true,
        Switch::To => false,
        Switch::Maybe => word.is_some_and(|p| p.is_zero()),
    };
    let Some(word) = word.filter(|_| !off) else { return Ok(Change::switch(which, !off)) };
    let factor = word.milliseconds().map_err(|_| Status::PWordInvalid)?;
    let factor = which.checked(factor).ok_or(Status::PWordInvalid)?;
    Ok(Change::to(which, factor))
}

/// Returns the tolerance of G64 P in units of [`Length`], at most [`TOLERANCE_MAX`].
#[inline(never)]
#[small]
fn tolerance(block: &Block, units: Units) -> Result<u16, Status> {
    let Some(word) = block.get(P) else { return Ok(USUAL) };
    let exact = if units == Units::Inch { word.inch() } else { word.mm() };
    let far = exact.map_err(|_| Status::PWordInvalid)?.units.0;
    if far < 0 {
        return Err(Status::PWordNegative);
    }
    Ok(u16::try_from(far).map_or(TOLERANCE_MAX, |far| far.min(TOLERANCE_MAX)))
}

fn set<T>(mode: &mut T, new: Option<T>) {
    if let Some(new) = new {
        *mode = new;
    }
}
