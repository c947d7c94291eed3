//! The example jobs on every board: right to the step, and within the promised budgets.
//!
//! Each job runs once on each board, the longest on one of them or with `KERF_LONG=1` on both, two at a time, and the tests check what was measured. On RAMPS the motors have coarser steps
//! and higher speeds, so that the long job ends sooner and gives other numbers.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::{LazyLock, Mutex};
use std::thread;

use kerf::boards::{Board, MEGA2560_GRBL, RAMPS14_CNC};
use kerf_sim::job::{self, Lines, Options};
use kerf_sim::oracle::{self, Setup};
use kerf_sim::report::Report;

use crate::common::share::share_of;
use crate::common::{booted, firmware};

/// The longest first.
const JOBS: [&str; 4] = ["bracket", "spiral", "engraving", "square"];

/// Longest time in which no tick is served, outside the step interrupt, cycles. Pulses wait for that long.
const OFF_CYCLES: u64 = 42;
/// Least number of bytes between the static data and the deepest stack.
const FREE_STACK: i32 = 400;

/// A job that has run.
struct Run {
    job: &'static str,
    board: &'static Board,
    report: Result<Report, String>,
}

static RUNS: LazyLock<Vec<Run>> = LazyLock::new(|| {
    let boards = [&MEGA2560_GRBL, &RAMPS14_CNC];
    let long = JOBS.iter().take(1).flat_map(|job| share_of(&boards, 2).map(|board| (*job, *board)));
    let others = JOBS.iter().skip(1).flat_map(|job| boards.map(|board| (*job, board)));
    let pairs = long.chain(others);
    let waiting: Mutex<VecDeque<(&str, &Board)>> = Mutex::new(pairs.collect());
    let done = Mutex::new(Vec::new());
    let work = || {
        loop {
            let next = waiting.lock().unwrap().pop_front();
            let Some((job, board)) = next else { return };
            let report = thread::spawn(move || run(job, board)).join();
            let report = report.map_err(|why| said(&*why));
            done.lock().unwrap().push(Run { job, board, report });
        }
    };
    thread::scope(|scope| {
        scope.spawn(work);
        scope.spawn(work);
    });
    done.into_inner().unwrap()
});

/// Returns the message of a thread that has panicked.
fn said(why: &(dyn std::any::Any + Send)) -> String {
    let text = why.downcast_ref::<String>().cloned();
    text.or_else(|| why.downcast_ref::<&str>().map(|s| s.to_string())).unwrap_or_default()
}

fn lines(job: &str) -> Lines {
    job::read_lines(Path::new(&format!("../../../examples/{job}.gcode"))).unwrap()
}

fn settings(board: &Board) -> Vec<String> {
    if board.name == MEGA2560_GRBL.name {
        return Vec::new();
    }
    let motors = ["{1:{tr:5}}", "{2:{tr:5}}", "{3:{tr:2.5}}"];
    let axes = ["{x:{vm:3000,fr:3000,jm:400}}", "{y:{vm:3000,fr:3000,jm:400}}", "{z:{vm:1500}}"];
    motors.iter().chain(&axes).map(|s| s.to_string()).collect()
}

fn run(job: &str, board: &'static Board) -> Report {
    let options = Options { settings: settings(board), ..Options::default() };
    job::run(&mut firmware(board), &lines(job), &options, |_| {}).unwrap()
}

