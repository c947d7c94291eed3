//! The work origin: coordinate systems (G54 to G59.3, G10), G92 and its variants, tool lengths.
//!
//! Machine coordinates of the origin = coordinate system + G92, if that is in force + tool length. [`State::origin`]
//! holds the sum, so that a move adds only one number. The coordinate system in force is this sum minus the other two
//! parts, so the tables are read only for other systems.

use kerf_macros::small;

use super::axes;
use super::block::Block;
use super::codes::{NonModal, ToolLength};
use super::command::{Commands, Motion};
use super::modal::MotionMode;
use super::setup::{AxisMode, Setup};
use super::state::State;
use super::tables::{Edit, NUMBERED, SYSTEMS, TOOL_AXES, TOOLS, TableRow, Tables};
use super::words::{AXES, H, L, P};
use crate::status::Status;
use crate::units::{self, FIRST_ROTARY, Length, PerAxis};

#[small]
impl State {
    /// Returns the coordinate system in force.
    fn system_in_force(&self) -> PerAxis<Length> {
        let mut system = self.origin;
        for (system, (shift, tool)) in
            system.iter_mut().zip(self.shift.iter().zip(&self.tool_length))
        {
            let shift = if self.shifted { shift.0 } else { 0 };
            // The sum was within the range, so subtracting its parts gives the coordinate system again.
            system.0 = system.0.wrapping_sub(tool.0).wrapping_sub(shift);
        }
        system
    }

    /// Returns a coordinate system. `number` counts from 0.
    pub(super) fn system(&self, number: u8, tables: &impl Tables) -> PerAxis<Length> {
        match number == self.modal.system {
            true => self.system_in_force(),
            false => tables.row(TableRow::system(number)),
        }
    }

    /// Computes the origin from a coordinate system and the offsets in the state.
    pub(super) fn update_origin(&mut self, system: &PerAxis<Length>) -> Result<(), Status> {
        let parts = system.iter().zip(&self.shift).zip(&self.tool_length);
        for (origin, ((system, shift), tool)) in self.origin.iter_mut().zip(parts) {
            let shift = if self.shifted { *shift } else { Length::ZERO };
            let sum = system.checked_add(shift).and_then(|sum| sum.checked_add(*tool));
            *origin = sum.ok_or(Status::OutOfRange)?;
        }
        Ok(())
    }

    /// Carries out the codes of tool length and coordinate system.
    #[inline(never)]
    #[small]
    pub(super) fn offsets(
        &mut self,
        block: &Block,
        tables: &impl Tables,
        setup: &impl Setup,
    ) -> Result<(), Status> {
        if block.tool_length.is_none() && block.system.is_none() {
            return Ok(());
        }
        let number = block.system.unwrap_or(self.modal.system);
        let system = self.system(number, tables);
        match block.tool_length {
            None => {}
            Some(ToolLength::Off) => self.tool_length = [Length::ZERO; units::AXES],
            Some(ToolLength::Words) => {
                self.each_word(block, setup, &mut |state, axis, value| {
                    put(&mut state.tool_length, axis, value.units);
                    Ok(())
                })?;
            }
            Some(ToolLength::Table) => self.tool_length = self.tool_named(block, tables)?,
            Some(ToolLength::Add) => {
                let more = self.tool_named(block, tables)?;
                for (length, more) in self.tool_length.iter_mut().zip(&more) {
                    *length = length.checked_add(*more).ok_or(Status::OutOfRange)?;
                }
            }
        }
        self.modal.system = number;
        self.update_origin(&system)
    }

    /// Sets the tool length on one axis, as G43.1 does.
    pub(super) fn set_tool_length(&mut self, axis: u8, new: Length) -> Result<(), Status> {
        let axis = usize::from(axis);
        let parts = self.origin.get_mut(axis).zip(self.tool_length.get_mut(axis));
        let (origin, length) = parts.ok_or(Status::AxisInvalid)?;
        let others = Length(origin.0.wrapping_sub(length.0));
        *origin = others.checked_add(new).ok_or(Status::OutOfRange)?;
        *length = new;
        Ok(())
    }

    /// Returns the lengths of the tool that a line names. They are 0 for an empty spindle, and for a tool that the
    /// tables do not have. The latter is no error, because a program should not be refused in its middle:
    /// [`State::lacks_length`] tells of it.
    #[small]
    fn tool_named(&self, block: &Block, tables: &impl Tables) -> Result<PerAxis<Length>, Status> {
        let number = self.tool_number(block)?;
        let Some(row) = TableRow::tool(number) else { return Ok([Length::ZERO; units::AXES]) };
        Ok(tables.row(row))
    }

    /// Returns H, or without H the tool in the spindle: at most [`NUMBERED`].
    #[inline(never)]
    #[small]
    fn tool_number(&self, block: &Block) -> Result<u8, Status> {
        let number = block.get(H).map_or(Ok(self.tool.into()), |word| word.integer());
        let number = number.ok().and_then(|number| u8::try_from(number).ok());
        number.filter(|number| *number <= NUMBERED).ok_or(Status::HWordInvalid)
    }

