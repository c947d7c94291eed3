//! The codes that the interpreter does not run: they query something, set something, or wait.

use super::command::{has, value, words};
use super::write::{cold, fixed, int, line_end, text};
use super::{bed, card, names, report, settings, shaper, tuning};
use crate::capability::Capability;
use crate::config::Fixed;
use crate::gcode::overrides::{Change, Override};
use crate::machine::{Alarm, Cycle, Doing};
use crate::progmem::Text;
use crate::protocol::steps::axis_of;
use crate::protocol::{Cold, Extruder, Machine, Out, Value};
use crate::status::Status;
use crate::text;
use crate::units::Length;

/// The code of a line: a letter in upper case, and a number.
pub type Code = (u8, u16);

/// The progress of a code.
pub enum Step {
    /// Continue with this part at once.
    At(u8),
    /// Continue with this part later.
    Later(u8),
    /// Answer `ok`.
    Done,
    /// The code has written its own `ok`.
    Answered,
    /// The interpreter runs the block. The line is answered when the planner has taken that.
    Gcode,
    /// The code is refused.
    Refused(Status),
}

/// The most bytes of a text that a step writes.
const PART: usize = 60;
/// All axes, as bits.
const ALL: u8 = u8::MAX;
/// The axes of a printer that may be homed.
const HOMED: [u8; 3] = *b"XYZ";
/// The axis of the extruder.
const EXTRUDER: u8 = 3;

/// Returns the code, if it is one of those in this module.
#[inline(never)]
#[small]
pub fn of(code: Option<Code>, block: &[u8]) -> Option<Code> {
    let is_own = match code? {
        (b'M', 20..=29 | 32) => true,
        // M30 without a file name ends the program, so the interpreter runs it.
        (b'M', 30) => !words(block).is_empty(),
        // With P it is the temperature of an extruder, and with L an offset: those of Duet's firmware.
        (b'G', 10) => !has(block, b'P') && !has(block, b'L'),
        (b'G', 11 | 28 | 161 | 162) => true,
        (b'G', 29) | (b'M', 420) => Capability::BedPlane.is_built_in(),
        (b'M', 593) => Capability::Shaping.is_built_in(),
        (b'M', 122 | 569 | 906) => Capability::Drivers.is_built_in(),
        (b'M', number) => matches!(
            number,
            17 | 18 | 82..=84 | 92 | 105 | 108 | 110..=115 | 117..=119 | 130..=134 | 155
                | 201..=208 | 220 | 221 | 301..=304 | 400 | 500..=503 | 900 | 999
        ),
        (b'T' | b'$', _) => true,
        _ => false,
    };
    code.filter(|_| is_own)
}

/// Performs part `at` of a code.
#[inline(never)]
#[small]
pub fn part(
    code: Code,
    at: u8,
    block: &[u8],
    machine: &mut impl Machine,
    out: &mut impl Out,
) -> Step {
    let number = match code {
        (b'T', 0) => return Step::Done,
        (b'T', _) => return Step::Refused(Status::ToolInvalid),
        (b'$', _) => return names::part(at, block, machine, out),
        (b'G', 10 | 11) => return retract(code.1 == 10, machine, out),
        (b'G', 29) | (b'M', 420) if Capability::BedPlane.is_built_in() => {
            return bed::part(code.1, at, block, machine, out);
        }
        (b'G', number) => return home(at, number, block, machine),
        (_, number) => number,
    };
    match number {
        20..=30 | 32 => card::part(number, at, block, machine, out),
        18 | 84 => motors_off(block, machine),
        17 => done(machine.energize(None, true)),
        82 | 83 => done(machine.extruder(Extruder::Relative(number == 83))),
        105 => report::answer(at, machine, out),
        108 => {
            machine.skip_wait();
            if !go_on(machine, out) {
                machine.go_on();
            }
            Step::Done
        }
        110 if has(block, b'N') && value(block, b'N', 0).is_none() => {
            Step::Refused(Status::OutOfRange)
        }
        112 => {
            // Each port is told of the alarm, this one too.
            machine.alarm(Alarm::Shutdown, Status::ShutDown);
            Step::Done
        }
        113 => busy(block, machine, out),
        114 => listed(report::position(at, machine, out)),
        115 => listed(report::identity(at, out)),
        118 => echo(at, block, out),
        119 => listed(report::switches(at, machine, out)),
        #[cfg(feature = "drivers")]
        122 | 569 | 906 => super::drivers::part(number, at, block, machine, out),
        130..=132 => tuning::set_teacup(number, at, block, machine, out),
        155 => match interval(value(block, b'S', 0).unwrap_or(0)) {
            Ok(seconds) => {
                machine.memory().reprap.interval_s = seconds;
                Step::Done
            }
            Err(status) => Step::Refused(status),
        },
        207 => set_retraction(block, machine),
        208 => {
            if let Some(length) = value(block, b'S', 4) {
                machine.memory().reprap.extra = length;
            }
            Step::Done
        }
        220 => speed(block, machine, out),
        221 => flow(block, machine, out),
        301 | 304 => tuning::set(number == 304, at, block, machine, out),
        302 => extrude_cold(block, machine, out),
        303 => tuning::begin(block, machine, out),
        400 => finished(machine),
        134 | 500 => keep(at, machine),
        501 => match machine.recall() {
            Status::Again => Step::Later(0),
            status => done(status),
        },
        502 => restore(at, machine),
        503 => settings::list(at, machine, out).map_or(Step::Done, Step::At),
        92 | 201..=206 => settings::set(number, at, block, machine, out),
        593 => shaper::set(block, machine, out),
        900 => advance(block, machine, out),
        999 => match machine.clear() {
            Status::Again => Step::Later(0),
            Status::Ok => {
                machine.unlock_heaters();
                // The alarm may have dropped the retraction.
                machine.memory().reprap.retracted = false;
                Step::Done
            }
            status => Step::Refused(status),
        },
        _ => Step::Done,
    }
}

