//! Files as the posts of CAM programs write them, on the simulated board; and what a dry run says of them beforehand.

#[path = "../../../src/cli/check.rs"]
mod check;
mod common;

use std::fs;
use std::path::{Path, PathBuf};

use check::Question;
use common::firmware;
use kerf::boards::MEGA2560_GRBL;
use kerf_sim::job::{self, Options};
use kerf_sim::report::Report;

/// The profile of a router, and a machine that has been homed: G28 is refused before.
const ROUTER: [&str; 2] = ["{mch:1}", "{gc:\"g28.3x0y0z0\"}"];

fn run(path: &Path) -> Report {
    let mut machine = firmware(&MEGA2560_GRBL);
    let lines = job::read_lines(path).unwrap();
    let options = Options { settings: ROUTER.map(String::from).to_vec(), ..Options::default() };
    job::run(&mut machine, &lines, &options, |_| {}).unwrap()
}

/// Seconds that a dry run says.
fn estimate(path: &Path) -> f64 {
    let text = fs::read_to_string(path).unwrap();
    let question = Question { machine: "router", settings: &[], zero: None };
    let seconds = || check::check(&text, &question).map(|answer| answer.seconds());
    // One machine for each thread.
    std::thread::scope(|scope| scope.spawn(seconds).join().unwrap()).unwrap()
}

fn files() -> Vec<PathBuf> {
    let files = fs::read_dir("../cam").unwrap();
    let mut paths: Vec<_> = files.map(|file| file.unwrap().path()).collect();
    paths.sort();
    paths
}

#[test]
fn files_as_posts_write_them_run() {
    for path in files() {
        let report = run(&path);
        assert!(report.ok, "{}:\n{report}", path.display());
        assert_eq!(report.acknowledged, report.lines, "{}", path.display());
    }
}

/// The host takes no time to reckon. Where the chip has no time left, with moves of 0.1 mm at the highest feed, it is 6 % slower.
#[test]
fn a_dry_run_tells_the_time_within_one_percent() {
    let example = |name: &str| PathBuf::from(format!("../../examples/{name}.gcode"));
    let some = ["../cam/estlcam.nc", "../cam/linuxcnc.ngc", "../cam/vectric-mm.nc"];
    let usual = some.map(PathBuf::from).into_iter().chain([example("engraving")]);
    for (path, most) in usual.map(|path| (path, 0.01)).chain([(example("spiral"), 0.06)]) {
        let (takes, said) = (run(&path).seconds_to_idle, estimate(&path));
        let off = said / takes - 1.0;
        assert!(off.abs() < most, "{}: {said:.2} s instead of {takes:.2}", path.display());
    }
}
