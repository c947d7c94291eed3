//! `$$` and `$x=v`: Kerf's settings under grbl's numbers and in its units.
//!
//! Nothing is kept here. A number that stands for several settings reads the first of them and sets all. A number
//! without a setting in Kerf is shown with a fixed value, and accepts only that value.

use super::report::LOWERED;
use crate::boards::MOTORS;
use crate::capability::Capability;
use crate::config::name::token;
use crate::config::{Fixed, Number, Owner, Setting};
use crate::progmem;
use crate::protocol::steps::{motor_of, named, set_steps, steps};
use crate::protocol::{Machine, Warning, by_name};
use crate::status::Status;
use crate::units::AXES;

progmem! {
    /// The numbers below 100 that exist.
    static NUMBERS: [u8; BASE as usize] = {
        let all = [0, 1, 2, 3, 4, 5, 6, 10, 11, 12, 13, 20, 21, 22, 23, 24, 25, 26, 27, 30, 31, 32, 40, 41];
        let (mut some, mut row) = ([0; BASE as usize], 0);
        while row < some.len() {
            some[row] = all[row];
            row += 1;
        }
        some
    };
}
/// The number of these settings in this image. The last two are those of a lathe.
const BASE: u8 = if Capability::Lathe.is_built_in() { 24 } else { 22 };

/// The number of axes that can home.
const HOMING: u8 = 4;
/// The fixed value of `$26`, in ms.
const DEBOUNCE_MS: i32 = 10;
/// Bits of `grm`. `REPORT`: the lowest two bits of `$10`. `INCHES`: `$13`. `SYNC`: the next two bits of `$10`.
const REPORT: i32 = 3;
const INCHES: i32 = 4;
const SYNC: i32 = 48;
/// The shift from `SYNC` to its bits in `$10`.
const SYNC_SHIFT: u8 = 2;
/// The unit of `$41`, in microseconds.
const DEBOUNCE_US: i32 = 4;
/// The value of `$1` that keeps the motors on.
const ALWAYS: i32 = 255;

/// Returns the setting number in row `row` of the list, on a machine with `axes` axes; `None` past the end.
#[small]
pub fn number(row: u8, axes: u8) -> Option<u8> {
    match row.checked_sub(BASE) {
        None => NUMBERS.at(row.into()),
        Some(row) if row < 4 * axes => Some(100 + 10 * (row / axes) + row % axes),
        Some(row) if Capability::Backlash.is_built_in() && row - 4 * axes < axes.min(HOMING) => {
            Some(160 + row - 4 * axes)
        }
        Some(_) => None,
    }
}

/// Returns how many axes are shown: up to the last one that is not disabled, and at least three.
#[inline(never)]
#[small]
pub fn axes(machine: &mut impl Machine) -> u8 {
    let settings = machine.settings();
    let last = (3..AXES).rev().find(|axis| settings.axis_mode(*axis) != 0);
    last.map_or(3, |axis| axis as u8 + 1)
}

/// Whether reports are in inches.
#[small]
pub fn inches(machine: &mut impl Machine) -> bool {
    machine.settings().reports_in_inches()
}

fn of_system(token: [u8; 4]) -> Option<Setting> {
    named(Owner::System, token)
}

fn of_axis(axis: u8, token: [u8; 4]) -> Option<Setting> {
    named(Owner::Axis(axis), token)
}

fn of_spindle(token: [u8; 4]) -> Option<Setting> {
    named(Owner::Spindle, token)
}

fn of_motor(motor: u8, token: [u8; 4]) -> Option<Setting> {
    named(Owner::Motor(motor), token)
}

#[inline(never)]
#[small]
fn read(machine: &mut impl Machine, setting: Option<Setting>) -> i32 {
    setting.map_or(0, |setting| machine.setting(setting))
}

/// Returns a setting with exactly `decimals` decimals.
#[inline(never)]
#[small]
fn shown(machine: &mut impl Machine, setting: Option<Setting>, decimals: u8) -> Fixed {
    let Some(setting) = setting else { return Fixed::int(0) };
    let value = Fixed { value: machine.setting(setting), decimals: setting.row().stored };
    value.rounded(decimals).padded(decimals)
}