    /// Whether a line that has been carried out has asked for the length of a tool that has none.
    #[inline(never)]
    #[small]
    pub(super) fn lacks_length(&self, block: &Block) -> bool {
        matches!(block.tool_length, Some(ToolLength::Table | ToolLength::Add))
            && self.tool_number(block).is_ok_and(|number| number > TOOLS)
    }

    /// Carries out the codes of group 0, except the moves to stored positions.
    #[inline(never)]
    #[small]
    pub(super) fn non_modal(
        &mut self,
        block: &Block,
        tables: &impl Tables,
        setup: &impl Setup,
        out: &mut Commands,
        edit: &mut Option<Edit>,
    ) -> Result<(), Status> {
        match block.non_modal {
            None | Some(NonModal::GoStored(_) | NonModal::MachineCoordinates) => {}
            Some(NonModal::Dwell) => out.dwell_ms = Some(dwell_ms(block)?),
            Some(NonModal::SetData) => self.set_data(block, tables, setup, edit)?,
            Some(NonModal::Store(which)) => {
                if block.has(AXES) {
                    return Err(Status::AxisInvalid);
                }
                *edit = Some(Edit::new(TableRow::stored(which), self.position, tables)?);
            }
            Some(NonModal::Home { set }) => self.home(block, set, setup, out)?,
            Some(NonModal::SetPosition) => self.redefine_position(block, setup, out)?,
            Some(NonModal::SetOffset) => self.shift_here(block, setup)?,
            Some(NonModal::ClearOffset) => {
                self.shift_is(false)?;
                self.shift = [Length::ZERO; units::AXES];
            }
            Some(NonModal::Heat(code)) => Self::heat(block, code, setup, out)?,
            Some(NonModal::SuspendOffset) => self.shift_is(false)?,
            Some(NonModal::ResumeOffset) => self.shift_is(true)?,
        }
        Ok(())
    }

    fn shift_is(&mut self, on: bool) -> Result<(), Status> {
        let system = self.system_in_force();
        self.shifted = on;
        self.update_origin(&system)
    }

    /// Carries out G92: the axis words become the work coordinates of the present position.
    fn shift_here(&mut self, block: &Block, setup: &impl Setup) -> Result<(), Status> {
        let system = self.system_in_force();
        if !self.shifted {
            self.shift = [Length::ZERO; units::AXES];
        }
        self.shifted = true;
        self.each_word(block, setup, &mut |state, axis, value| {
            let others = at(&system, axis).checked_add(at(&state.tool_length, axis));
            let shift = state.offset_here(axis, others, value.units)?;
            put(&mut state.shift, axis, shift);
            put(&mut state.residue, axis, value.rest);
            Ok(())
        })?;
        self.update_origin(&system)
    }

    /// Carries out G28.3: the axis words become the machine coordinates of the present position.
    fn redefine_position(
        &mut self,
        block: &Block,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        self.each_word(block, setup, &mut |state, axis, value| {
            put(&mut state.position, axis, value.units);
            put(&mut state.residue, axis, value.rest);
            state.homed |= 1 << axis;
            Ok(())
        })?;
        out.motion = Motion::SetPosition { position: self.position };
        Ok(())
    }

    /// Carries out G28.2 and G28.4. No motion mode is in force afterwards.
    fn home(
        &mut self,
        block: &Block,
        set: bool,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        let mut axes = 0;
        for (axis, _) in block.axes() {
            // B and C have no switches.
            if usize::from(axis) > FIRST_ROTARY || setup.mode(axis) == AxisMode::Disabled {
                return Err(Status::HomingAxis);
            }
            self.blamed = axis;
            setup.homing(axis)?;
            axes |= 1 << axis;
        }
        self.modal.motion = MotionMode::None;
        out.motion = Motion::Home { axes, set };
        Ok(())
    }

    /// Carries out G10.
    fn set_data(
        &mut self,
        block: &Block,
        tables: &impl Tables,
        setup: &impl Setup,
        edit: &mut Option<Edit>,
    ) -> Result<(), Status> {
        let integer = |slot| block.get(slot).and_then(|word| word.integer().ok());
        let number = integer(P).and_then(|number| u8::try_from(number).ok());
        match (integer(L), number) {
            (Some(l @ (2 | 20)), Some(number)) if number <= SYSTEMS => {
                // P0 is the system in force.
                let system = number.checked_sub(1).unwrap_or(self.modal.system);
                self.set_system(block, system, l == 20, tables, setup, edit)
            }
            (Some(2 | 20), _) => Err(Status::PWordInvalid),
            (Some(l @ (1 | 10)), number) => {
                let row = number.and_then(TableRow::tool).ok_or(Status::ToolInvalid)?;
                self.set_tool(block, row, l == 10, tables, setup, edit)
            }
            _ => Err(Status::LWordInvalid),
        }
    }