/// Whether a code is performed at rest.
#[small]
pub fn needs_rest(code: Code, block: &[u8]) -> bool {
    match code {
        (b'M', 18 | 84 | 400 | 420 | 501 | 502) | (b'G', 28 | 29 | 161 | 162) => true,
        (b'M', 92 | 201 | 203 | 206) => !words(block).is_empty(),
        (b'M', 205) => has(block, b'J'),
        (b'M', 569) => Capability::Drivers.is_built_in() && has(block, b'S'),
        (b'$', _) => block.contains(&b'='),
        _ => false,
    }
}

/// M400: waits until all requested motion is done, or an alarm has dropped it.
#[small]
fn finished(machine: &mut impl Machine) -> Step {
    match machine.doing() {
        Doing::Alarm(alarm) => Step::Refused(alarm.status()),
        _ if machine.value(Value::Working) != 0 => Step::Later(0),
        _ => Step::Done,
    }
}

pub(super) fn done(status: Status) -> Step {
    if status == Status::Ok { Step::Done } else { Step::Refused(status) }
}

fn listed(next: Option<u8>) -> Step {
    next.map_or(Step::Done, Step::At)
}

/// G10 and G11. Repeating the last one does nothing.
#[inline(never)]
#[small]
fn retract(back: bool, machine: &mut impl Machine, out: &mut impl Out) -> Step {
    let kept = &machine.memory().reprap;
    if kept.retracted == back {
        return Step::Done;
    }
    let far =
        if back { kept.length.saturating_neg() } else { kept.length.saturating_add(kept.extra) };
    let by = Extruder::Move { by: Length(far), feed: kept.feed };
    match machine.extruder(by) {
        Status::Again => Step::Later(0),
        Status::TooCold => {
            cold(out);
            Step::Done
        }
        status => {
            if status == Status::Ok {
                machine.memory().reprap.retracted = back;
            }
            done(status)
        }
    }
}

/// M207: S is the length of the retraction, F its speed.
#[small]
fn set_retraction(block: &[u8], machine: &mut impl Machine) -> Step {
    let (length, feed) = (value(block, b'S', 4), value(block, b'F', 0));
    // Limits the length to a metre.
    if length.is_some_and(|length| !(0..10_000_000).contains(&length))
        || feed.is_some_and(|feed| !(1..=60_000).contains(&feed))
    {
        return Step::Refused(Status::OutOfRange);
    }
    let kept = &mut machine.memory().reprap;
    kept.length = length.unwrap_or(kept.length);
    kept.feed = feed.unwrap_or(kept.feed);
    Step::Done
}

