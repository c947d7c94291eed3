//! M303, and the PID factors of heaters: M301 and M304, and M130 to M132 in Teacup's units.

use super::command::{has, number, value};
use super::host::Step;
use super::settings::{put_number, read};
use super::write::{fixed, int, line_end, text};
use crate::config::{Fixed, Number, Owner};
use crate::heat::tune::{CYCLES_MAX, Stage, Tune};
use crate::progmem::Text;
use crate::protocol::{Machine, Out};
use crate::status::Status;
use crate::text;

/// The letters of M301 and M304, which are also those of the settings.
const LETTERS: [u8; 3] = *b"PID";
/// The first part that reports the factors.
const TELLS: u8 = 8;

/// Returns the owner of the factors that a code is about.
fn owner(bed: bool) -> Owner {
    if bed { Owner::Bed } else { Owner::HotEnd }
}

/// Returns the name of the setting for a letter.
fn name(letter: u8) -> [u8; 4] {
    [LETTERS.get(usize::from(letter)).map_or(0, u8::to_ascii_lowercase), 0, 0, 0]
}

/// M303: E selects the heater (-1 is the bed), S the temperature, C the number of cycles; U1 uses the result.
#[inline(never)]
#[small]
pub fn begin(block: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Step {
    let heater = match value(block, b'E', 0).unwrap_or(0) {
        0 => 0u8,
        -1 => 1,
        _ => return Step::Refused(Status::ToolInvalid),
    };
    let usual = if heater == 0 { 200 } else { 60 };
    let degrees = value(block, b'S', 0).unwrap_or(usual);
    let cycles = value(block, b'C', 0).unwrap_or(5);
    if !(30..=500).contains(&degrees) || !(0..=CYCLES_MAX.into()).contains(&cycles) {
        return Step::Refused(Status::OutOfRange);
    }
    let uses = value(block, b'U', 0).is_some_and(|uses| uses != 0);
    match machine.tune(heater, degrees as u16 * 8, cycles as u8, uses) {
        Status::Again => Step::Later(0),
        Status::Ok => {
            text(out, text!("PID Autotune start\n"));
            Step::Done
        }
        status => Step::Refused(status),
    }
}

/// Writes part `at` of the progress of an autotune: the cycle, or the result. Returns the next part; `None` after the
/// last.
#[inline(never)]
#[small]
pub fn put(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Option<u8> {
    let tune = machine.tuned();
    let swings = matches!(tune.stage, Stage::Swings | Stage::Done);
    match at {
        0 if swings => {
            powers(&tune, out);
            Some(1)
        }
        1 => {
            let (low, high) = tune.extremes;
            degrees(text!(" min: "), low, out);
            degrees(text!(" max: "), high, out);
            line_end(out);
            (tune.stage != Stage::Swings).then_some(2)
        }
        0 | 2 => {
            text(out, text!("PID Autotune "));
            text(out, ending(tune.stage));
            line_end(out);
            (tune.stage == Stage::Done).then_some(3)
        }
        _ => {
            let found = [tune.found.p, tune.found.i, tune.found.d];
            let letter = usize::from(at) - 3;
            let value = found.get(letter).copied().unwrap_or(0);
            factor(tune.bed, letter as u8, Fixed { value: value.into(), decimals: 2 }, out);
            (letter < 2).then_some(at + 1)
        }
    }
}

#[small]
fn powers(tune: &Tune, out: &mut impl Out) {
    text(out, text!(" bias: "));
    int(out, tune.bias.into());
    text(out, text!(" d: "));
    int(out, tune.swing.into());
}

/// Writes 1/64 degree as degrees with two decimals.
#[small]
fn degrees(name: Text, value: i16, out: &mut impl Out) {
    text(out, name);
    let value = i32::from(value) * 125 / 8;
    fixed(out, Fixed { value, decimals: 3 }.rounded(2));
}

#[small]
fn ending(stage: Stage) -> Text {
    match stage {
        Stage::Done => text!("finished!"),
        Stage::TooHot => text!("failed! Temperature too high"),
        Stage::TooSlow => text!("failed! timeout"),
        _ => text!("stopped"),
    }
}

/// Writes `echo:  M301 P20 I0.8 D80`, one letter per call.
#[inline(never)]
#[small]
fn factor(bed: bool, letter: u8, value: Fixed, out: &mut impl Out) {
    if letter == 0 {
        text(out, if bed { text!("echo:  M304") } else { text!("echo:  M301") });
    }
    out.put(b' ');
    out.put(LETTERS.get(usize::from(letter)).copied().unwrap_or(b'P'));
    fixed(out, value);
    if letter == 2 {
        line_end(out);
    }
}

/// Writes one factor of a heater. Returns whether there is more.
#[inline(never)]
#[small]
pub fn list(bed: bool, letter: u8, machine: &mut impl Machine, out: &mut impl Out) -> bool {
    let value = read(machine, owner(bed), name(letter));
    factor(bed, letter, Fixed { value, decimals: 3 }.rounded(2), out);
    letter < 2
}

/// M130, M131, M132: S is a factor in Teacup's units (quarters of a degree, four times a second). P1 selects the bed.
/// Without S the factors are reported as by M301.
#[inline(never)]
#[small]
pub fn set_teacup(
    code: u16,
    at: u8,
    block: &[u8],
    machine: &mut impl Machine,
    out: &mut impl Out,
) -> Step {
    let bed = match value(block, b'P', 0).unwrap_or(0) {
        0 => false,
        1 => true,
        _ => return Step::Refused(Status::ToolInvalid),
    };
    let Some(to) = value(block, b'S', 4) else {
        if has(block, b'S') {
            return Step::Refused(Status::OutOfRange);
        }
        return if list(bed, at, machine, out) { Step::At(at + 1) } else { Step::Done };
    };
    // Converts to power per degree, per degree and second, and per degree a second; Teacup takes the difference over
    // two seconds.
    let (letter, factor) = match code {
        130 => (0, 4),
        131 => (1, 16),
        _ => (2, 8),
    };
    let Some(to) = u32::try_from(to).ok().and_then(|to| to.checked_mul(factor)) else {
        return Step::Refused(Status::OutOfRange);
    };
    match put_number(machine, owner(bed), name(letter), Number::int(to / 10).thousandth(), true) {
        Ok(()) => Step::Done,
        Err(Status::Again) => Step::Later(0),
        Err(status) => Step::Refused(status),
    }
}

/// M301, and M304 for the bed: sets the factors that are named, or reports all if none is.
#[inline(never)]
#[small]
pub fn set(
    bed: bool,
    at: u8,
    block: &[u8],
    machine: &mut impl Machine,
    out: &mut impl Out,
) -> Step {
    if at >= TELLS {
        return if list(bed, at - TELLS, machine, out) { Step::At(at + 1) } else { Step::Done };
    }
    if at == 0 && !LETTERS.iter().any(|letter| number(block, *letter).is_some()) {
        return Step::At(TELLS);
    }
    let Some(letter) = LETTERS.get(usize::from(at)) else { return Step::Done };
    let Some(to) = number(block, *letter) else { return Step::Later(at + 1) };
    match put_number(machine, owner(bed), name(at), to, true) {
        Ok(()) => Step::Later(at + 1),
        Err(Status::Again) => Step::Later(at),
        Err(status) => Step::Refused(status),
    }
}
