//! Parameters that read the state of the machine, by number and by name. No program assigns them.
//!
//! Lengths of tables (offsets, stored positions, tools) are in mm whatever G20 says, and positions in the units in force.
//! All are those of the lines read so far, not those of the motors. Axes that a machine does not have are 0.

use super::super::modal::{ArcDistance, Coolant, Distance, FeedMode, MotionMode, Plane, Retract};
use super::super::modal::{SpeedMode, Turn, Units, XMode};
use super::super::state::State;
use super::super::tables::{TableRow, Tables};
use super::text::Name;
use crate::units::{AXES, FIRST_ROTARY, Length};

/// The first parameter of the place of the last probing.
pub const PROBED: u16 = 5_061;
/// The parameter that says whether it had a contact.
pub const CONTACT: u16 = 5_070;
/// The parameter that switches `(DEBUG,)`.
pub const DEBUG: u16 = 5_599;

/// The first numbers of groups of nine axes.
const MACHINE: u16 = 5_021;
const OFFSET: u16 = 5_081;
const STORED: [u16; 2] = [5_161, 5_181];
const SHIFTED: u16 = 5_210;
const SHIFT: u16 = 5_211;
const SYSTEM: u16 = 5_220;
const SYSTEMS: u16 = 5_221;
const SYSTEMS_END: u16 = 5_390;
/// From one system to the next.
const PER_SYSTEM: u16 = 20;
const TOOL: u16 = 5_400;
const TOOL_OFFSET: u16 = 5_401;
const TOOL_END: u16 = 5_413;
const WORK: u16 = 5_420;
/// X Y Z A B C U V W.
const GROUP: u16 = 9;

/// Millimetres in a unit of a [`Length`].
const PER_MM: f64 = Length::PER_MM as f64;
const MM_PER_INCH: f64 = 25.4;

/// The machine as the last line has left it.
pub struct Live<'a, T> {
    /// The state of the interpreter.
    pub state: &'a State,
    /// The tables.
    pub tables: &'a T,
}

/// Whether a numbered parameter cannot be assigned.
pub fn is_read_only(number: u16) -> bool {
    let groups = [MACHINE, OFFSET, STORED[0], STORED[1], WORK];
    groups.iter().any(|first| (*first..first + GROUP).contains(&number))
        || (SHIFTED..=SYSTEMS_END).contains(&number)
        || (TOOL..=TOOL_END).contains(&number)
}

