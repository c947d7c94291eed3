//! Settings by owner and name, the motors of an axis, and steps per millimetre. Kerf keeps a step angle, microsteps and
//! the travel per turn instead.

use super::Machine;
use crate::boards::MOTORS;
use crate::config::name::token;
use crate::config::{Number, Owner, Setting};
use crate::kinematics;
use crate::status::Status;
use crate::units::AXES;

/// The product of `sa` and `tr` (both scaled as stored) with the steps per millimetre (in thousandths), for one
/// microstep: 360 degrees times 10^4, 10^6 and 10^3.
const STEPS: u64 = 360 * 10_000_000_000_000;

/// Returns the setting of an owner with this name; `None` if there is none.
#[inline(never)]
#[small]
pub fn named(owner: Owner, token: [u8; 4]) -> Option<Setting> {
    Setting::find(&owner.prefix().with_token(token)).filter(|found| found.owner() == owner)
}

/// Returns the axis that a motor moves. For a motor that drives X and Y together this is the axis that it stands for.
#[small]
pub fn axis_of(motor: u8, machine: &mut impl Machine) -> Option<u8> {
    let drives = machine.setting(named(Owner::Motor(motor), token("ma"))?);
    let axis = kinematics::stands_for(u8::try_from(drives).ok()?);
    (usize::from(axis) < AXES).then_some(axis)
}

/// Returns the first motor of an axis.
#[small]
pub fn motor_of(axis: u8, machine: &mut impl Machine) -> Option<u8> {
    (0..MOTORS as u8).find(|motor| axis_of(*motor, machine) == Some(axis))
}

/// Returns the steps per millimetre of an axis, in thousandths: those of its first motor. 0 if it has none.
#[inline(never)]
#[small]
pub fn steps(axis: u8, machine: &mut impl Machine) -> i32 {
    let Some(motor) = motor_of(axis, machine) else { return 0 };
    let turn = named(Owner::Motor(motor), token("tr")).map_or(0, |turn| machine.setting(turn));
    turned(machine, motor, turn)
}

/// Sets the steps per millimetre of an axis: `put` gets the travel per turn of each of its motors. If one of them is
/// out of range, no motor is changed.
#[inline(never)]
#[small]
pub fn set_steps<M: Machine>(
    axis: u8,
    to: Number,
    machine: &mut M,
    mut put: impl FnMut(&mut M, Setting, i32) -> Result<(), Status>,
) -> Result<(), Status> {
    let to = to.fixed(3, false).filter(|to| *to > 0).ok_or(Status::OutOfRange)?;
    for puts in [false, true] {
        for motor in 0..MOTORS as u8 {
            if axis_of(motor, machine) != Some(axis) {
                continue;
            }
            let setting = named(Owner::Motor(motor), token("tr"));
            let setting = setting.ok_or(Status::UnrecognizedName)?;
            let turn = turned(machine, motor, to);
            if !setting.accepts(turn) {
                return Err(Status::OutOfRange);
            }
            if puts {
                put(machine, setting, turn)?;
            }
        }
    }
    Ok(())
}

/// Returns the steps per millimetre of a motor, in thousandths, if `by` is the travel per turn, scaled as stored. Works
/// both ways: if `by` is the steps per millimetre, in thousandths, returns the travel per turn. Returns 0, which no
/// setting accepts, if the result is out of range.
#[small]
fn turned(machine: &mut impl Machine, motor: u8, by: i32) -> i32 {
    let mut read = |token| {
        let setting = named(Owner::Motor(motor), token);
        setting.map_or(0, |setting| machine.setting(setting)).unsigned_abs()
    };
    let (angle, microsteps) = (read(token("sa")), read(token("mi")));
    let divisor = (u64::from(angle) * u64::from(by.unsigned_abs())).max(1);
    let quotient = (STEPS * u64::from(microsteps) + divisor / 2) / divisor;
    i32::try_from(quotient).unwrap_or(0)
}