/// Returns, as bits, the axes with a switch whose mode has one of `bits`. With `lower` only switches at lower ends
/// count.
#[inline(never)]
#[small]
fn switches(machine: &mut impl Machine, bits: i32, lower: bool) -> i32 {
    let mut axes = 0;
    for axis in 0..HOMING {
        let sn = read(machine, of_axis(axis, token("sn")));
        let sx = read(machine, of_axis(axis, token("sx")));
        if (sn | if lower { 0 } else { sx }) & bits != 0 {
            axes |= 1 << axis;
        }
    }
    axes
}

/// Returns a bit for each axis with a motor whose setting is not 0.
#[inline(never)]
#[small]
fn mask(machine: &mut impl Machine, token: [u8; 4]) -> i32 {
    let mut bits = 0;
    for motor in 0..MOTORS as u8 {
        if read(machine, of_motor(motor, token)) != 0 {
            bits |= 1 << (read(machine, of_motor(motor, self::token("ma"))) & 15);
        }
    }
    bits
}

/// What [`split`] returns for the backlash of an axis.
const BACKLASH: u8 = 6;

/// Splits a number from 100 on: which of the settings of an axis, and which axis.
#[small]
fn split(number: u8) -> Option<(u8, u8)> {
    let number = number.checked_sub(100)?;
    let (what, axis) = (number / 10, number % 10);
    let exists = match what {
        0..4 => usize::from(axis) < AXES,
        BACKLASH => Capability::Backlash.is_built_in() && axis < HOMING,
        _ => false,
    };
    exists.then_some((what, axis))
}

/// Returns the value of a numbered setting; `None` if there is none.
#[inline(never)]
#[small]
pub fn value(number: u8, machine: &mut impl Machine) -> Option<Fixed> {
    if let Some((what, axis)) = split(number) {
        return Some(axis_value(what, axis, machine));
    }
    Some(match number {
        0 => shown(machine, of_system(token("spw")), 0),
        1 if read(machine, of_motor(0, token("pm"))) == 1 => Fixed::int(ALWAYS),
        1 => Fixed::int(read(machine, of_system(token("mt"))).min(i32::MAX / 10).wrapping_mul(10)),
        2 => Fixed::int(mask(machine, token("sp"))),
        3 => Fixed::int(mask(machine, token("po"))),
        4 | 6 | 32 => Fixed::int(0),
        5 => shown(machine, of_system(token("st")), 0),
        10 => {
            let mask = read(machine, of_system(token("grm")));
            Fixed::int(mask & REPORT | (mask & SYNC) >> SYNC_SHIFT)
        }
        11 => shown(machine, of_axis(0, token("jd")), 3),
        12 => shown(machine, of_system(token("ct")), 3),
        13 => Fixed::int(inches(machine).into()),
        20 => shown(machine, of_system(token("sl")), 0),
        21 => Fixed::int((switches(machine, 2, false) != 0).into()),
        22 => Fixed::int((switches(machine, 1, false) != 0).into()),
        23 => Fixed::int(switches(machine, 1, true)),
        24 => shown(machine, of_axis(0, token("lv")), 3),
        25 => shown(machine, of_axis(0, token("sv")), 3),
        26 => Fixed::int(DEBOUNCE_MS),
        27 => shown(machine, of_axis(0, token("zb")), 3),
        30 => shown(machine, named(Owner::Pwm, token("csh")), 0),
        31 => shown(machine, named(Owner::Pwm, token("csl")), 0),
        40 if Capability::Lathe.is_built_in() => shown(machine, of_spindle(token("n")), 0),
        41 if Capability::Lathe.is_built_in() => {
            Fixed::int(read(machine, of_spindle(token("b"))) / DEBOUNCE_US)
        }
        _ => return None,
    })
}

#[inline(never)]
#[small]
fn axis_value(what: u8, axis: u8, machine: &mut impl Machine) -> Fixed {
    match what {
        0 => Fixed { value: steps(axis, machine), decimals: 3 },
        1 => shown(machine, of_axis(axis, token("vm")), 3),
        2 => shown(machine, of_axis(axis, token("ac")), 3),
        BACKLASH => shown(machine, of_axis(axis, token("bl")), 3),
        _ => {
            let (low, high) = travel(axis, machine);
            Fixed { value: high.saturating_sub(low), decimals: 4 }.rounded(3)
        }
    }
}

fn travel(axis: u8, machine: &mut impl Machine) -> (i32, i32) {
    let low = read(machine, of_axis(axis, token("tn")));
    (low, read(machine, of_axis(axis, token("tm"))))
}

