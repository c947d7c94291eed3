//! Soft limits: checks that a move stays within the travel of the homed axes, and that its steps can be counted
//! ([`Setup::reach`]).
//!
//! Each move is checked before it is planned. Positions are machine coordinates. Soft limits are checked only for the
//! axes that a line moves, so that an axis beyond its travel does not block the others. Cost on AVR: 200 cycles for
//! each axis that moves; an arc 25,000 more.

use kerf_macros::small;

use super::arc::{norm, part, spoke, turned};
use super::command::{Arc, Cycle, Motion};
use super::setup::Setup;
use super::threading::ThreadCycle;
use crate::capability::Capability;
use crate::math::round;
use crate::status::Status;
use crate::units::{Length, PerAxis};

/// An arc may exceed a limit by 1 um plus the part [`SLACK_PART`] of its radius. That is the precision of a float.
const SLACK: f32 = 10.0;
const SLACK_PART: f32 = 2e-7;
/// The least and the greatest coordinate of a point of an arc: 1 um inside the range of a length.
const RANGE: (Length, Length) = (Length(10 - i32::MAX), Length(i32::MAX - 10));

/// Refuses (220) a move from `start` that leaves the travel of an axis whose bit in `homed` is set.
#[inline(never)]
#[small]
pub(super) fn check(
    start: &PerAxis<Length>,
    motion: &Motion,
    homed: u8,
    setup: &impl Setup,
) -> Result<(), Status> {
    check_within(start, motion, &Limits { homed: Some(homed), setup })
}

/// Refuses (110) a move that begins at, ends at or passes through a place where steps cannot be counted. Axes that do
/// not move are checked as well, because G28.3 sets their position without a move.
#[inline(never)]
#[small]
pub(super) fn check_reach(
    start: &PerAxis<Length>,
    end: &PerAxis<Length>,
    motion: &Motion,
    setup: &impl Setup,
) -> Result<(), Status> {
    if setup.reach().is_none() {
        return Ok(());
    }
    let from = match motion {
        Motion::None | Motion::Home { .. } | Motion::Check | Motion::Heat(_) => return Ok(()),
        #[cfg(feature = "bed-plane")]
        Motion::FollowBed(_) => return Ok(()),
        Motion::SetPosition { .. } => end,
        _ => start,
    };
    let near = is_near(from, setup)
        && is_near(end, setup)
        && check_within(start, motion, &Limits { homed: None, setup }).is_ok();
    if near { Ok(()) } else { Err(Status::OutOfRange) }
}

/// Whether steps can be counted at a place.
#[inline(never)]
#[small]
pub fn is_near(place: &PerAxis<Length>, setup: &impl Setup) -> bool {
    let Some(most) = setup.reach() else { return true };
    for at in place {
        if at.0.saturating_abs() > most.0 {
            return false;
        }
    }
    true
}

/// The limits that a move is checked against.
struct Limits<'a, S> {
    /// `Some`: the travel of these axes, as bits. `None`: how far steps can be counted.
    homed: Option<u8>,
    setup: &'a S,
}

impl<S: Setup> Limits<'_, S> {
    /// Returns the limits of an axis. `None` if it has none.
    #[inline(never)]
    #[small]
    fn of(&self, axis: u8) -> Option<(Length, Length)> {
        match self.homed {
            None => self.setup.reach().map(|most| (Length(-most.0), most)),
            Some(homed) if homed & 1 << axis != 0 => self.setup.travel(axis),
            Some(_) => None,
        }
    }
}

