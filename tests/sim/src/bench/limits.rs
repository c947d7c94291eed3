//! Motion compared with its limits: single moves, holds, and the acceleration of axes on arcs.

use anyhow::{Context, Result, ensure};

use super::Figure;
use super::optimum::rest_to_rest;
use super::spirals::spiral;
use super::workload::{
    ACCELERATION, Bed, FAST_BAUD, How, PER_JERK, PER_MM, USUAL_JERK, small_arcs,
};
use crate::host::{Host, LINES_IN_FLIGHT};
use crate::kinetics::{self, WINDOW_S, Windows};
use crate::machine::Machine;
use crate::track::{self, Position, SAMPLE_S};

/// Feed of lone moves, mm/min: higher than the moves can reach.
const FEED: f64 = 30_000.0;
/// Velocity at which a hold begins, mm/s.
const HELD: f64 = 50.0;
/// Number of holds, each at another phase of a segment.
const PHASES: u64 = 8;
/// Four times finer steps, which show the acceleration of X and Y well enough.
const FINE: [&str; 2] = ["{1:{tr:5}}", "{2:{tr:5}}"];

/// Time of a lone move of 0.1 mm, over the shortest time within the limits.
pub fn lone_tenth(bed: &Bed) -> Result<Figure> {
    lone(bed, 0.1)
}

/// Time of a lone move of 1 mm, over the shortest time within the limits.
pub fn lone_one(bed: &Bed) -> Result<Figure> {
    lone(bed, 1.0)
}

/// Time of a lone move of 10 mm, over the shortest time within the limits.
pub fn lone_ten(bed: &Bed) -> Result<Figure> {
    lone(bed, 10.0)
}

/// Time of a lone move of 100 mm, over the shortest time within the limits.
pub fn lone_hundred(bed: &Bed) -> Result<Figure> {
    lone(bed, 100.0)
}

/// Takes the time of the move from the step timer, which runs from standstill to standstill.
fn lone(bed: &Bed, mm: f64) -> Result<Figure> {
    let how = How { log: true, jerk: Some(USUAL_JERK), ..How::default() };
    let (machine, _) = bed.run(&format!("G1 X{mm} F{FEED}\n"), how)?;
    let runs = machine.recorder().timer_runs();
    let (first, last) = runs.first().zip(runs.last()).context("nothing has moved")?;
    let seconds = machine.seconds(last.1 - first.0);
    let best = rest_to_rest(mm, FEED / 60.0, ACCELERATION, USUAL_JERK * PER_JERK);
    Ok(Figure { value: seconds / best, note: format!("{:.1} ms", seconds * 1e3) })
}

/// Time from `!` to the first step of a slower segment, ms; the longest of all holds.
pub fn hold_begins(bed: &Bed) -> Result<Figure> {
    let all = holds(bed)?;
    let value = all.iter().map(|h| h.begins).fold(0.0, f64::max) * 1e3;
    let note = all.iter().map(|h| format!("{:.2}", h.begins * 1e3)).collect::<Vec<_>>().join(", ");
    Ok(Figure { value, note })
}

/// Time from the first step of a slower segment to the standstill, over the shortest time within the limits; the
/// longest of all holds.
pub fn hold_stops(bed: &Bed) -> Result<Figure> {
    let all = holds(bed)?;
    let seconds = all.iter().map(|h| h.stops).fold(0.0, f64::max);
    // Two ramps: from a standstill to `HELD` and back to a standstill without a cruise.
    let jerk = USUAL_JERK * PER_JERK;
    let ramp = HELD / ACCELERATION + ACCELERATION / jerk;
    Ok(Figure { value: seconds / ramp, note: format!("{:.1} ms", seconds * 1e3) })
}

/// The two times of a hold, s.
struct Hold {
    begins: f64,
    stops: f64,
}

fn holds(bed: &Bed) -> Result<Vec<Hold>> {
    (0..PHASES).map(|phase| hold(bed, 800_000 + phase * 5_137)).collect()
}

