//! Pauses in jobs that demand much of exec, under several jerk limits and without a jerk limit.
//!
//! `examples/bracket.gcode` is too long for this table. `tests/sim/tests/jobs.rs` runs it, and fails on a pause too.

use anyhow::{Result, ensure};

use super::Figure;
use super::workload::{Bed, How, arcs, braid, pocket};

pub(super) const SPIRAL: &str = include_str!("../../../../examples/spiral.gcode");
pub(super) const SQUARE: &str = include_str!("../../../../examples/square.gcode");
const ENGRAVING: &str = include_str!("../../../../examples/engraving.gcode");

/// Counts the pauses without a jerk limit.
pub fn none(bed: &Bed) -> Result<Figure> {
    pauses(bed, None, &[])
}

/// Counts the pauses under a low jerk limit.
pub fn low(bed: &Bed) -> Result<Figure> {
    pauses(bed, Some(500.0), &[])
}

/// Counts the pauses under a usual jerk limit.
pub fn usual(bed: &Bed) -> Result<Figure> {
    pauses(bed, Some(5_000.0), &[("engraving", ENGRAVING)])
}

/// Counts the pauses under a high jerk limit.
pub fn high(bed: &Bed) -> Result<Figure> {
    pauses(bed, Some(50_000.0), &[])
}

/// The jobs that take seconds, not minutes.
pub(super) fn jobs() -> [(&'static str, String); 6] {
    [
        ("arcs", arcs()),
        ("braid of 0.33 mm", braid(0.33, 3_000.0)),
        ("braid of 0.1 mm", braid(0.1, 1_500.0)),
        ("pocket", pocket()),
        ("spiral", SPIRAL.to_string()),
        ("square", SQUARE.to_string()),
    ]
}

/// Counts the pauses of all jobs. The jobs of `long` run once, undisturbed. Each other job runs undisturbed and again
/// with holds and overrides.
fn pauses(bed: &Bed, jerk: Option<f64>, long: &[(&str, &str)]) -> Result<Figure> {
    let (mut sum, mut worst, mut seed) = (0, String::from("none"), 0);
    let mut most = 0;
    let long = long.iter().map(|(name, job)| (*name, job.to_string(), false));
    let jobs =
        jobs().into_iter().flat_map(|(name, job)| [(name, job.clone(), false), (name, job, true)]);
    for (name, job, disturbed) in jobs.chain(long) {
        seed += 1;
        let how = How { jerk, disturbed: disturbed.then_some(seed), ..How::default() };
        let (_, report) = bed.try_run(&job, how, Vec::new())?;
        ensure!(report.is_exact(), "{name}: {}", report.problems.join("; "));
        sum += report.dry();
        if report.dry() > most {
            most = report.dry();
            let how = if disturbed { " with holds and overrides" } else { "" };
            worst = format!("{name}{how}: {}", report.problems.join("; "));
        }
    }
    Ok(Figure { value: sum as f64, note: worst })
}
