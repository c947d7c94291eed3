//! `kerf-sim run` judges good jobs as good: it follows what the language says.

use kerf::boards::{Board, MEGA2560_GRBL, MEGA2560_GRBL_LATHE, MEGA2560_LATHE, RAMPS14};
use kerf_sim::job::{self, Options};
use kerf_sim::mechanics::Build;
use kerf_sim::print;
use kerf_sim::report::Report;
use kerf_sim::threads::Threads;

use crate::common::firmware;

fn ran(board: &'static Board, text: &str) -> Report {
    let lines = job::lines_of(text);
    job::run(&mut firmware(board), &lines, &Options::default(), |_| {}).unwrap()
}

/// Runs a job on a lathe with 4 spindle pulses a turn.
fn turned(board: &'static Board, text: &str) -> Report {
    let mut machine = firmware(board);
    machine.build(&Build::lathe(board, 4).unwrap());
    machine.recorder_mut().keep_log();
    let lines = job::lines_of(text);
    let settings = vec!["{mch:4}".to_string(), "{spn:4}".to_string()];
    let options = Options { settings, ..Options::default() };
    let mut report = job::run(&mut machine, &lines, &options, |_| {}).unwrap();
    report.add_threads(Threads::of(&machine, &report.setup, &lines));
    report
}

#[test]
fn increments_of_many_decimals() {
    let metric = "X0.0333333 Y-.01111115 Z.0000499\n".repeat(30);
    let inches = "X-.0012345 Y.0003333\n".repeat(20);
    let report = ran(&MEGA2560_GRBL, &format!("G21 G91\nG1 F600\n{metric}G20\nF30\n{inches}M30\n"));
    assert!(report.ok && report.unchecked.is_none(), "{report}");
}

#[test]
fn every_system_and_tool() {
    let job = "G10 L2 P9 X1\nG59.3 G0 X1\nG10 L20 P0 X5\nG0 X6\nG10 L1 P3 Z2\nG54\nG0 X1\nM30\n";
    let report = ran(&MEGA2560_GRBL, job);
    assert!(report.ok && report.unchecked.is_none(), "{report}");
}

#[test]
fn feed_by_the_turn_without_a_thread() {
    let report = turned(&MEGA2560_LATHE, "M3 S600\nG95 F0.2\nG1 Z-2\nX1\nG94\nG0 Z1\nM5\nM30\n");
    assert!(report.ok && report.threads.is_none(), "{report}");
}

#[test]
fn threads_on_a_slope_across_and_with_three_starts() {
    let job = "M3 S600\nG4 P3\nG0 X10 Z2\nG33 X8 Z-6 K1\nG0 X12 Z2\nX14\nG33 X6 K1\nG0 X12 Z4\n\
        G33 Z-5 K1.5\nG0 X14\nZ4.5\nX12\nG33 Z-5 K1.5\nG0 X14\nZ5\nX12\nG33 Z-5 K1.5\nG0 X14\nM5\nM30\n";
    let report = turned(&MEGA2560_LATHE, job);
    let threads = report.threads.as_ref().expect("threads");
    assert!(report.ok && report.unchecked.is_none(), "{report}");
    assert_eq!((threads.lines, threads.passes), (5, 5), "{threads:?}");
    assert!(threads.turns >= 18, "{threads:?}");
}

#[test]
fn a_job_in_the_dialect_of_grbl() {
    let job = "M3 S600\nG4 P1\nG0 X2 Z2\nG33 Z-5 K1\nG0 X3\nM0\nG91\nG1 X.00333 F300\nM5\nM30\n";
    let report = turned(&MEGA2560_GRBL_LATHE, job);
    assert!(report.ok && report.unchecked.is_none(), "{report}");
    assert_eq!((report.acknowledged, report.threads.unwrap().passes), (10, 1));
    let report = turned(&MEGA2560_GRBL_LATHE, "G0 X1\nG5 X2\nG0 X3\n");
    assert_eq!((report.rejected[0].line, report.rejected[0].status), (2, 20), "{report}");
}

#[test]
fn a_print_with_flow_retractions_and_lines_that_are_passed_over() {
    let moves: String = (1..20).map(|n| format!("G1 X{n} E.0333333\n")).collect();
    let job = format!(
        "M302 P1\nM83\nM777\nM105\nG1 F3000\n{moves}G10\nG1 X5\nG11\nM221 S95\n{moves}M220 S80\n\
         M207 S1.5\nG10\nG92 A0\nM82\nG1 X4 E1\nG11\nG1 X3 E2\nM118 told\n"
    );
    let lines = job::lines_of(&job);
    let mut machine = firmware(&RAMPS14);
    let report = print::run(&mut machine, &lines, &Options::default(), |_| {}).unwrap();
    assert!(report.ok && report.unchecked.is_none(), "{report}");
    assert!(report.told.iter().any(|told| told.contains("line 3: echo:Unknown")), "{report}");
    assert!(report.motors[3].total > 100 && report.motors[3].expected.is_some(), "{report}");
}