    /// Carries out G10 L2: the axis words become the origin of a coordinate system. With L20 (`here`) the origin is
    /// moved so that the axis words become the coordinates of the present position in the system.
    fn set_system(
        &mut self,
        block: &Block,
        number: u8,
        here: bool,
        tables: &impl Tables,
        setup: &impl Setup,
        edit: &mut Option<Edit>,
    ) -> Result<(), Status> {
        let mut system = self.system(number, tables);
        self.each_word(block, setup, &mut |state, axis, value| {
            let origin = if here {
                let shift = if state.shifted { at(&state.shift, axis) } else { Length::ZERO };
                let others = shift.checked_add(at(&state.tool_length, axis));
                state.offset_here(axis, others, value.units)?
            } else {
                value.units
            };
            put(&mut system, axis, origin);
            Ok(())
        })?;
        if number == self.modal.system {
            self.update_origin(&system)?;
        }
        *edit = Some(Edit::new(TableRow::system(number), system, tables)?);
        Ok(())
    }

    /// Carries out G10 L1: the axis words become the lengths of a tool. With L10 (`here`) the lengths are chosen so
    /// that the axis words become the coordinates of the present position once the lengths are in force.
    fn set_tool(
        &mut self,
        block: &Block,
        row: TableRow,
        here: bool,
        tables: &impl Tables,
        setup: &impl Setup,
        edit: &mut Option<Edit>,
    ) -> Result<(), Status> {
        let mut lengths = tables.row(row);
        self.each_word(block, setup, &mut |state, axis, value| {
            if !TOOL_AXES.contains(&axis) {
                return Err(Status::AxisInvalid);
            }
            let length = if here {
                let others = at(&state.origin, axis).checked_sub(at(&state.tool_length, axis));
                state.offset_here(axis, others, value.units)?
            } else {
                value.units
            };
            put(&mut lengths, axis, length);
            Ok(())
        })?;
        *edit = Some(Edit::new(row, lengths, tables)?);
        Ok(())
    }

    /// Returns the offset along an axis that, added to the other offsets `others`, makes `value` the coordinate of the
    /// present position. `others` is `None` if their sum is beyond the range.
    #[inline(never)]
    fn offset_here(
        &self,
        axis: u8,
        others: Option<Length>,
        value: Length,
    ) -> Result<Length, Status> {
        let left = others.and_then(|others| at(&self.position, axis).checked_sub(others));
        left.and_then(|left| left.checked_sub(value)).ok_or(Status::OutOfRange)
    }

    /// Calls `each` for each axis word, except for the words of disabled axes.
    #[inline(never)]
    fn each_word(
        &mut self,
        block: &Block,
        setup: &impl Setup,
        each: &mut dyn FnMut(&mut Self, u8, axes::Value) -> Result<(), Status>,
    ) -> Result<(), Status> {
        for (axis, word) in block.axes() {
            if let Some(value) = axes::value(word, axis, self.modal.units, setup)? {
                each(self, axis, value)?;
            }
        }
        Ok(())
    }

    /// Carries out G28 and G30: a traverse to the stored position. With axis words only the named axes move, first to
    /// where the words say. Without words all axes move. If no position was ever stored, the target is machine zero,
    /// which is known on homed axes. On others without a homing switch it is where they were at the start, as in grbl.
    /// The line is refused if a linear axis would move there that has such a switch, or if Z would: it could move down.
    #[inline(never)]
    pub(super) fn go_stored(
        &mut self,
        block: &Block,
        tables: &impl Tables,
        stored: TableRow,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        if let Some(mode) = block.own_motion() {
            self.modal.motion = mode;
        }
        self.advance(block, false, setup)?;
        let via = self.position;
        let known = if tables.is_stored(stored) { u8::MAX } else { self.homed | ROTARY };
        // Without a switch, machine zero is where the axis was at the start.
        let may_go = known | (!setup.axes_that_home() & !Z_BIT);
        let stored = tables.row(stored);
        for axis in 0..units::AXES as u8 {
            let named = !block.has(AXES) || block.get(axis).is_some();
            if named && setup.mode(axis) != AxisMode::Disabled {
                let place = at(&stored, axis);
                if may_go & 1 << axis == 0 && at(&self.position, axis) != place {
                    return Err(Status::NotHomed);
                }
                put(&mut self.position, axis, place);
                put(&mut self.residue, axis, 0);
            }
        }
        let target = self.position;
        out.motion = match block.has(AXES) {
            true => Motion::Through { via, target },
            false => Motion::Traverse { target },
        };
        Ok(())
    }
}

/// Returns the dwell of G4 in milliseconds, from P in seconds.
#[small]
pub(super) fn dwell_ms(block: &Block) -> Result<u32, Status> {
    block.get(P).ok_or(Status::PWordMissing)?.milliseconds()
}

/// The bit of Z, and those of the rotary axes.
const Z_BIT: u8 = 1 << 2;
const ROTARY: u8 = u8::MAX << FIRST_ROTARY;

#[small]
fn at(values: &PerAxis<Length>, axis: u8) -> Length {
    values.get(usize::from(axis)).copied().unwrap_or_default()
}

#[small]
fn put<T>(values: &mut PerAxis<T>, axis: u8, value: T) {
    if let Some(place) = values.get_mut(usize::from(axis)) {
        *place = value;
    }
}
