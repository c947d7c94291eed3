//! The origin of the move that runs: the work offset, the coordinate system and the tool, as reports show them.
//!
//! The interpreter is up to a whole queue ahead of the machine. So an origin that a line has changed is queued in front
//! of the next line that does something ([`QueuedAction::Origin`](crate::motion::block::QueuedAction)), and exec takes
//! it over when that line begins. The machine does not stop for it. While anything is queued or runs, reports show exec's
//! origin, else that of the interpreter.
//!
//! Thread mode. Cost: 600 cycles.

use kerf_macros::small;

use crate::boards::MOTORS;
use crate::config::Settings;
use crate::gcode::interpreter::Interpreter;
use crate::gcode::printing::EXTRUDER;
use crate::kinematics::stands_for;
use crate::motion::snapshot::Origin;
use crate::tasks::setup::moved_by;
use crate::units::Length;

/// Returns the origin that the lines read so far have left.
#[inline(never)]
#[small]
pub fn read<T, L>(settings: &Settings, model: &Interpreter<T, L>) -> Origin {
    let mut offset = [Length::ZERO; MOTORS];
    for (motor, offset) in offset.iter_mut().enumerate() {
        let axis = axis_of(settings, motor);
        let of = model.work_offset().get(axis).copied().unwrap_or_default();
        *offset = Length(of.0.wrapping_sub(flowed(axis, model)));
    }
    Origin { offset, system: model.coordinate_system(), tool: model.tool() }
}

/// Returns the axis that a motor moves. With CoreXY the first motor counts for X and the second for Y.
#[inline(never)]
#[small]
fn axis_of(settings: &Settings, motor: usize) -> usize {
    stands_for(moved_by(settings, motor)).into()
}

/// Returns the offset of an axis. That of an axis without a motor, whose position is that of the lines read so far, is
/// the interpreter's.
#[inline(never)]
#[small]
pub fn offset<T, L>(
    axis: usize,
    origin: &Origin,
    settings: &Settings,
    model: &Interpreter<T, L>,
) -> Length {
    let motor = (0..MOTORS).find(|motor| axis_of(settings, *motor) == axis);
    match motor.and_then(|motor| origin.offset.get(motor)) {
        Some(offset) => Length(offset.0.wrapping_add(flowed(axis, model))),
        None => model.work_offset().get(axis).copied().unwrap_or_default(),
    }
}

/// Returns how far the flow of lines read so far has moved the origin of an axis. It moves with each line, so no queued
/// origin contains it.
#[small]
fn flowed<T, L>(axis: usize, model: &Interpreter<T, L>) -> i32 {
    if axis == EXTRUDER { model.flowed() } else { 0 }
}
