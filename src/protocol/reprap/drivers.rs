//! M906, M569 and M122: currents, chopper modes and states of the motors' drivers, on boards that set them up by UART.
//!
//! They are the settings `drr` and `drc`, which are stored at once. A part handles one motor.

use super::command::{has, value};
use super::host::Step;
use super::settings::{LETTERS, put_number, read};
use super::write::{int, line_end, text};
use crate::config::drive::DRIVERS;
use crate::config::name::axis_letter;
use crate::config::{Number, Owner};
use crate::progmem::Text;
use crate::protocol::steps::axis_of;
use crate::protocol::{Machine, Out, Value};
use crate::status::Status;
use crate::text;

const ALL: u8 = DRIVERS as u8;
/// The first part that reports.
const TELLS: u8 = 2 * ALL;
/// The first motor's settings: current in motion, at standstill, chopper.
const RUN: [u8; 4] = *b"r1\0\0";
const HOLD: [u8; 4] = *b"h1\0\0";
const CHOPPER: [u8; 4] = *b"c1\0\0";

/// Returns the name of a motor's setting.
fn of([kind, first, ..]: [u8; 4], motor: u8) -> [u8; 4] {
    [kind, first + motor, 0, 0]
}

/// Returns the letter of the axis that a motor moves; `None` if it moves none.
fn letter(motor: u8, machine: &mut impl Machine) -> Option<u8> {
    let axis = axis_of(motor, machine)?;
    Some(LETTERS.get(usize::from(axis)).copied().unwrap_or_else(|| axis_letter(axis)))
}

/// Performs part `at` of a code.
#[cold]
#[inline(never)]
pub fn part(
    code: u16,
    at: u8,
    block: &[u8],
    machine: &mut impl Machine,
    out: &mut impl Out,
) -> Step {
    match code {
        122 => report(at, machine, out),
        569 => set_choppers(at, block, machine, out),
        _ => set_currents(at, block, machine, out),
    }
}

/// M906: mA (RMS) in motion, by axis. All of them are checked before any is set. Without words it reports them.
fn set_currents(at: u8, block: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Step {
    if at >= TELLS {
        return tell(at, TELLS, machine, out, |motor, machine, out| {
            if motor == 0 {
                text(out, text!("echo:  M906"));
            }
            out.put(b' ');
            let name = letter(motor, machine).unwrap_or(b'-');
            out.put(name);
            int(out, read(machine, Owner::Drivers, of(RUN, motor)));
            if motor + 1 == ALL {
                line_end(out);
            }
        });
    }
    if at == 0 && !LETTERS.iter().any(|letter| has(block, *letter)) {
        return Step::At(TELLS);
    }
    let motor = at % ALL;
    let Some(letter) = letter(motor, machine).filter(|letter| has(block, *letter)) else {
        return next(at);
    };
    let to = value(block, letter, 0).and_then(|to| u32::try_from(to).ok());
    let Some(to) = to else { return Step::Refused(Status::OutOfRange) };
    put(at, of(RUN, motor), Number::int(to).thousandth(), machine)
}

/// M569 S1 is stealthChop, S0 spreadCycle, for the axes that are named, or for all. Without S it reports them.
fn set_choppers(at: u8, block: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Step {
    if at >= TELLS {
        return tell(at, TELLS, machine, out, |motor, machine, out| {
            begin(motor, machine, out);
            text(out, chopper(motor, machine));
            line_end(out);
        });
    }
    let to = match value(block, b'S', 0) {
        None => return Step::At(TELLS),
        Some(to @ 0..=1) => to as u32,
        Some(_) => return Step::Refused(Status::OutOfRange),
    };
    let motor = at % ALL;
    let names_some = LETTERS.iter().any(|letter| has(block, *letter));
    let is_named = letter(motor, machine).is_some_and(|letter| has(block, letter));
    if names_some && !is_named {
        return next(at);
    }
    put(at, of(CHOPPER, motor), Number::int(to), machine)
}

/// M122: state, currents and chopper mode of each driver, and its register DRV_STATUS.
fn report(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Step {
    tell(at, 0, machine, out, |motor, machine, out| {
        begin(motor, machine, out);
        text(out, state(machine.value(Value::Driver(motor))));
        text(out, text!(", run "));
        int(out, read(machine, Owner::Drivers, of(RUN, motor)));
        text(out, text!(" mA, hold "));
        int(out, read(machine, Owner::Drivers, of(HOLD, motor)));
        text(out, text!(" mA, "));
        text(out, chopper(motor, machine));
        text(out, text!(", DRV_STATUS "));
        let status = machine.value(Value::DriverStatus(motor)) as u32;
        for digit in (0..8).rev().map(|place| (status >> (4 * place) & 0xF) as u8) {
            out.put(if digit < 10 { b'0' + digit } else { b'a' - 10 + digit });
        }
        line_end(out);
    })
}

/// Writes the part of a motor, counted from the part `base`, and goes on with the next one.
fn tell<M: Machine, O: Out>(
    at: u8,
    base: u8,
    machine: &mut M,
    out: &mut O,
    write: impl FnOnce(u8, &mut M, &mut O),
) -> Step {
    let motor = at - base;
    if motor >= ALL {
        return Step::Done;
    }
    write(motor, machine, out);
    Step::At(at + 1)
}

fn begin(motor: u8, machine: &mut impl Machine, out: &mut impl Out) {
    text(out, text!("echo:  driver "));
    int(out, i32::from(motor) + 1);
    text(out, text!(" ("));
    out.put(letter(motor, machine).unwrap_or(b'-'));
    text(out, text!("): "));
}

fn chopper(motor: u8, machine: &mut impl Machine) -> Text {
    match read(machine, Owner::Drivers, of(CHOPPER, motor)) {
        0 => text!("spreadCycle"),
        _ => text!("stealthChop"),
    }
}

/// Returns what a state is called: see [`State`](crate::drivers::watch::State).
fn state(state: i32) -> Text {
    match state {
        0 => text!("OK"),
        1 => text!("does not answer"),
        2 => text!("has not taken its settings"),
        3 => text!("overheated, switched off"),
        4 => text!("shorted, switched off"),
        5 => text!("motor supply too low"),
        6 => text!("hot"),
        _ => text!("motor wire seems open"),
    }
}

/// Goes on with the next motor: first all are checked, then all are set.
fn next(at: u8) -> Step {
    if at + 1 < TELLS { Step::Later(at + 1) } else { Step::Done }
}

/// Checks the value of a motor's setting, or sets it in the second half of the parts.
fn put(at: u8, name: [u8; 4], to: Number, machine: &mut impl Machine) -> Step {
    match put_number(machine, Owner::Drivers, name, to, at >= ALL) {
        Ok(()) => next(at),
        Err(Status::Again) => Step::Later(at),
        Err(status) => Step::Refused(status),
    }
}