impl<T: Tables> Live<'_, T> {
    /// Returns the value of a number that [cannot be assigned](is_read_only).
    pub fn numbered(&self, number: u16) -> f64 {
        let state = self.state;
        let axis = |first: u16| (first..first + GROUP).contains(&number).then(|| number - first);
        if let Some(axis) = axis(MACHINE) {
            return self.place(axis);
        }
        if let Some(axis) = axis(WORK) {
            return self.work(axis);
        }
        if let Some(axis) = axis(OFFSET) {
            return mm(&state.tool_length, axis);
        }
        if let Some(axis) = axis(SHIFT) {
            return mm(&state.shift, axis);
        }
        for (which, first) in STORED.iter().enumerate() {
            if let Some(axis) = axis(*first) {
                return mm(&self.tables.row(TableRow::stored(which as u8)), axis);
            }
        }
        match number {
            SHIFTED => truth(state.shifted),
            SYSTEM => f64::from(state.modal.system) + 1.0,
            SYSTEMS..=SYSTEMS_END => self.system(number - SYSTEMS),
            TOOL => f64::from(state.tool),
            TOOL_OFFSET..=TOOL_END => self.tool(number - TOOL_OFFSET),
            _ => 0.0,
        }
    }

    fn system(&self, number: u16) -> f64 {
        let row = TableRow::system((number / PER_SYSTEM) as u8);
        mm(&self.tables.row(row), number % PER_SYSTEM)
    }

    fn tool(&self, axis: u16) -> f64 {
        let row = u8::try_from(self.state.tool).ok().and_then(TableRow::tool);
        row.map_or(0.0, |row| mm(&self.tables.row(row), axis))
    }

    /// Returns the position of an axis in machine coordinates, in the units in force.
    fn place(&self, axis: u16) -> f64 {
        self.in_units(axis, units_of(&self.state.position, axis))
    }

    /// Returns the position of an axis in the coordinate system in force.
    pub fn work(&self, axis: u16) -> f64 {
        let origin = units_of(&self.state.origin, axis);
        self.in_units(axis, units_of(&self.state.position, axis) - origin)
    }

    /// Converts units of a [`Length`] to the units in force; X to a diameter with G7.
    fn in_units(&self, axis: u16, units: f64) -> f64 {
        let modal = &self.state.modal;
        let is_rotary = usize::from(axis) >= FIRST_ROTARY;
        let diameter = axis == 0 && modal.x_mode == XMode::Diameter;
        let value = if diameter { 2.0 * units / PER_MM } else { units / PER_MM };
        if modal.units == Units::Inch && !is_rotary { value / MM_PER_INCH } else { value }
    }

    /// Returns the value of a name; `None` if it is no name of this kind.
    pub fn named(&self, name: Name) -> Option<f64> {
        let modal = &self.state.modal;
        let row = NAMES.iter().find(|(known, _)| name.is(Name(known)))?;
        Some(match row.1 {
            Value::Is(is) => truth(is(self.state)),
            Value::Number(number) => number(self.state),
            Value::Work(axis) => self.work(axis),
            Value::Machine(axis) => self.place(axis),
            Value::Feed => {
                let factor = match (self.state.feed_units, modal.units) {
                    (Units::Inch, Units::Mm) => MM_PER_INCH,
                    (Units::Mm, Units::Inch) => 1.0 / MM_PER_INCH,
                    _ => 1.0,
                };
                f64::from(self.state.feed) * factor
            }
        })
    }
}

/// How a name is looked up.
#[derive(Clone, Copy)]
enum Value {
    /// 1 or 0.
    Is(fn(&State) -> bool),
    Number(fn(&State) -> f64),
    /// The position of an axis in the coordinate system in force.
    Work(u16),
    /// The position of an axis in machine coordinates.
    Machine(u16),
    Feed,
}

