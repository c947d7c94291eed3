//! The lists `$#`, `$G`, `$I`, `$N`.
//!
//! Each list is written in parts. A part is at most one coordinate or a few words.

use super::settings;
use super::write::{close, int, length, line_end, message, text};
use crate::capability::Capability;
use crate::gcode::tables::TableRow;
use crate::progmem;
use crate::progmem::Text;
use crate::protocol::{Machine, Out, Value};
use crate::text;

/// The number of rows of `$#`.
const ROWS: u8 = 11;
/// The last two rows: the tool length, and the result of probing.
const TOOL: u8 = 9;
/// See [`TOOL`].
pub const PROBED: u8 = 10;

progmem! {
    /// The names of the rows of `$#`.
    static NAMES: [Text; ROWS as usize] = [
        text!("[G54:"), text!("[G55:"), text!("[G56:"), text!("[G57:"), text!("[G58:"), text!("[G59:"),
        text!("[G28:"), text!("[G30:"), text!("[G92:"), text!("[TLO:"), text!("[PRB:"),
    ];
}

/// Returns the value of a row of `$#` on an axis.
#[small]
fn offset(row: u8, axis: u8) -> Value {
    match row {
        0..=5 => Value::TableRow(TableRow::system(row), axis),
        6 | 7 => Value::TableRow(TableRow::stored(row - 6), axis),
        8 => Value::Shift(axis),
        TOOL => Value::ToolOffset(2),
        _ => Value::Probed(axis),
    }
}

/// Writes part `at` of `$#`, which encodes a row and an axis. Returns the next part; `None` after the last.
#[inline(never)]
#[small]
pub fn offsets(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Option<u8> {
    let (row, axis) = (at >> 3, at & 7);
    let name = NAMES.at(row.into())?;
    let inches = settings::inches(machine);
    let axes = if row == TOOL { 1 } else { settings::axes(machine) };
    if axis == 0 {
        text(out, name);
    } else {
        out.put(b',');
    }
    length(out, machine.value(offset(row, axis)), inches && axis < 3);
    if axis + 1 < axes {
        return Some(at + 1);
    }
    if row == PROBED {
        out.put(b':');
        int(out, (machine.value(Value::ProbeState) == 1).into());
    }
    close(out);
    (row + 1 < ROWS).then_some((row + 1) << 3)
}

/// The part of [`offsets`] with which `[PRB:]` begins.
pub const PROBING: u8 = PROBED << 3;

progmem! {
    /// The motion modes, in the order of their numbers.
    static MOTIONS: [Text; 22] = [
        text!("G0"), text!("G1"), text!("G2"), text!("G3"), text!("G80"), text!("G38.2"), text!("G81"), text!("G82"),
        text!("G83"), text!("G84"), text!("G85"), text!("G86"), text!("G87"), text!("G88"), text!("G89"), text!("G73"),
        text!("G38.3"), text!("G38.4"), text!("G38.5"), text!("G33"), text!("G76"), text!("G33.1"),
    ];

    /// The coordinate systems, numbered from 1.
    static SYSTEMS: [Text; 9] = [
        text!(" G54"), text!(" G55"), text!(" G56"), text!(" G57"), text!(" G58"), text!(" G59"),
        text!(" G59.1"), text!(" G59.2"), text!(" G59.3"),
    ];
}

/// Writes part `at` of `$G`. Returns the next part; `None` after the last.
#[inline(never)]
#[small]
pub fn modes(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Option<u8> {
    if at == 0 {
        text(out, text!("[GC:"));
        let motion = machine.programmed(Value::MotionMode) as usize;
        text(out, MOTIONS.at(motion).unwrap_or(text!("G80")));
        let system = machine.programmed(Value::Coordinates) as usize;
        text(out, SYSTEMS.at(system.wrapping_sub(1)).unwrap_or(text!(" G54")));
        text(out, text!(" G1"));
        int(out, 7 + machine.programmed(Value::Plane));
        text(out, text!(" G2"));
        int(out, machine.programmed(Value::Units));
        text(out, text!(" G9"));
        int(out, machine.programmed(Value::Distance));
        text(out, text!(" G9"));
        int(out, 3 + machine.programmed(Value::FeedMode));
        return Some(1);
    }
    let turns = machine.programmed(Value::SpindleOn) != 0;
    let counter = machine.programmed(Value::SpindleDirection) != 0;
    text(out, text!(" M"));
    out.put(match (turns, counter) {
        (false, _) => b'5',
        (true, false) => b'3',
        (true, true) => b'4',
    });
    let (mist, flood) = (machine.programmed(Value::Mist), machine.programmed(Value::Flood));
    if mist != 0 {
        text(out, text!(" M7"));
    }
    if flood != 0 {
        text(out, text!(" M8"));
    }
    if mist + flood == 0 {
        text(out, text!(" M9"));
    }
    text(out, text!(" T"));
    int(out, machine.value(Value::SelectedTool));
    text(out, text!(" F"));
    super::write::speed(
        out,
        machine.programmed(Value::Feed),
        machine.programmed(Value::Units) == 0,
    );
    text(out, text!(" S"));
    int(out, machine.programmed(Value::SpindleSpeed));
    close(out);
    None
}

/// Writes part `at` of `$I`, the identity of the machine. The option letters stand for a variable spindle, line
/// numbers, mist, homing of single axes, a lathe's codes (X1), and overrides in probing. Z tells senders that homing
/// sets the origin at the switch. The free blocks and bytes follow. Returns the next part; `None` after the last.
#[inline(never)]
#[small]
pub fn build(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Option<u8> {
    if at == 0 {
        text(out, text!("[VER:1.1h.20190830:Kerf "));
        out.put_all(crate::config::VERSION.bytes());
        close(out);
        return Some(1);
    }
    if at == 1 {
        text(out, text!("[OPT:VNMZH"));
        if Capability::Lathe.is_built_in() {
            text(out, text!("X1"));
        }
        text(out, text!("A,"));
        int(out, machine.value(Value::BlocksFree));
        out.put(b',');
        int(out, machine.value(Value::BytesInAll));
        close(out);
        return Some(2);
    }
    let said = machine.value(Value::Choice) > 1;
    message(
        out,
        if said {
            text!("grbl's dialect, for it was said first")
        } else {
            text!("grbl's dialect, as is set")
        },
    );
    None
}

/// Writes a start-up line, such as `$N0=G54`. Returns the next part; `None` after the last.
#[small]
pub fn startup(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Option<u8> {
    text(out, text!("$N"));
    int(out, at.into());
    out.put(b'=');
    startup_text(at, machine, out);
    line_end(out);
    (at == 0).then_some(1)
}

/// Writes the text of a start-up line.
#[inline(never)]
#[small]
pub fn startup_text(line: u8, machine: &mut impl Machine, out: &mut impl Out) {
    let mut at = 0;
    while let Some(byte) = machine.startup(line, at) {
        out.put(byte);
        at += 1;
    }
}
