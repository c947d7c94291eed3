//! The highest step rate that is held: the mean cruise rate of every motor is within 1 % of the command, and the end
//! is exact to the step.

use anyhow::Result;

use super::Figure;
use super::workload::{ACCELERATION, Bed, How, PER_MM, PER_MM_Z, USUAL_JERK};
use crate::machine::Machine;

/// Relative tolerance of the mean rate.
const WITHIN: f64 = 0.01;
/// Time of cruise in a move, and the part of the cruise that counts, s.
const CRUISE_S: f64 = 0.5;
const COUNTED_S: f64 = 0.3;
/// The rate that is tried first, the factor from one rate to the next, and the rate at which the search ends.
const FIRST: f64 = 20_000.0;
const UP: f64 = 1.15;
const LAST: f64 = 300_000.0;
/// Number of bisections between a rate that is held and one that is not.
const REFINEMENTS: u32 = 5;

/// One motor.
pub fn one(bed: &Bed) -> Result<Figure> {
    highest(bed, 1)
}

/// Three motors at once.
pub fn three(bed: &Bed) -> Result<Figure> {
    highest(bed, 3)
}

/// Four motors at once.
pub fn four(bed: &Bed) -> Result<Figure> {
    highest(bed, 4)
}

/// One motor under a jerk limit.
pub fn one_jerk(bed: &Bed) -> Result<Figure> {
    highest_jerk(bed, 1, 80_000.0)
}

/// Three motors under a jerk limit.
pub fn three_jerk(bed: &Bed) -> Result<Figure> {
    highest_jerk(bed, 3, 53_000.0)
}

/// Four motors under a jerk limit.
pub fn four_jerk(bed: &Bed) -> Result<Figure> {
    highest_jerk(bed, 4, 40_000.0)
}

fn highest(bed: &Bed, motors: usize) -> Result<Figure> {
    search(FIRST, REFINEMENTS, |rate| held_at(bed, motors, rate, None))
}

/// Searches from `first`, near the expected rate, because moves under a jerk limit take longer to simulate.
fn highest_jerk(bed: &Bed, motors: usize, first: f64) -> Result<Figure> {
    search(first, REFINEMENTS - 1, |rate| held_at(bed, motors, rate, Some(USUAL_JERK)))
}

/// Searches the highest rate that is held, upwards from `first`.
fn search(
    first: f64,
    refinements: u32,
    held_at: impl Fn(f64) -> Result<Option<f64>>,
) -> Result<Figure> {
    let (mut good, mut bad, mut held) = (0.0, first, 0.0);
    while bad < LAST {
        let Some(rate) = held_at(bad)? else { break };
        (good, held, bad) = (bad, rate, bad * UP);
    }
    for _ in 0..refinements {
        let middle = f64::midpoint(good, bad);
        match held_at(middle)? {
            Some(rate) => (good, held) = (middle, rate),
            None => bad = middle,
        }
    }
    Ok(held.round().into())
}

/// Returns the lowest mean rate of the motors in a move at `rate`; `None` if the rate is not held.
fn held_at(bed: &Bed, motors: usize, rate: f64, jerk: Option<f64>) -> Result<Option<f64>> {
    let how = How { log: true, jerk, ..How::default() };
    // Under a jerk limit the acceleration along the path is that of the slowest axis, and builds up.
    let times = if jerk.is_some() { 1.6 } else { 1.0 };
    let (machine, report) = bed.try_run(&move_of(motors, rate, times), how, Vec::new())?;
    if !report.ok {
        return Ok(None);
    }
    let means: Vec<f64> = (0..motors).map(|m| mean_rate(&machine, m as u8)).collect();
    let held = means.iter().all(|mean| (mean / rate - 1.0).abs() <= WITHIN);
    Ok(held.then(|| means.into_iter().fold(f64::MAX, f64::min).min(rate)))
}

/// A move of this many motors, all at `rate` steps/s, long enough for a cruise at [`ACCELERATION`].
pub fn long_move(motors: usize, rate: f64) -> String {
    move_of(motors, rate, 1.0)
}

/// As [`long_move`], with ramps `times` as long.
fn move_of(motors: usize, rate: f64, times: f64) -> String {
    let velocity = rate / PER_MM;
    // The slowest axis limits the acceleration along the path.
    let mm = (times * velocity * velocity / ACCELERATION + CRUISE_S * velocity).round();
    let z = mm * PER_MM / PER_MM_Z;
    let path = [mm, mm.hypot(mm), (2.0 * mm * mm + z * z).sqrt()];
    // The feed of a move that has linear axes does not include its rotary axes.
    let feed = velocity * 60.0 * path[motors.min(3) - 1] / mm;
    let words = [format!("X{mm}"), format!("Y{mm}"), format!("Z{z}"), format!("A{mm}")];
    format!("G1 {} F{feed:.3}\n", words[..motors].join(" "))
}

/// Returns the mean step rate of a motor in the middle of its move.
pub fn mean_rate(machine: &Machine, motor: u8) -> f64 {
    let steps = machine.recorder().steps_of(motor);
    let (Some(first), Some(last)) = (steps.first(), steps.last()) else { return 0.0 };
    let middle = first.midpoint(*last);
    let half = (COUNTED_S / 2.0 * f64::from(machine.board().clock_hz)) as u64;
    let cruise = steps.iter().filter(|s| s.abs_diff(middle) <= half);
    let (count, least, most) = cruise
        .fold((0u32, u64::MAX, 0), |(n, least, most), s| (n + 1, least.min(*s), most.max(*s)));
    if count < 2 { 0.0 } else { f64::from(count - 1) / machine.seconds(most - least) }
}
