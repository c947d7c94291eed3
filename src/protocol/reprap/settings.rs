//! M92, M201 to M206, M503: Kerf's settings under the codes of this dialect, in its units.
//!
//! Nothing is kept here. Of these codes a setting has its value until the next start, or until M501 brings back the
//! stored one; M500 stores it. The machine is asked to lend what is set ([`Machine::lend`]).

use super::command::number;
use super::host::Step;
use super::tuning;
use super::write::{fixed, line_end, text};
use crate::config::name::token;
use crate::config::{Fixed, Number, Owner};
use crate::gcode::tables::TableRow;
use crate::progmem::Text;
use crate::protocol::steps::{named, set_steps, steps};
use crate::protocol::{Machine, Out, Value};
use crate::status::Status;
use crate::text;
use crate::units::Length;

/// The letters of the axes: E is the A axis of the interpreter.
pub const LETTERS: [u8; 4] = *b"XYZE";
/// The codes that M503 lists, in order.
const LISTED: [u16; 5] = [92, 203, 201, 205, 206];

#[inline(never)]
#[small]
pub fn read(machine: &mut impl Machine, owner: Owner, token: [u8; 4]) -> i32 {
    named(owner, token).map_or(0, |setting| machine.setting(setting))
}

/// Returns those of `axes` that home at their upper ends, as bits.
#[small]
pub fn homed_at_upper_end(axes: u8, machine: &mut impl Machine) -> u8 {
    let mut upper = 0;
    for axis in (0..3).filter(|axis| axes & 1 << axis != 0) {
        upper |= (read(machine, Owner::Axis(axis), token("sx")) as u8 & 1) << axis;
    }
    upper
}

/// Returns the axis setting behind a code, and a factor. M203 is in mm/s, so its factor is 60.
fn setting(code: u16) -> Option<([u8; 4], i32)> {
    match code {
        201 => Some((token("ac"), 1)),
        203 => Some((token("vm"), 60)),
        205 => Some((token("jd"), 1)),
        _ => None,
    }
}

/// Returns the value of a code on an axis.
#[inline(never)]
#[small]
fn value(code: u16, axis: u8, machine: &mut impl Machine) -> Fixed {
    match (setting(code), code) {
        (Some((token, factor)), _) => {
            let found = named(Owner::Axis(axis), token);
            let decimals = found.map_or(0, |found| found.row().stored);
            let value = read(machine, Owner::Axis(axis), token) / factor;
            Fixed { value, decimals }.rounded(3)
        }
        (None, 92) => Fixed { value: steps(axis, machine), decimals: 3 },
        (None, 206) => {
            let at = machine.value(Value::TableRow(TableRow::system(0), axis));
            Fixed { value: at, decimals: 4 }.rounded(3)
        }
        _ => Fixed::int(0),
    }
}

/// Returns the letter of an axis in a code. M205 has only J: its X, Y, Z and E are jerk speeds, in mm/s, of another
/// kind of planner.
#[small]
fn letter(code: u16, axis: u8) -> u8 {
    match code {
        205 => b'J',
        _ => LETTERS.get(usize::from(axis)).copied().unwrap_or(b'E'),
    }
}

/// Returns the name of a code in M503.
fn name(code: u16) -> Text {
    match code {
        92 => text!("echo:  M92"),
        201 => text!("echo:  M201"),
        203 => text!("echo:  M203"),
        205 => text!("echo:  M205"),
        _ => text!("echo:  M206"),
    }
}

/// Writes the value of a code on an axis, part `at` of its line. Returns whether there is more.
#[small]
fn put(code: u16, at: u8, machine: &mut impl Machine, out: &mut impl Out) -> bool {
    if at == 0 {
        text(out, name(code));
    }
    out.put(b' ');
    out.put(letter(code, at));
    fixed(out, value(code, at, machine));
    // J applies to all axes. The extruder has no offset.
    let last = match code {
        205 => 0,
        206 => 2,
        _ => 3,
    };
    if at == last {
        line_end(out);
    }
    at < last
}

