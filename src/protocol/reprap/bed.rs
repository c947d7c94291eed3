//! G29 and M420: the bed of a printer as a plane through three points, which moves follow.
//!
//! | code | action |
//! |---|---|
//! | G29 L R F B Z | probes three points between L and R and between F and B; then moves follow the plane, and the points are listed |
//! | G29 S0 | lists the points |
//! | G29 S1 X Y Z | adds a point: the position of the machine, with the named coordinates replaced; with the third point moves follow the plane |
//! | G29 S5 | forgets the points |
//! | M420 S1, S0 | moves follow the plane, or do not; without S as G29 S0 |
//!
//! Every operation runs at standstill, one at a time. While the machine moves, the line waits. Words are lengths in
//! machine coordinates. An alarm or an interrupted move ends the code, and leaves no plane.

use super::command::{has, number, value};
use super::host::Step;
use super::write::{int, length, line_end, text};
use crate::boards::inputs;
use crate::config::bed::{Bed, Fault, POINTS, Point};
use crate::config::getters::TRAVEL_NONE;
use crate::machine::{Doing, ProbeState};
use crate::progmem::Text;
use crate::protocol::{Level, Machine, Out, Value};
use crate::status::Status;
use crate::text;
use crate::units::Length;

/// The first part of a code, which checks the request.
const BEGINS: u8 = 0;
/// The part in which points may change, because moves no longer follow the plane.
const CHANGES: u8 = 1;
/// The part after the work is done.
const ENDS: u8 = 2;
/// The first part that lists the points.
const TELLS: u8 = 4;
/// The first part that probes points. Each point takes [`STAGES`] parts.
const PROBES: u8 = 16;
/// The stages of a point: move over it, probe down, move up, take the result. An interrupted move leaves fewer than
/// three points.
const STAGES: u8 = 4;
/// The part after the last point.
const FOLLOWS: u8 = PROBES + STAGES * POINTS as u8;

/// Without the word Z the bed is searched for within 5 mm above and below the lower end of Z.
const HEIGHT: Length = Length(5 * Length::PER_MM);
/// The range of the word Z: 0.5 to 50 mm.
const HEIGHTS: core::ops::RangeInclusive<Length> =
    Length(Length::PER_MM / 2)..=Length(50 * Length::PER_MM);
/// Without words, the outermost tenth of the travel at either end is not probed. This is the divisor.
const MARGIN: i32 = 10;

/// Why a code is refused.
enum Trouble {
    Status(Status),
    Bed(Fault),
    NotHomed,
    NoProbe,
    Touches,
    NoTravel,
    NoPlane,
}

impl From<Status> for Trouble {
    fn from(status: Status) -> Self {
        Self::Status(status)
    }
}

impl From<Fault> for Trouble {
    fn from(fault: Fault) -> Self {
        Self::Bed(fault)
    }
}

/// The next step of a code.
type Next = Result<Step, Trouble>;

/// Performs part `at` of a code.
#[inline(never)]
#[small]
pub fn part(
    code: u16,
    at: u8,
    block: &[u8],
    machine: &mut impl Machine,
    out: &mut impl Out,
) -> Step {
    if (TELLS..PROBES).contains(&at) {
        return list(at - TELLS, machine, out);
    }
    if machine.value(Value::Working) != 0 {
        return Step::Later(at);
    }
    if let Doing::Alarm(alarm) = machine.doing() {
        return Step::Refused(alarm.status());
    }
    let next = match value(block, b'S', 0) {
        None if has(block, b'S') => Err(Status::OutOfRange.into()),
        what if code == 420 => switch(at, what, machine),
        None => level(at, block, machine),
        Some(what) => change(at, what, block, machine),
    };
    match next {
        Ok(step) => step,
        Err(Trouble::Status(Status::Again)) => Step::Later(at),
        Err(Trouble::Status(status)) => Step::Refused(status),
        Err(trouble) => {
            text(out, text!("Error:"));
            text(out, reason(&trouble));
            line_end(out);
            Step::Done
        }
    }
}

#[small]
fn reason(trouble: &Trouble) -> Text {
    match trouble {
        Trouble::Bed(Fault::Line) => text!("points of the bed on a line, or too near"),
        Trouble::Bed(Fault::Steep) => text!("bed tilted too much"),
        Trouble::Bed(Fault::Far) => text!("point of the bed too far away"),
        Trouble::Bed(Fault::Full) => text!("three points are known; G29 S5"),
        Trouble::NotHomed => text!("X, Y or Z not homed; G28"),
        Trouble::NoProbe => text!("no probe"),
        Trouble::Touches => text!("probe touches already"),
        Trouble::NoTravel => text!("no travel set; name L, R, F, B"),
        Trouble::NoPlane => text!("fewer than three points; G29"),
        Trouble::Status(_) => text!("not carried out"),
    }
}