#[inline(never)]
#[small]
fn check_within(
    start: &PerAxis<Length>,
    motion: &Motion,
    limits: &Limits<'_, impl Setup>,
) -> Result<(), Status> {
    let target = match motion {
        Motion::None
        | Motion::Home { .. }
        | Motion::Check
        | Motion::Heat(_)
        | Motion::SetPosition { .. } => return Ok(()),
        #[cfg(feature = "bed-plane")]
        Motion::FollowBed(_) => return Ok(()),
        Motion::Cycle(_) if !Capability::Cycles.is_built_in() => return Ok(()),
        Motion::Cycle(cycle) => return check_cycle(start, cycle, limits),
        Motion::ThreadCycle(_) if !Capability::Lathe.is_built_in() => return Ok(()),
        Motion::ThreadCycle(cycle) => return check_threads(start, cycle, limits),
        Motion::Through { via, target } => {
            check_straight(start, via, limits)?;
            return check_straight(via, target, limits);
        }
        Motion::Traverse { target }
        | Motion::Jog { target }
        | Motion::Feed { target, .. }
        | Motion::Thread { target, .. }
        | Motion::Probe { target, .. } => target,
        Motion::Arc { target, arc, .. } => {
            check_arc(start, target, arc, limits)?;
            target
        }
    };
    check_straight(start, target, limits)
}

// Inlined, because the deepest stack is reached in the functions below this one.
#[inline(always)]
#[small]
fn check_arc(
    start: &PerAxis<Length>,
    target: &PerAxis<Length>,
    arc: &Arc,
    limits: &Limits<'_, impl Setup>,
) -> Result<(), Status> {
    let limits = [limits.of(arc.first), limits.of(arc.second)];
    if arc_is_within(start, target, arc, Some(&limits)) { Ok(()) } else { Err(Status::SoftLimit) }
}

#[inline(never)]
#[small]
fn check_straight(
    start: &PerAxis<Length>,
    target: &PerAxis<Length>,
    limits: &Limits<'_, impl Setup>,
) -> Result<(), Status> {
    for (axis, (from, to)) in (0..).zip(start.iter().zip(target)) {
        if from != to
            && let Some((low, high)) = limits.of(axis)
            && !(low..=high).contains(to)
        {
            return Err(Status::SoftLimit);
        }
    }
    Ok(())
}

/// Checks the first and the last pass. All others lie between them.
#[inline(never)]
#[small]
fn check_threads(
    start: &PerAxis<Length>,
    cycle: &ThreadCycle,
    limits: &Limits<'_, impl Setup>,
) -> Result<(), Status> {
    let mut target = *start;
    for pass in [1, cycle.passes] {
        for x in [cycle.bottom(pass), cycle.outside(pass)] {
            [target[0], target[2]] = [x, cycle.end];
            check_straight(start, &target, limits)?;
        }
    }
    Ok(())
}

/// Checks the first and the last hole and the places beside them, and the highest and the lowest point of the cycle.
#[inline(never)]
#[small]
fn check_cycle(
    start: &PerAxis<Length>,
    cycle: &Cycle,
    limits: &Limits<'_, impl Setup>,
) -> Result<(), Status> {
    let [first, second, across] = cycle.plane.axes();
    let inside = |axis: u8, at: Length| {
        let here = start.get(usize::from(axis)).is_some_and(|start| *start == at);
        here || limits.of(axis).is_none_or(|(low, high)| (low..=high).contains(&at))
    };
    let mut all = [cycle.retract, cycle.bottom, cycle.clear].iter().all(|at| inside(across, *at));
    for number in [1, cycle.holes] {
        let hole = cycle.hole(number).ok_or(Status::OutOfRange)?;
        for ((axis, at), aside) in [first, second].into_iter().zip(hole).zip(cycle.aside()) {
            let beside = at.units.checked_add(aside).ok_or(Status::OutOfRange)?;
            all = all && inside(axis, at.units) && inside(axis, beside);
        }
    }
    if all { Ok(()) } else { Err(Status::SoftLimit) }
}

