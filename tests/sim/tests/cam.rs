//! Files as the post-processors of CAM programs write them, on the simulated board, and what a dry run predicts for
//! them.

#[path = "../../../src/cli/check/mod.rs"]
mod check;

use std::fs;
use std::path::{Path, PathBuf};

use check::Question;
use kerf::boards::RAMPS14_CNC;
use kerf_sim::job::{self, Options};
use kerf_sim::report::Report;

use crate::common::firmware;
use crate::common::share::share_of;

/// The profile of a router, and a machine that counts as homed, because G28 is refused before homing.
const ROUTER: [&str; 2] = ["{mch:1}", "{gc:\"g28.3x0y0z0\"}"];

fn run(path: &Path) -> Report {
    let mut machine = firmware(&RAMPS14_CNC);
    let lines = job::read_lines(path).unwrap();
    let options = Options { settings: ROUTER.map(String::from).to_vec(), ..Options::default() };
    job::run(&mut machine, &lines, &options, |_| {}).unwrap()
}

/// Returns the seconds that a dry run predicts, and whether it says that the board may take longer.
fn estimate(path: &Path) -> (f64, bool) {
    let job = fs::read(path).unwrap();
    let question = Question { machine: "router", dialect: None, settings: &[], zero: None };
    let asked =
        || check::check(&job, &question).map(|answer| (answer.seconds(), answer.is_rushed()));
    // One machine for each thread.
    std::thread::scope(|scope| scope.spawn(asked).join().unwrap()).unwrap()
}

fn files() -> Vec<PathBuf> {
    let files = fs::read_dir("../../cam").unwrap();
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

fn example(name: &str) -> PathBuf {
    PathBuf::from(format!("../../../examples/{name}.gcode"))
}

/// Returns the relative difference between the predicted time and the time on the board.
fn off(path: &Path, said: f64) -> f64 {
    let takes = run(path).seconds_to_idle;
    let off = said / takes - 1.0;
    println!("{}: {said:.3} s, board {takes:.3} s, {:+.2} %", path.display(), off * 100.0);
    off
}

#[test]
fn a_dry_run_tells_the_time_within_one_percent() {
    let examples = ["bracket", "engraving", "square"].map(example);
    for path in share_of(&files(), 3).chain(share_of(&examples, 3)) {
        let (said, is_rushed) = estimate(path);
        assert!(!is_rushed, "{}", path.display());
        assert!(off(path, said).abs() < 0.01, "{}", path.display());
    }
}

/// The host needs no time for computing, but the chip does. With 500 and more moves of 0.1 mm a second the chip's CPU
/// is the limit.
#[test]
fn a_dry_run_says_when_the_board_may_take_longer() {
    let path = example("spiral");
    let (said, is_rushed) = estimate(&path);
    assert!(is_rushed);
    assert!((-0.08..0.01).contains(&off(&path, said)));
    // At a feed of 2,400 mm/min the board has time left, so that the dry run is exact.
    let text = fs::read_to_string(&path).unwrap().replace("F6000", "F2400");
    let path = std::env::temp_dir().join(format!("kerf-slow-spiral-{}.gcode", std::process::id()));
    fs::write(&path, text).unwrap();
    let (said, is_rushed) = estimate(&path);
    let off = off(&path, said);
    fs::remove_file(&path).unwrap();
    assert!(!is_rushed && off.abs() < 0.01);
}
