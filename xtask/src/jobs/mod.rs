//! Writes the example jobs. They are computed, so that the text is the same every time.

mod bracket;
#[cfg(test)]
mod dry_run;
mod engraving;
mod print;
mod program;
mod spiral;
mod square;

use std::path::PathBuf;

use anyhow::{Context, Result};

use crate::process::root;

/// An example: the name of its file, and the function that returns its text.
type Job = (&'static str, fn() -> String);

const JOBS: [Job; 5] = [
    ("square.gcode", square::job),
    ("bracket.gcode", bracket::job),
    ("spiral.gcode", spiral::job),
    ("engraving.gcode", engraving::job),
    (PRINT, print::job),
];

/// The example for a printer.
const PRINT: &str = "print.gcode";

fn path(name: &str) -> PathBuf {
    root().join("examples").join(name)
}

/// `cargo xtask jobs`: writes all examples.
pub fn write() -> Result<()> {
    for (name, job) in JOBS {
        let path = path(name);
        std::fs::write(&path, job()).with_context(|| format!("cannot write {}", path.display()))?;
        println!("{}", path.display());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::dry_run::{DryRun, dry_run};
    use super::*;

    fn within(range: (f64, f64), low: f64, high: f64) -> bool {
        low <= range.0 && range.1 <= high
    }

    #[test]
    fn every_job_stays_on_the_machine() {
        for (name, job) in JOBS.into_iter().filter(|(name, _)| *name != PRINT) {
            let DryRun { x, y, z, radius_error, .. } = dry_run(&job());
            assert!(within(x, 0.0, 150.0) && within(y, 0.0, 150.0), "{name}: {x:?} {y:?}");
            assert!(within(z, -10.0, 20.0), "{name}: {z:?}");
            assert!(radius_error < 0.001, "{name}: an arc's ends are {radius_error} mm apart");
        }
    }

    #[test]
    fn the_bracket_is_long_in_lines_and_short_in_time() {
        let run = dry_run(&bracket::job());
        assert!(run.lines >= 500, "{} lines", run.lines);
        assert!(run.arcs >= 150, "{} arcs", run.arcs);
        assert!((300.0..=800.0).contains(&run.feed.0) && run.feed.1 <= 800.0, "{:?}", run.feed);
        // The time without ramps. With ramps it must still be under six minutes.
        assert!((120.0..300.0).contains(&run.seconds), "{} s", run.seconds);
    }

    #[test]
    fn the_engraving_is_slow() {
        let run = dry_run(&engraving::job());
        assert!(run.lines > 200 && run.feed == (1.0, 120.0), "{} {:?}", run.lines, run.feed);
    }

    #[test]
    fn examples_are_up_to_date() {
        for (name, job) in JOBS {
            let file = std::fs::read_to_string(path(name)).unwrap_or_default();
            assert!(file == job(), "examples/{name} is stale: run `cargo xtask jobs`");
        }
    }
}