/// Fails with everything that `check` finds wrong with the runs on a board, or on every board.
fn every_run(board: Option<&Board>, check: impl Fn(&Run, &Report) -> Result<(), String>) {
    let of_board = |run: &&Run| board.is_none_or(|board| board.name == run.board.name);
    let wrong = RUNS.iter().filter(of_board).filter_map(|run| {
        let checked = run.report.as_ref().map_err(Clone::clone).and_then(|r| check(run, r));
        checked.err().map(|what| format!("{} on {}: {what}", run.job, run.board.name))
    });
    let wrong: Vec<_> = wrong.collect();
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

fn ensure(good: bool, what: impl FnOnce() -> String) -> Result<(), String> {
    if good { Ok(()) } else { Err(what()) }
}

fn ends_well(_: &Run, report: &Report) -> Result<(), String> {
    ensure(report.ok, || report.problems.join("; "))?;
    ensure(report.motors.iter().all(|m| m.expected == Some(m.steps)), || report.to_string())?;
    ensure(report.motors[0].total > 0, || "nothing moved".to_string())
}

#[test]
fn jobs_on_the_grbl_board_end_well_and_exact_to_the_step() {
    every_run(Some(&MEGA2560_GRBL), ends_well);
}

#[test]
fn jobs_on_ramps_end_well_and_exact_to_the_step() {
    every_run(Some(&RAMPS14_CNC), ends_well);
}

/// Returns the steps of each motor in both directions together. Each line must move each motor in one direction only:
/// no arcs.
fn commanded(lines: &Lines, setup: &Setup) -> Vec<u64> {
    let (mut at, mut total) = (vec![0_i64; setup.motors.len()], vec![0; setup.motors.len()]);
    for end in 1..=lines.len() {
        let outcome = oracle::run(lines[..end].iter().map(|(n, l)| (*n, l.as_str())), setup);
        for ((at, total), steps) in at.iter_mut().zip(&mut total).zip(outcome.unwrap().steps) {
            *total += steps.abs_diff(*at);
            *at = steps;
        }
    }
    total
}

#[test]
fn no_step_is_made_and_taken_back() {
    // Motors and axes have their defaults, which lines of a job do not change.
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    let setup = job::read_setup(&mut machine, &mut host).unwrap();
    every_run(Some(&MEGA2560_GRBL), |run, report| {
        if run.job == "bracket" {
            return Ok(());
        }
        let (want, got) = (commanded(&lines(run.job), &setup), report.motors.iter());
        let got: Vec<_> = got.map(|m| m.total).collect();
        // Where a curve reverses, within the tolerance of G64 and of the means, the steps there and back are left out.
        let is_right = |(got, want): (&u64, &u64)| {
            got <= want && (want - got).is_multiple_of(2) && (want - got) * 500 <= *want
        };
        let right = got.len() == want.len() && got.iter().zip(&want).all(is_right);
        ensure(right, || format!("{got:?} steps instead of {want:?}"))
    });
}

#[test]
fn a_tick_waits_for_42_cycles_at_most_outside_the_step_interrupt() {
    every_run(None, |_, report| {
        let off = &report.interrupts_off;
        ensure(off.cycles <= OFF_CYCLES, || {
            format!("{} cycles, {}, in {}", off.cycles, off.place, off.context)
        })
    });
}

#[test]
fn the_stack_keeps_its_distance() {
    every_run(None, |_, report| {
        let free = report.free_stack.unwrap_or(0);
        ensure(free >= FREE_STACK, || format!("{free} bytes are free at the worst moment"))
    });
}

#[test]
fn no_byte_and_no_tick_is_missed() {
    every_run(None, |_, report| {
        ensure(report.uart_overruns == 0, || format!("{} overruns", report.uart_overruns))?;
        ensure(report.missed_tops == 0, || format!("{} missed tops", report.missed_tops))?;
        ensure(report.resets == 0, || format!("{} resets", report.resets))
    });
}

#[test]
fn a_corrupted_line_fails_the_job_and_is_named() {
    let mut lines = lines("square");
    let (number, text) = &mut lines[7];
    *text = text.replace('X', "X\u{7f}");
    let number = *number;
    let mut machine = firmware(&MEGA2560_GRBL);
    let report = job::run(&mut machine, &lines, &Options::default(), |_| {}).unwrap();
    assert!(!report.ok, "{report}");
    let rejected = &report.rejected;
    assert_eq!(rejected.len(), 1, "{report}");
    assert_eq!((rejected[0].line, rejected[0].status), (number, 102), "{report}");
    let named = format!("1 of {} lines rejected, the first is line {number}", lines.len());
    assert!(report.to_string().contains(&named), "{report}");
}