/// Whether the outermost points of an arc in its plane are within the limits of its first and second axis (`both`), or
/// within [`RANGE`] if `both` is `None`. The end of the arc is not checked here. The linear axis of a helix needs no
/// check either: it advances evenly, so the end is its farthest point.
#[inline(never)]
#[small]
pub(super) fn arc_is_within(
    start: &PerAxis<Length>,
    target: &PerAxis<Length>,
    arc: &Arc,
    both: Option<&[Option<(Length, Length)>; 2]>,
) -> bool {
    if both.is_some_and(|both| both.iter().all(Option::is_none)) {
        return true;
    }
    let (from, to) = (spoke(start, arc), spoke(target, arc));
    let radius = norm(from).max(norm(to));
    let part = part(start, target, arc) + f32::from(arc.extra_turns);
    let slack = SLACK + SLACK_PART * radius;
    let passes = |out: [f32; 2]| part >= 1.0 || turned(from, out, arc.clockwise) < part;
    for (i, center) in arc.center.into_iter().enumerate() {
        let limits = both.map_or(Some(RANGE), |both| both.get(i).copied().flatten());
        let Some((low, high)) = limits else { continue };
        let mut out = [0.0; 2];
        for (out_here, within) in [
            (radius, center.saturating_add(Length(round(radius - slack))) <= high),
            (-radius, center.saturating_add(Length(round(slack - radius))) >= low),
        ] {
            if let Some(component) = out.get_mut(i) {
                *component = out_here;
            }
            if !within && passes(out) {
                return false;
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode::arc::Chords;
    use crate::gcode::command::Commands;
    use crate::gcode::interpreter::Interpreter;
    use crate::gcode::setup::AxisMode;
    use crate::units::AXES;
    use core::f32::consts::PI;
    use proptest::prelude::*;
    use std::format;

    /// A machine with X, Y and Z from 0 to 100 mm, and A from -10 degrees without an upper end.
    struct Cube;

    impl Setup for Cube {
        fn mode(&self, _axis: u8) -> AxisMode {
            AxisMode::Standard
        }
        fn radius(&self, _axis: u8) -> u32 {
            1
        }
        fn travel(&self, axis: u8) -> Option<(Length, Length)> {
            match axis {
                0..3 => Some((Length(0), Length(1_000_000))),
                3 => Some((Length(-100_000), Length(i32::MAX))),
                _ => None,
            }
        }
    }

    fn run(lines: &[&str]) -> Result<(), Status> {
        let (mut state, mut out) = (Interpreter::new(), Commands::default());
        let home = ["G28.3 X50 Y50 Z50 A0"];
        for line in home.iter().chain(lines) {
            state.interpret(line.as_bytes(), &Cube, &mut out)?;
        }
        Ok(())
    }

    #[test]
    fn straight_moves() {
        for line in ["G0 X0 Y100", "G1 F1 Z100 A-10", "G0 A200000 B-5", "G91 G0 X-50", "G92 X0 G90"]
        {
            assert_eq!(run(&[line]), Ok(()), "{line}");
        }
        for line in ["G0 X-0.0001", "G0 Y100.0001", "G1 F1 Z101", "G0 A-10.1", "G20 G0 X4"] {
            assert_eq!(run(&[line]), Err(Status::SoftLimit), "{line}");
        }
        assert_eq!(run(&["G92 X0", "G0 X51"]), Err(Status::SoftLimit), "machine coordinates count");
        assert_eq!(run(&["G92 X0", "G0 X50"]), Ok(()));
    }

    #[test]
    fn cycles_and_ways_home() {
        for line in [
            "G81 X10 Y10 R60 Z0 F9",
            "G91 G81 X10 R1 Z-2 L5 F9",
            "M3 G87 X1 Y1 I-1 J2 Z0 R60 K5 F9",
            "G28 X100",
            "G38.2 X0 F9",
        ] {
            assert_eq!(run(&[line]), Ok(()), "{line}");
        }
        for line in [
            "G81 X10 Y10 R60 Z-0.1 F9",
            "G81 X10 Y10 R101 Z0 F9",
            "G91 G81 X10 R1 Z-2 L6 F9",
            "M3 G87 X1 Y1 I-1.1 J2 Z0 R60 K5 F9",
            "G28 X101",
            "G38.2 X-1 F9",
        ] {
            assert_eq!(run(&[line]), Err(Status::SoftLimit), "{line}");
        }
    }

    #[test]
    fn only_what_moves_counts_and_the_way_back_is_free() {
        let outside = "G28.3 X150";
        assert_eq!(run(&[outside, "G0 Y60"]), Ok(()));
        assert_eq!(run(&[outside, "G0 X150"]), Ok(()));
        assert_eq!(run(&[outside, "G0 X100"]), Ok(()));
        assert_eq!(run(&[outside, "G0 X149"]), Err(Status::SoftLimit));
    }

    #[test]
    fn axes_that_are_not_homed_are_free() {
        let (mut state, mut out) = (Interpreter::new(), Commands::default());
        for line in ["G0 X-5", "G28.3 Y0", "X-6", "Y50", "G2 I-50 F1"] {
            assert_eq!(state.interpret(line.as_bytes(), &Cube, &mut out).err(), None, "{line}");
        }
        assert_eq!(state.interpret(b"G0 Y-5", &Cube, &mut out), Err(Status::SoftLimit));
    }

    #[test]
    fn arcs_over_all_of_their_way() {
        // These arcs touch the limits at most.
        for line in [
            "G2 I25",
            "G3 I-25",
            "G2 J25 P3",
            "G3 X100 Y50 I25",
            "G2 I15 J20",
            "G18 G2 K25",
            "G19 G3 J-25",
            "G2 X60 R5 Z100",
            "G3 X60 Y60 I10",
        ] {
            assert_eq!(run(&[&format!("{line} F100")]), Ok(()), "{line}");
        }
        for line in [
            "G2 I25.01",
            "G2 J-25.01",
            "G3 X0.0001 Y50 R-25.5",
            "G18 G2 K25.01",
            "G19 G3 J-25.01",
            "G2 X60 R5 Z101",
            "G2 I20 A-11",
        ] {
            assert_eq!(run(&[&format!("{line} F100")]), Err(Status::SoftLimit), "{line}");
        }
        // Both arcs begin and end on the limit X0. G3 bulges to the inside, G2 to the outside.
        assert_eq!(run(&["G0 X0 Y20", "G3 X0 Y40 R10 F9"]), Ok(()));
        assert_eq!(run(&["G0 X0 Y20", "G2 X0 Y40 R10 F9"]), Err(Status::SoftLimit));
    }

    proptest! {
        #[test]
        fn agrees_with_the_chords(
            x in 0.0f32..100.0, y in 0.0f32..100.0, radius in 1.0f32..80.0, at in -PI..PI,
            sweep in 0.05f32..6.2, clockwise: bool, plane in 0u8..3,
        ) {
            let (first, second) = (plane, (plane + 1) % 3);
            let units = |mm: f32| Length((mm * 1e4) as i32);
            let point = |a: f32| {
                let mut point = [units(50.0); AXES];
                point[usize::from(first)] = units(x + radius * a.cos());
                point[usize::from(second)] = units(y + radius * a.sin());
                point
            };
            let end = if clockwise { at - sweep } else { at + sweep };
            let (start, target) = (point(at), point(end));
            let linear = 3 - first - second;
            let center = [units(x), units(y)];
            let arc = Arc { first, second, linear, center, clockwise, extra_turns: 0 };
            let motion = Motion::Arc {
                target, arc, feed: crate::gcode::command::Feed::PerMinute(1.0),
            };
            let refused = check(&start, &motion, 0b1111, &Cube).is_err();
            let beyond = |point: &PerAxis<Length>, margin: i32| {
                [first, second].iter().any(|axis| {
                    let at = point[usize::from(*axis)].0;
                    at < -margin || at > 1_000_000 + margin
                })
            };
            // A move that starts outside may come back.
            if beyond(&start, -50) {
                return Ok(());
            }
            let farthest = |margin: i32| {
                Chords::new(&start, &target, &arc, 0.0002).any(|point| beyond(&point, margin))
            };
            if farthest(50) {
                prop_assert!(refused);
            }
            if !farthest(-50) {
                prop_assert!(!refused);
            }
        }
    }
}