/// Returns the length in a word; `None` if the block does not have the word.
#[inline(never)]
#[small]
fn word(block: &[u8], letter: u8, machine: &mut impl Machine) -> Result<Option<Length>, Trouble> {
    if !has(block, letter) {
        return Ok(None);
    }
    let inches = machine.inches();
    let units = number(block, letter).and_then(|number| number.fixed(Length::DECIMALS, inches));
    Ok(Some(Length(units.ok_or(Status::OutOfRange)?)))
}

/// M420. A plane is followed at any height, so the word Z (a fade height in other firmware) is not read.
#[inline(never)]
#[small]
fn switch(at: u8, follows: Option<i32>, machine: &mut impl Machine) -> Next {
    if at == ENDS {
        return Ok(Step::Done);
    }
    let Some(follows) = follows else { return Ok(Step::At(TELLS)) };
    if follows != 0 && !bed(machine)?.is_known() {
        return Err(Trouble::NoPlane);
    }
    follow(follows != 0, ENDS, machine)
}

/// G29 with S: lists the points, adds one, or forgets them.
#[inline(never)]
#[small]
fn change(at: u8, what: i32, block: &[u8], machine: &mut impl Machine) -> Next {
    match (what, at) {
        (0, _) => return Ok(Step::At(TELLS)),
        (_, ENDS) => return Ok(Step::Done),
        (1, BEGINS) => {
            let point = point(block, machine)?;
            // Tried on a copy first: a refused point must change nothing.
            let mut trial = *bed(machine)?;
            trial.add(point)?;
            return follow(false, CHANGES, machine);
        }
        (5, BEGINS) => return follow(false, CHANGES, machine),
        (1, _) => {
            let point = point(block, machine)?;
            bed(machine)?.add(point)?;
        }
        (5, _) => bed(machine)?.forget(),
        _ => return Err(Status::OutOfRange.into()),
    }
    let known = bed(machine)?.is_known();
    follow(known, ENDS, machine)
}

/// Returns the point of G29 S1: the position of the nozzle, with the named coordinates replaced.
#[inline(never)]
#[small]
fn point(block: &[u8], machine: &mut impl Machine) -> Result<Point, Trouble> {
    let [x, y, mut z] = here(machine);
    if let Some(bed) = machine.settings().followed_bed() {
        z = bed.lifted_z(x, y, z);
    }
    let mut point = [x, y, z];
    for (place, letter) in point.iter_mut().zip(*b"XYZ") {
        *place = word(block, letter, machine)?.unwrap_or(*place);
    }
    Ok(point)
}

/// G29 without S: probes three points.
#[inline(never)]
#[small]
fn level(at: u8, block: &[u8], machine: &mut impl Machine) -> Next {
    match at {
        BEGINS => {
            check(block, machine)?;
            return follow(false, CHANGES, machine);
        }
        CHANGES => bed(machine)?.forget(),
        ENDS => return Ok(Step::At(TELLS)),
        FOLLOWS => return follow(true, ENDS, machine),
        _ => {}
    }
    let [low, high] = heights(block, machine)?;
    let [x, y, z] = here(machine);
    let up = Level::Go([x, y, z.max(high)]);
    if at == CHANGES {
        return go(up, PROBES - 1, machine);
    }
    let (n, stage) = ((at - PROBES) / STAGES, (at - PROBES) % STAGES);
    let [over_x, over_y] = places(block, machine)?.get(usize::from(n)).copied().unwrap_or_default();
    match stage {
        0 if z >= high => go(Level::Go([over_x, over_y, high]), at, machine),
        1 if [x, y, z] == [over_x, over_y, high] => match probe(machine) {
            0 => go(Level::Probe([over_x, over_y, low]), at, machine),
            _ => Err(Trouble::Touches),
        },
        2 if machine.value(Value::ProbeState) == ProbeState::Touched as i32 => go(up, at, machine),
        3 if z >= high => {
            let touched = Length(machine.value(Value::Probed(2)));
            bed(machine)?.add([over_x, over_y, touched])?;
            Ok(Step::Later(at + 1))
        }
        // The move was interrupted.
        _ => Err(Status::Terminated.into()),
    }
}

/// Checks, before anything moves, whether three points can be probed.
#[inline(never)]
#[small]
fn check(block: &[u8], machine: &mut impl Machine) -> Result<(), Trouble> {
    for axis in 0..3 {
        if machine.value(Value::Homed(axis)) == 0 {
            return Err(Trouble::NotHomed);
        }
    }
    if probe(machine) < 0 {
        return Err(Trouble::NoProbe);
    }
    if machine.settings().latch_velocity(2) <= 0.0 {
        return Err(Status::HomingLatch.into());
    }
    heights(block, machine)?;
    let mut level = Bed::NONE;
    for [x, y] in places(block, machine)? {
        level.add([x, y, Length::ZERO])?;
    }
    // Two of the points may coincide.
    if level.is_known() { Ok(()) } else { Err(Fault::Line.into()) }
}