/// Sets a numbered setting to the value in `text`. [`Status::Again`] as of `Machine::set_row`: the whole call has to
/// be repeated.
#[inline(never)]
#[small]
pub fn set(number: u8, text: &[u8], machine: &mut impl Machine) -> Result<(), Status> {
    let to = by_name::parse(text)?;
    if to.is_negative() {
        return Err(Status::BelowMinimum);
    }
    if let Some((what, axis)) = split(number) {
        if axis >= axes(machine) {
            return Err(Status::UnrecognizedName);
        }
        return set_axis(what, axis, to, machine);
    }
    let whole = || to.fixed(0, false).ok_or(Status::BadNumber);
    match number {
        0 => put(machine, of_system(token("spw")), to),
        1 => set_idle(whole()?, machine),
        2 => set_mask(machine, token("sp"), whole()?),
        3 => set_mask(machine, token("po"), whole()?),
        5 => put(machine, of_system(token("st")), to),
        // Any value is accepted. Bits without a meaning here are ignored.
        10 => {
            let bits = whole()?;
            let bits = bits & REPORT | bits << SYNC_SHIFT & SYNC;
            set_report(bits, !(REPORT | SYNC), machine)
        }
        11 => each_axis(machine, AXES as u8, token("jd"), to),
        12 => put(machine, of_system(token("ct")), to),
        13 => set_report(i32::from(whole()? != 0) * INCHES, !INCHES, machine),
        20 => put(machine, of_system(token("sl")), to),
        21 => set_switches(machine, 2, whole()? != 0),
        22 if whole()? == 0 => set_switches(machine, 1, false),
        22 => home_again(machine),
        23 => set_homing(whole()?, machine),
        24 => each_axis(machine, HOMING, token("lv"), to),
        25 => each_axis(machine, HOMING, token("sv"), to),
        27 => each_axis(machine, HOMING, token("zb"), to),
        30 => put(machine, named(Owner::Pwm, token("csh")), to),
        31 => put(machine, named(Owner::Pwm, token("csl")), to),
        40 if Capability::Lathe.is_built_in() => put(machine, of_spindle(token("n")), to),
        41 if Capability::Lathe.is_built_in() => {
            let counts = whole()?.min(i32::MAX / DEBOUNCE_US);
            put_value(machine, of_spindle(token("b")), counts * DEBOUNCE_US)
        }
        // A fixed value may be set to itself.
        _ => match value(number, machine) {
            Some(fixed) if fixed.decimals == 0 && fixed.value == whole()? => Ok(()),
            Some(_) => Err(Status::ReadOnly),
            None => Err(Status::UnrecognizedName),
        },
    }
}

/// Sets a setting with one of Kerf's own names to the value in `text`. [`Status::Again`] as of [`set`].
#[small]
pub fn set_named(setting: Setting, text: &[u8], machine: &mut impl Machine) -> Result<(), Status> {
    let warning = by_name::set(setting, text, machine)?;
    note(machine, warning);
    Ok(())
}

/// Sets bits of `grm`, and keeps the bits in `kept`.
#[small]
fn set_report(bits: i32, kept: i32, machine: &mut impl Machine) -> Result<(), Status> {
    let mask = of_system(token("grm"));
    let bits = bits | read(machine, mask) & kept;
    put_value(machine, mask, bits)
}

/// Checks a number and stores it.
#[inline(never)]
#[small]
fn put(machine: &mut impl Machine, setting: Option<Setting>, to: Number) -> Result<(), Status> {
    let setting = setting.ok_or(Status::UnrecognizedName)?;
    let warning = by_name::put(setting, to, machine)?;
    note(machine, warning);
    Ok(())
}

/// Stores a value that has the scale of the stored setting.
#[inline(never)]
#[small]
fn put_value(
    machine: &mut impl Machine,
    setting: Option<Setting>,
    value: i32,
) -> Result<(), Status> {
    let setting = setting.ok_or(Status::UnrecognizedName)?;
    let warning = by_name::store(setting, value, machine)?;
    note(machine, warning);
    Ok(())
}

/// Remembers that a velocity has been lowered, for the message behind the answer.
#[inline(never)]
#[small]
fn note(machine: &mut impl Machine, warning: Warning) {
    if warning == Warning::Velocity {
        machine.memory().grbl.note(LOWERED, true);
    }
}