/// Returns the axes that a block names, as bits; [`ALL`] if it names none.
#[inline(never)]
#[small]
fn axes(block: &[u8]) -> u8 {
    let mut axes = 0;
    for (axis, letter) in HOMED.iter().enumerate() {
        axes |= u8::from(has(block, *letter)) << axis;
    }
    if axes == 0 { ALL } else { axes }
}

/// G28, G161 and G162. G161 and G162 need homing switches at the end that they name. Runs at rest, and is answered
/// when homing is over.
#[inline(never)]
#[small]
fn home(at: u8, number: u16, block: &[u8], machine: &mut impl Machine) -> Step {
    const HOMES: u8 = 1;
    let axes = axes(block);
    if machine.value(Value::Working) != 0 || machine.cycle() == Cycle::Homing {
        return Step::Later(at);
    }
    if at != HOMES {
        let upper = settings::homed_at_upper_end(axes, machine);
        let wrong = match number {
            161 => upper != 0,
            162 => upper == 0,
            _ => false,
        };
        if wrong {
            return Step::Refused(Status::HomingSwitches);
        }
        return match machine.home(axes, false) {
            Status::Ok => {
                machine.memory().reprap.homes = true;
                Step::Later(HOMES)
            }
            Status::Again => Step::Later(at),
            status => Step::Refused(status),
        };
    }
    let named = (0..HOMED.len() as u8).filter(|axis| axes & 1 << axis != 0);
    let mut homed = 0;
    for axis in named {
        homed |= u8::from(machine.value(Value::Homed(axis)) != 0) << axis;
    }
    machine.clear_shift(homed);
    if homed == 0 {
        return Step::Refused(Status::HomingFailed);
    }
    machine.memory().reprap.homes = false;
    Step::Done
}

/// M84, M18: turns off the named motors, or all, once the machine rests. With S nothing is turned off: S is the time
/// for which motors stay powered at rest, which is a setting in Kerf.
#[inline(never)]
#[small]
fn motors_off(block: &[u8], machine: &mut impl Machine) -> Step {
    if has(block, b'S') {
        return Step::Done;
    }
    if machine.value(Value::Working) != 0 {
        return Step::Later(0);
    }
    let named = axes(block);
    let extruder = has(block, b'E');
    if named == ALL && !extruder {
        return done(machine.energize(None, false));
    }
    let axes = if named == ALL { 0 } else { named } | u8::from(extruder) << EXTRUDER;
    for motor in 0..crate::boards::MOTORS as u8 {
        if axis_of(motor, machine).is_some_and(|axis| axes & 1 << axis != 0) {
            machine.energize(Some(motor), false);
        }
    }
    Step::Done
}