/// Returns 1 while the probe touches, 0 while it does not, -1 if there is no probe.
#[small]
fn probe(machine: &mut impl Machine) -> i32 {
    machine.value(Value::Input(inputs::PROBE as u8))
}

/// Returns the travel of an axis; `None` if it is not set.
#[inline(never)]
#[small]
fn travel(axis: usize, machine: &mut impl Machine) -> Option<[Length; 2]> {
    let settings = machine.settings();
    let (low, high) = (settings.travel_min(axis), settings.travel_max(axis));
    let is_set = low < high && low != TRAVEL_NONE;
    is_set.then_some([low, high])
}

/// Returns X and Y of the three points.
#[inline(never)]
#[small]
fn places(block: &[u8], machine: &mut impl Machine) -> Result<[[Length; 2]; POINTS], Trouble> {
    let [left, right] = edges(0, *b"LR", block, machine)?;
    let [front, back] = edges(1, *b"FB", block, machine)?;
    let middle = Length(left.0 / 2 + right.0 / 2);
    Ok([[left, front], [right, front], [middle, back]])
}

/// Returns the outermost positions of the points along an axis.
#[inline(never)]
#[small]
fn edges(
    axis: usize,
    letters: [u8; 2],
    block: &[u8],
    machine: &mut impl Machine,
) -> Result<[Length; 2], Trouble> {
    let travel = travel(axis, machine);
    let mut edges = [Length::ZERO; 2];
    for (n, (edge, letter)) in edges.iter_mut().zip(letters).enumerate() {
        *edge = match (word(block, letter, machine)?, travel) {
            (Some(at), Some([low, high])) if at < low || at > high => {
                return Err(Status::SoftLimit.into());
            }
            (Some(at), _) => at,
            (None, Some([low, high])) => {
                let margin = high.0 / MARGIN - low.0 / MARGIN;
                Length(if n == 0 { low.0 + margin } else { high.0 - margin })
            }
            (None, None) => return Err(Trouble::NoTravel),
        };
    }
    Ok(edges)
}

/// Returns the Z range of the search: the bed is between the two heights.
#[inline(never)]
#[small]
fn heights(block: &[u8], machine: &mut impl Machine) -> Result<[Length; 2], Trouble> {
    let height = word(block, b'Z', machine)?.unwrap_or(HEIGHT);
    if !HEIGHTS.contains(&height) {
        return Err(Status::OutOfRange.into());
    }
    let travel = travel(2, machine);
    let bottom = travel.map_or(Length::ZERO, |[low, _]| low);
    let high = bottom.saturating_add(height);
    if travel.is_some_and(|[_, top]| high > top) {
        return Err(Status::SoftLimit.into());
    }
    Ok([bottom.saturating_sub(height), high])
}

/// Returns the position of the machine.
#[inline(never)]
#[small]
fn here(machine: &mut impl Machine) -> Point {
    let mut point = [Length::ZERO; 3];
    for (axis, place) in point.iter_mut().enumerate() {
        *place = Length(machine.value(Value::MachinePosition(axis as u8)));
    }
    point
}

fn bed(machine: &mut impl Machine) -> Result<&mut Bed, Trouble> {
    machine.bed().ok_or(Trouble::Status(Status::NotBuiltIn))
}

/// Starts an operation. The part after `at` follows it.
#[inline(never)]
#[small]
fn go(what: Level, at: u8, machine: &mut impl Machine) -> Next {
    match machine.level(what) {
        Status::Ok => Ok(Step::Later(at + 1)),
        status => Err(status.into()),
    }
}

/// Makes moves follow the plane, or not. The part `then` follows.
#[small]
fn follow(follows: bool, then: u8, machine: &mut impl Machine) -> Next {
    go(Level::Follow(follows), then - 1, machine)
}

/// Writes part `at` of the list of points.
#[inline(never)]
#[small]
fn list(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Step {
    let Some(bed) = machine.bed() else { return Step::Done };
    if at == 0 {
        text(out, text!("Bed leveling status: "));
        text(out, if bed.follows() { text!("active (") } else { text!("not active (") });
        int(out, bed.points().len() as i32);
        text(out, text!(") positions registered\n"));
        return Step::At(TELLS + 1);
    }
    let Some(point) = bed.points().get(usize::from(at) - 1) else { return Step::Done };
    text(out, text!("  "));
    int(out, i32::from(at) - 1);
    text(out, text!(": G29 S1"));
    for (letter, place) in b"XYZ".iter().zip(point) {
        out.put(b' ');
        out.put(*letter);
        length(out, place.0);
    }
    line_end(out);
    Step::At(TELLS + at + 1)
}