#[small]
fn each_axis(
    machine: &mut impl Machine,
    axes: u8,
    token: [u8; 4],
    to: Number,
) -> Result<(), Status> {
    (0..axes).try_for_each(|axis| put(machine, of_axis(axis, token), to))
}

#[small]
fn set_mask(machine: &mut impl Machine, token: [u8; 4], bits: i32) -> Result<(), Status> {
    (0..MOTORS as u8).try_for_each(|motor| {
        let axis = read(machine, of_motor(motor, self::token("ma"))) & 15;
        put_value(machine, of_motor(motor, token), bits >> axis & 1)
    })
}

/// `$1`, in ms.
#[small]
fn set_idle(ms: i32, machine: &mut impl Machine) -> Result<(), Status> {
    let mode = if ms == ALWAYS { 1 } else { 2 };
    (0..MOTORS as u8)
        .try_for_each(|motor| put_value(machine, of_motor(motor, token("pm")), mode))?;
    if ms == ALWAYS {
        return Ok(());
    }
    let hundredths = ms / 10 + i32::from(ms % 10 >= 5);
    // At least a tenth of a second.
    put_value(machine, of_system(token("mt")), hundredths.max(10))
}

/// Sets a bit in the modes of all switches that are on, or clears it in all.
#[small]
fn set_switches(machine: &mut impl Machine, bit: i32, on: bool) -> Result<(), Status> {
    (0..2 * HOMING).try_for_each(|end| {
        let token = if end & 1 == 0 { token("sn") } else { token("sx") };
        let setting = of_axis(end / 2, token);
        let mode = read(machine, setting);
        // A switch that is off stays off.
        let with = if on && mode != 0 {
            mode | bit
        } else if on {
            mode
        } else {
            mode & !bit
        };
        put_value(machine, setting, with)
    })
}

/// `$22=1`: switches the default homing switches on, unless there are homing switches already.
#[small]
fn home_again(machine: &mut impl Machine) -> Result<(), Status> {
    if switches(machine, 1, false) != 0 {
        return Ok(());
    }
    (0..2 * HOMING).try_for_each(|end| {
        let token = if end & 1 == 0 { token("sn") } else { token("sx") };
        let setting = of_axis(end / 2, token);
        let default = setting.map_or(0, Setting::default_value);
        let mode = read(machine, setting);
        put_value(machine, setting, mode | default & 1)
    })
}

/// `$23`: selects the axes that home at their lower ends.
#[small]
fn set_homing(bits: i32, machine: &mut impl Machine) -> Result<(), Status> {
    let homes = switches(machine, 1, false);
    (0..HOMING).filter(|axis| homes >> axis & 1 != 0).try_for_each(|axis| {
        let lower = bits >> axis & 1;
        let (sn, sx) = (of_axis(axis, token("sn")), of_axis(axis, token("sx")));
        let modes = [read(machine, sn), read(machine, sx)];
        // The limit function moves along with the homing switch.
        let limits = (modes[0] | modes[1]) & 2;
        put_value(machine, sn, if lower != 0 { 1 | limits } else { modes[0] & !1 })?;
        put_value(machine, sx, if lower != 0 { modes[1] & !1 } else { 1 | limits })
    })
}

#[small]
fn set_axis(what: u8, axis: u8, to: Number, machine: &mut impl Machine) -> Result<(), Status> {
    match what {
        0 => {
            motor_of(axis, machine).ok_or(Status::UnrecognizedName)?;
            set_steps(axis, to, machine, |machine, turn, to| put_value(machine, Some(turn), to))
        }
        1 => {
            put(machine, of_axis(axis, token("vm")), to)?;
            put(machine, of_axis(axis, token("fr")), to)
        }
        2 => put(machine, of_axis(axis, token("ac")), to),
        BACKLASH => put(machine, of_axis(axis, token("bl")), to),
        _ => {
            let length = to.fixed(4, false).ok_or(Status::OutOfRange)?;
            // On an axis whose zero is at the upper end the lower end moves.
            let (low, high) = travel(axis, machine);
            if high == 0 && low <= 0 {
                put_value(machine, of_axis(axis, token("tn")), -length)
            } else {
                let high = low.checked_add(length).ok_or(Status::OutOfRange)?;
                put_value(machine, of_axis(axis, token("tm")), high)
            }
        }
    }
}