const NAMES: &[(&[u8], Value)] = &[
    (b"_motion_mode", Value::Number(|state| motion(state.modal.motion))),
    (b"_plane", Value::Number(plane)),
    (b"_ccomp", Value::Number(|_| 400.0)),
    (b"_metric", Value::Is(|state| state.modal.units == Units::Mm)),
    (b"_imperial", Value::Is(|state| state.modal.units == Units::Inch)),
    (b"_absolute", Value::Is(|state| state.modal.distance == Distance::Absolute)),
    (b"_incremental", Value::Is(|state| state.modal.distance == Distance::Incremental)),
    (b"_inverse_time", Value::Is(|state| state.modal.feed_mode == FeedMode::InverseTime)),
    (b"_units_per_minute", Value::Is(|state| state.modal.feed_mode == FeedMode::PerMinute)),
    (b"_units_per_rev", Value::Is(|state| state.modal.feed_mode == FeedMode::PerTurn)),
    (b"_coord_system", Value::Number(system)),
    (b"_tool_offset", Value::Is(|state| state.tool_length.iter().any(|of| *of != Length::ZERO))),
    (b"_retract_r_plane", Value::Is(|state| state.modal.retract == Retract::ToR)),
    (b"_retract_old_z", Value::Is(|state| state.modal.retract == Retract::Initial)),
    (b"_spindle_rpm_mode", Value::Is(|state| state.modal.speed_mode == SpeedMode::Turns)),
    (b"_spindle_css_mode", Value::Is(|state| state.modal.speed_mode == SpeedMode::Surface)),
    (b"_ijk_absolute_mode", Value::Is(|state| state.modal.arc_distance == ArcDistance::Absolute)),
    (b"_lathe_diameter_mode", Value::Is(|state| state.modal.x_mode == XMode::Diameter)),
    (b"_lathe_radius_mode", Value::Is(|state| state.modal.x_mode == XMode::Radius)),
    (b"_spindle_on", Value::Is(|state| state.modal.spindle != Turn::Off)),
    (b"_spindle_cw", Value::Is(|state| state.modal.spindle == Turn::Clockwise)),
    (b"_mist", Value::Is(|state| state.modal.coolant & Coolant::Mist as u8 != 0)),
    (b"_flood", Value::Is(|state| state.modal.coolant & Coolant::Flood as u8 != 0)),
    (b"_feed", Value::Feed),
    (b"_rpm", Value::Number(|state| f64::from(state.speed))),
    (b"_x", Value::Work(0)),
    (b"_y", Value::Work(1)),
    (b"_z", Value::Work(2)),
    (b"_a", Value::Work(3)),
    (b"_b", Value::Work(4)),
    (b"_c", Value::Work(5)),
    (b"_u", Value::Work(6)),
    (b"_v", Value::Work(7)),
    (b"_w", Value::Work(8)),
    (b"_abs_x", Value::Machine(0)),
    (b"_abs_y", Value::Machine(1)),
    (b"_abs_z", Value::Machine(2)),
    (b"_abs_a", Value::Machine(3)),
    (b"_abs_b", Value::Machine(4)),
    (b"_abs_c", Value::Machine(5)),
    (b"_abs_u", Value::Machine(6)),
    (b"_abs_v", Value::Machine(7)),
    (b"_abs_w", Value::Machine(8)),
    (b"_current_tool", Value::Number(|state| f64::from(state.tool))),
    (b"_current_pocket", Value::Number(|state| f64::from(state.tool))),
    (b"_selected_tool", Value::Number(|state| f64::from(state.selected))),
    (b"_selected_pocket", Value::Number(|state| f64::from(state.selected))),
    (b"_task", Value::Number(|_| 1.0)),
    (b"_metric_machine", Value::Number(|_| 1.0)),
    (b"_remap_level", Value::Number(|_| 0.0)),
];

fn truth(is: bool) -> f64 {
    f64::from(u8::from(is))
}

fn mm(row: &[Length; AXES], axis: u16) -> f64 {
    units_of(row, axis) / PER_MM
}

/// Returns the length of an axis in units; 0 for an axis that there is not.
fn units_of(row: &[Length; AXES], axis: u16) -> f64 {
    row.get(usize::from(axis)).map_or(0.0, |length| f64::from(length.0))
}

fn plane(state: &State) -> f64 {
    match state.modal.plane {
        Plane::Xy => 170.0,
        Plane::Zx => 180.0,
        Plane::Yz => 190.0,
    }
}

/// Returns 540 for G54, to 593 for G59.3.
fn system(state: &State) -> f64 {
    match state.modal.system {
        system @ 0..=5 => 540.0 + 10.0 * f64::from(system),
        system => 585.0 + f64::from(system),
    }
}

/// Returns the code of a motion mode, times 10.
fn motion(mode: MotionMode) -> f64 {
    let code = match mode {
        MotionMode::Traverse => 0,
        MotionMode::Feed => 10,
        MotionMode::ClockwiseArc => 20,
        MotionMode::CounterclockwiseArc => 30,
        MotionMode::None => 800,
        MotionMode::ProbeTowards => 382,
        MotionMode::ProbeTowardsQuietly => 383,
        MotionMode::ProbeAway => 384,
        MotionMode::ProbeAwayQuietly => 385,
        MotionMode::Drill => 810,
        MotionMode::DrillDwell => 820,
        MotionMode::PeckDrill => 830,
        MotionMode::Tap => 840,
        MotionMode::Bore => 850,
        MotionMode::BoreStop => 860,
        MotionMode::BackBore => 870,
        MotionMode::BoreByHand => 880,
        MotionMode::BoreDwell => 890,
        MotionMode::ChipBreak => 730,
        MotionMode::Thread => 330,
        MotionMode::RigidTap => 331,
        MotionMode::ThreadCycle => 760,
    };
    f64::from(code)
}
