//! Pauses in jobs that ask much of exec, under several jerk limits and without one.
//!
//! `examples/bracket.gcode` is too long for this; `tests/sim/tests/jobs.rs` runs it, and fails on a pause too.

use anyhow::{Result, ensure};

use super::Figure;
use super::workload::{Bed, How, arcs, braid, pocket};

const SPIRAL: &str = include_str!("../../../../examples/spiral.gcode");
const SQUARE: &str = include_str!("../../../../examples/square.gcode");
const ENGRAVING: &str = include_str!("../../../../examples/engraving.gcode");

/// Without a jerk limit.
pub fn none(bed: &Bed) -> Result<Figure> {
    pauses(bed, None, &[])
}

/// With little jerk.
pub fn low(bed: &Bed) -> Result<Figure> {
    pauses(bed, Some(500.0), &[])
}

/// With a usual jerk limit.
pub fn usual(bed: &Bed) -> Result<Figure> {
    pauses(bed, Some(5_000.0), &[("engraving", ENGRAVING)])
}

/// With much jerk.
pub fn high(bed: &Bed) -> Result<Figure> {
    pauses(bed, Some(50_000.0), &[])
}

/// The jobs that take seconds.
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

/// The pauses of all jobs, those of `long` left alone, the others with holds and overrides too.
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
