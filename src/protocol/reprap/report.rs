//! The reports of M105, M114, M115, M119.

use super::host::{Step, count};
use super::write::{fixed, int, length, line_end, text};
use crate::boards::inputs;
use crate::config::Fixed;
use crate::plain;
use crate::protocol::steps::motor_of;
use crate::protocol::{Machine, Out, Value};
use crate::text;

/// The letters of the axes: E is the A axis of the interpreter.
const LETTERS: [u8; 4] = *b"XYZE";

/// Writes part `at` of ` T:21.50 /0.00 B:20.75 /0.00 @:0 B@:0`, without a line end. Returns the next part; `None`
/// after the last. Writes nothing in an image without heaters.
#[inline(never)]
#[small]
pub fn temperatures(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Option<u8> {
    let stands = machine.heater(at & 1)?;
    if at < 2 {
        text(out, if at == 0 { text!(" T:") } else { text!(" B:") });
        degrees(stands.now.into(), out);
        text(out, text!(" /"));
        degrees(stands.to.into(), out);
    } else {
        text(out, if at == 2 { text!(" @:") } else { text!(" B@:") });
        // Hosts expect a power from 0 to 127.
        int(out, (stands.power >> 1).into());
    }
    (at < 3).then_some(at + 1)
}

/// Writes eighths of a degree as degrees with two decimals.
#[small]
fn degrees(eighths: i32, out: &mut impl Out) {
    let thousandths = Fixed { value: eighths * 125, decimals: 3 };
    fixed(out, thousandths.rounded(2).padded(2));
}

/// M105: reports the temperatures behind the `ok`, in one line.
#[small]
pub fn answer(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Step {
    if at == 0 {
        out.put_plain(plain!("ok"));
        return Step::At(1);
    }
    if let Some(next) = temperatures(at - 1, machine, out) {
        return Step::At(next + 1);
    }
    line_end(out);
    Step::Answered
}

/// M114: reports the present position of the machine, and the steps of its motors.
#[inline(never)]
#[small]
pub fn position(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Option<u8> {
    machine.moment(at == 0);
    let axis = at & 3;
    let letter = LETTERS.get(usize::from(axis)).copied().unwrap_or(b'E');
    if at < 4 {
        out.put(letter);
        out.put(b':');
        length(out, machine.value(Value::Position(axis)));
        out.put(b' ');
        return Some(at + 1);
    }
    if at == 4 {
        text(out, text!("Count"));
    }
    if let Some(motor) = motor_of(axis, machine) {
        count(letter, machine.value(Value::Steps(motor)), out);
    }
    if at < 7 {
        return Some(at + 1);
    }
    line_end(out);
    None
}

/// M115: reports what the machine is and what it supports.
#[inline(never)]
#[small]
pub fn identity(at: u8, out: &mut impl Out) -> Option<u8> {
    match at {
        0 => text(out, text!("FIRMWARE_NAME:Kerf ")),
        1 => {
            out.put_all(crate::config::VERSION.bytes());
            text(out, text!(" PROTOCOL_VERSION:1.0 MACHINE_TYPE:"));
        }
        2 => {
            text(out, text!("RepRap EXTRUDER_COUNT:1\n"));
        }
        3 => text(out, text!("Cap:AUTOREPORT_TEMP:1\nCap:EMERGENCY_PARSER:1\n")),
        _ => {
            text(out, text!("Cap:EEPROM:1\nCap:BUSY_PROTOCOL:1\n"));
            return None;
        }
    }
    Some(at + 1)
}

/// M119: reports the switches that are set up.
#[inline(never)]
#[small]
pub fn switches(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Option<u8> {
    const PROBE: u8 = 6;
    if at == 0 {
        text(out, text!("Reporting endstop status\n"));
    }
    let input = if at == PROBE { inputs::PROBE as u8 } else { at };
    let worked = machine.value(Value::Input(input));
    if worked >= 0 {
        if at == PROBE {
            text(out, text!("z_probe"));
        } else {
            out.put(b'x' + at / 2);
            text(out, if at & 1 == 0 { text!("_min") } else { text!("_max") });
        }
        text(out, if worked > 0 { text!(": TRIGGERED\n") } else { text!(": open\n") });
    }
    (at < PROBE).then_some(at + 1)
}