/// Writes part `at` of M503. Returns the next part; `None` after the last.
#[inline(never)]
#[small]
pub fn list(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Option<u8> {
    let (row, axis) = (at >> 2, at & 3);
    let Some(code) = LISTED.get(usize::from(row)).copied() else {
        let bed = usize::from(row) > LISTED.len();
        let more = tuning::list(bed, axis, machine, out);
        let next = if more { at + 1 } else { (row + 1) << 2 };
        return (more || !bed).then_some(next);
    };
    if put(code, axis, machine, out) {
        return Some(at + 1);
    }
    let heats = machine.heater(0).is_some();
    (heats || usize::from(row) + 1 < LISTED.len()).then_some((row + 1) << 2)
}

/// Sets the values that a code names, axis by axis, after all of them have been checked; reports them if it names none.
#[inline(never)]
#[small]
pub fn set(
    code: u16,
    at: u8,
    block: &[u8],
    machine: &mut impl Machine,
    out: &mut impl Out,
) -> Step {
    const SETS: u8 = LETTERS.len() as u8;
    const TELLS: u8 = 2 * SETS + 1;
    if matches!(code, 202 | 204) {
        // An axis has a single acceleration, set by M201.
        return Step::Done;
    }
    if at >= TELLS {
        let more = put(code, at - TELLS, machine, out);
        return if more { Step::At(at + 1) } else { Step::Done };
    }
    let word = |axis| number(block, letter(code, axis));
    if at == 0 && !(0..SETS).any(|axis| word(axis).is_some()) {
        return Step::At(TELLS);
    }
    if at >= 2 * SETS {
        return Step::Done;
    }
    let axis = at % SETS;
    let Some(to) = word(axis) else { return Step::Later(at + 1) };
    machine.lend(true);
    let done = set_axis(code, axis, to, at >= SETS, machine);
    machine.lend(false);
    match done {
        Ok(()) => Step::Later(at + 1),
        // Settings of motors can only change at rest. Those to be saved are to be saved before.
        Err(Status::Again) => Step::Later(at),
        Err(status) => Step::Refused(status),
    }
}

/// Checks the value of a code on an axis, and sets it if `puts`.
#[inline(never)]
#[small]
fn set_axis(
    code: u16,
    axis: u8,
    to: Number,
    puts: bool,
    machine: &mut impl Machine,
) -> Result<(), Status> {
    let waits = machine.value(Value::Working) != 0 || machine.value(Value::Kept) == 0;
    if waits {
        return Err(Status::Again);
    }
    match code {
        92 => set_steps(axis, to, machine, |machine, turn, to| {
            if puts && machine.setting(turn) != to {
                machine.set(turn, to)?;
            }
            Ok(())
        }),
        203 => {
            // M203 is in mm/s.
            let by_second = to.fixed(3, false).filter(|to| (0..=i32::MAX / 60).contains(to));
            let by_second = by_second.ok_or(Status::OutOfRange)?;
            let to = Number::int(by_second.unsigned_abs() * 60).thousandth();
            put_number(machine, Owner::Axis(axis), token("vm"), to, puts)?;
            put_number(machine, Owner::Axis(axis), token("fr"), to, puts)
        }
        // 0, no limit, is not for files: slicers write it for want of a number.
        201 if to.fixed(1, false).is_none_or(|to| to <= 0) => Err(Status::OutOfRange),
        201 => put_number(machine, Owner::Axis(axis), token("ac"), to, puts),
        205 => put_number(machine, Owner::Axis(axis), token("jd"), to, puts),
        _ => {
            let to = to.fixed(4, false).ok_or(Status::OutOfRange)?;
            if puts { machine.set_row(TableRow::system(0), axis, Length(to)) } else { Ok(()) }
        }
    }
}

/// Checks the value of a setting, and sets it if `puts`.
#[inline(never)]
#[small]
pub fn put_number(
    machine: &mut impl Machine,
    owner: Owner,
    token: [u8; 4],
    to: Number,
    puts: bool,
) -> Result<(), Status> {
    let setting = named(owner, token).ok_or(Status::UnrecognizedName)?;
    let value = machine.settings().check(setting, to, false)?;
    if puts {
        machine.set(setting, value)?;
    }
    Ok(())
}