/// Sends a long move, and `!` so many us later.
fn hold(bed: &Bed, us: u64) -> Result<Hold> {
    let mut machine = bed.machine()?;
    let mut host = Host::new(LINES_IN_FLIGHT);
    host.boot(&mut machine, 1_000)?;
    let how = How { jerk: Some(USUAL_JERK), ..How::default() };
    for line in bed.settings(how) {
        ensure!(host.ask(&mut machine, &line, 1_000)?.status == 0, "{line} is refused");
    }
    machine.recorder_mut().keep_log();
    host.ask(&mut machine, &format!("G1 X200 F{}", HELD * 60.0), 1_000)?;
    let held_at = machine.cycle() + us * machine.cycles(1) / 1_000;
    host.run_until(&mut machine, held_at)?;
    machine.send_now(b'!');
    let said = machine.cycle();
    host.run_for_ms(&mut machine, 500)?;
    let slower = first_slower(&machine, said).context("it does not slow down")?;
    let rest = machine.recorder().timer_runs().last().map_or(u64::MAX, |run| run.1);
    ensure!(rest < machine.cycle(), "it does not come to rest");
    Ok(Hold { begins: machine.seconds(slower - said), stops: machine.seconds(rest - slower) })
}

/// Returns the cycle at which the velocity begins to fall. Under a jerk limit the velocity falls for some
/// milliseconds by less than pulses can show. So the function looks for the step that is `BEHIND` step intervals
/// late, and goes back by the time that a ramp under the limit takes to fall that far behind the old velocity.
fn first_slower(machine: &Machine, said: u64) -> Option<u64> {
    const BEHIND: u64 = 2;
    let steps = machine.recorder().steps_of(0);
    let steady = steps.partition_point(|s| *s < said - machine.cycles(20));
    let told = steps.partition_point(|s| *s < said);
    let (first, last) = (*steps.get(steady)?, *steps.get(told.checked_sub(1)?)?);
    let interval = (last - first) / (told - 1 - steady) as u64;
    let due = |n: usize| last + (n as u64 + 1 + BEHIND) * interval;
    let behind = steps[told..].iter().enumerate().find(|(n, step)| **step >= due(*n))?.1;
    let ramp = (6.0 * BEHIND as f64 / PER_MM / (USUAL_JERK * PER_JERK)).cbrt();
    Some(behind - (ramp * f64::from(machine.board().clock_hz)) as u64)
}

/// Acceleration of X and Y on arcs: the 99th percentile, over the limit.
pub fn arcs_acceleration(bed: &Bed) -> Result<Figure> {
    let how = How { log: true, more: &FINE, ..How::default() };
    let (machine, report) = bed.run(&small_arcs(), how)?;
    let positions = track::positions(&track::steps(&machine), &report.setup);
    let windows = Windows::new(SAMPLE_S, WINDOW_S);
    let of = |axis: usize| kinetics::curves(&positions, axis, &windows).acceleration;
    let mut all: Vec<f64> = (0..2).flat_map(of).map(f64::abs).collect();
    all.sort_by(f64::total_cmp);
    let percentile = all.get(all.len() * 99 / 100).context("nothing has moved")?;
    let note = format!("most {:.0} mm/s2", all[all.len() - 1]);
    Ok(Figure { value: percentile / ACCELERATION, note })
}

/// Change of velocity from one slice of 4 ms to the next on a spiral of moves of 0.1 mm: the 99th percentile, mm/s. A
/// change of 2 mm/s is within the acceleration limit.
pub fn velocity_jumps(bed: &Bed) -> Result<Figure> {
    const SLICE_MS: usize = 4;
    /// The first and the last part of the job are left out, so that both motors move all the time.
    const LEFT_OUT_MS: usize = 100;
    let how = How { log: true, more: &FINE, baud: FAST_BAUD, ..How::default() };
    let (machine, report) = bed.run(&spiral(0.1), how)?;
    let positions = track::positions(&track::steps(&machine), &report.setup);
    let to = positions.len().saturating_sub(LEFT_OUT_MS);
    let middle = positions.get(LEFT_OUT_MS..to).context("it is too short")?;
    let places: Vec<_> = middle.iter().step_by(SLICE_MS).collect();
    let way = |w: &[&Position]| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1]);
    let velocities: Vec<f64> =
        places.windows(2).map(|w| way(w) / (SLICE_MS as f64 * SAMPLE_S)).collect();
    let mut jumps: Vec<f64> = velocities.windows(2).map(|v| (v[1] - v[0]).abs()).collect();
    jumps.sort_by(f64::total_cmp);
    let value = *jumps.get(jumps.len() * 99 / 100).context("it is too short")?;
    Ok(Figure { value, note: format!("most {:.1} mm/s", jumps[jumps.len() - 1]) })
}