/// M113: sets the seconds from one message that a line takes long to the next, 0 for none; without S reports them.
#[small]
fn busy(block: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Step {
    let Some(seconds) = value(block, b'S', 0) else {
        text(out, text!("echo:M113 S"));
        int(out, machine.memory().reprap.busy_s.into());
        line_end(out);
        return Step::Done;
    };
    match interval(seconds) {
        Ok(seconds) => {
            machine.memory().reprap.busy_s = seconds;
            Step::Done
        }
        Err(status) => Step::Refused(status),
    }
}

/// Returns the period of messages of S seconds, at most a minute.
fn interval(seconds: i32) -> Result<u8, Status> {
    const LONGEST_S: i32 = 60;
    if seconds < 0 { Err(Status::OutOfRange) } else { Ok(seconds.min(LONGEST_S) as u8) }
}

/// M118: sends the text back, after `//` for `A1` and after `echo:` for `E1`. `P0`, the port, is left out.
#[small]
fn echo(at: u8, block: &[u8], out: &mut impl Out) -> Step {
    let mut rest = words(block);
    while let [letter @ (b'A' | b'E' | b'P'), b'0'..=b'9', b' ', behind @ ..] = rest {
        if at == 0 && *letter != b'P' {
            text(out, if *letter == b'A' { text!("//") } else { text!("echo:") });
        }
        rest = behind;
    }
    let rest = rest.get(usize::from(at)..).unwrap_or(&[]);
    let part = rest.get(..PART).unwrap_or(rest);
    out.put_all(part.iter().copied());
    if part.len() == PART {
        return Step::At(at + PART as u8);
    }
    line_end(out);
    Step::Done
}

/// M220: sets the feed rate to S percent of the programmed one; without S reports it.
#[small]
fn speed(block: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Step {
    let Some(factor) = value(block, b'S', 1) else {
        let now = machine.value(Value::Override(Override::Feed));
        return percent(text!("FR:"), now, out);
    };
    match u32::try_from(factor).ok().and_then(|factor| Override::Feed.checked(factor)) {
        Some(factor) => {
            machine.change_override(Change::to(Override::Feed, factor));
            Step::Done
        }
        None => Step::Refused(Status::OutOfRange),
    }
}

/// M221: sets the flow of filament to S percent of the programmed one; without S reports it.
#[small]
fn flow(block: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Step {
    match value(block, b'S', 1) {
        None => {
            let now = machine.value(Value::Flow);
            percent(text!("Flow:"), now, out)
        }
        Some(factor) => match u16::try_from(factor) {
            Ok(factor @ 10..=5_000) => done(machine.extruder(Extruder::Flow(factor))),
            _ => Step::Refused(Status::OutOfRange),
        },
    }
}

/// M302: S is the temperature from which filament may be moved. S0 or P1 allow any temperature. Without S and P the
/// limit is reported.
#[inline(never)]
#[small]
fn extrude_cold(block: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Step {
    let (least, allows) = (value(block, b'S', 0), value(block, b'P', 0));
    if least.is_some_and(|least| !(0..=330).contains(&least)) {
        return Step::Refused(Status::OutOfRange);
    }
    if let Some(least) = least {
        machine.extrude_cold(Cold::Least(least as i16));
        machine.extrude_cold(Cold::Allowed(least == 0));
    }
    if let Some(allows) = allows {
        machine.extrude_cold(Cold::Allowed(allows != 0));
    } else if least.is_none() {
        let (least, allows) = machine.extrude_cold(Cold::Asked);
        text(out, text!("echo:Cold extrudes are "));
        text(out, if allows { text!("en") } else { text!("dis") });
        text(out, text!("abled (min temp "));
        int(out, least.into());
        text(out, text!("C)\n"));
    }
    Step::Done
}

/// M900: K sets the pressure advance, in s; without K it is reported.
#[small]
fn advance(block: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Step {
    const MOST: u16 = 20_000;
    let Some(time) = value(block, b'K', 4) else {
        if has(block, b'K') {
            return Step::Refused(Status::OutOfRange);
        }
        let now = machine.settings().heating.first().map_or(0, |heating| heating.advance);
        text(out, text!("Advance K="));
        fixed(out, Fixed { value: now.into(), decimals: 4 });
        line_end(out);
        return Step::Done;
    };
    match u16::try_from(time) {
        Ok(time @ 0..=MOST) => match machine.extruder(Extruder::Advance(time)) {
            Status::Again => Step::Later(0),
            status => done(status),
        },
        _ => Step::Refused(Status::OutOfRange),
    }
}

#[small]
fn percent(what: Text, thousandths: i32, out: &mut impl Out) -> Step {
    text(out, what);
    fixed(out, Fixed { value: thousandths, decimals: 1 }.rounded(0));
    out.put(b'%');
    line_end(out);
    Step::Done
}

/// Ends a program stop, if the machine waits at one. Returns whether it does.
#[inline(never)]
#[small]
pub fn go_on(machine: &mut impl Machine, out: &mut impl Out) -> bool {
    let stands = machine.cycle() == Cycle::Stopped;
    if stands {
        text(out, text!("//action:resumed\n"));
        machine.go_on();
    }
    stands
}

/// M500: stores the settings that have changed, and waits until all are stored.
#[small]
fn keep(at: u8, machine: &mut impl Machine) -> Step {
    if at == 0 && machine.keep() == Status::Again {
        return Step::Later(0);
    }
    if machine.value(Value::Kept) == 0 { Step::Later(1) } else { Step::Done }
}

/// M502: restores the defaults.
#[small]
fn restore(at: u8, machine: &mut impl Machine) -> Step {
    if at == 0 && machine.value(Value::Working) != 0 {
        return Step::Later(0);
    }
    if at == 0 {
        return match machine.restore(false) {
            Status::Ok => Step::Later(1),
            status => Step::Refused(status),
        };
    }
    if machine.value(Value::Kept) == 0 { Step::Later(1) } else { Step::Done }
}

/// Writes a letter and a count.
#[small]
pub fn count(letter: u8, value: i32, out: &mut impl Out) {
    out.put(b' ');
    out.put(letter);
    out.put(b':');
    int(out, value);
}
