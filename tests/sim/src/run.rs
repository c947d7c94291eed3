//! `kerf-sim run`.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, anyhow};
use indicatif::{ProgressBar, ProgressStyle};
use kerf::boards::{self, Board};
use kerf_sim::Machine;
use kerf_sim::emulated::{self, Emulated};
use kerf_sim::job::{self, Options};
use kerf_sim::limits;
use kerf_sim::mechanics::Build;
use kerf_sim::plot::{self, Look};
use kerf_sim::print;
use kerf_sim::report::Report;
use kerf_sim::threads::Threads;

use crate::cli::RunArgs;

/// Returns the board of this name; an error lists the known boards.
pub fn board(name: &str) -> Result<&'static Board> {
    boards::by_name(name).ok_or_else(|| {
        let known: Vec<_> = boards::ALL.iter().map(|b| b.name).collect();
        anyhow!("no board {name}; there are {}", known.join(", "))
    })
}

/// Runs a job. Returns true when all went well.
pub fn run(args: &RunArgs) -> Result<bool> {
    let lines = job::read_lines(&args.job)?;
    let board = board(&args.target.board)?;
    if emulated::is_emulated(board) {
        return run_emulated(args, board, &lines);
    }
    let mut machine = Machine::load(&args.target.elf, board)?;
    job::speech_of(&machine)?;
    let mut settings = Vec::new();
    if let Some(pulses) = args.spindle {
        let lathe = Build::lathe(board, pulses);
        machine.build(&lathe.ok_or_else(|| anyhow!("the board {} has no encoder", board.name))?);
        settings.push(format!("{{spn:{pulses}}}"));
    }
    settings.extend_from_slice(&args.settings);
    let options = Options {
        baud: args.baud,
        settings,
        in_flight: args.in_flight,
        vcd: args.vcd.clone(),
        interjections: Vec::new(),
    };
    if args.plot.is_some() || args.spindle.is_some() {
        machine.recorder_mut().keep_log();
    }
    let bar = progress_bar(lines.len(), args.quiet)?;
    let progress = |done| bar.set_position(done as u64);
    let mut report = match print::is_print(board, &lines) {
        true => print::run(&mut machine, &lines, &options, progress)?,
        false => job::run(&mut machine, &lines, &options, progress)?,
    };
    bar.finish_and_clear();
    if args.spindle.is_some() {
        report.add_threads(Threads::of(&machine, &report.setup, &lines));
    }
    if let Some(path) = &args.report {
        write_report(path, &report)?;
    }
    if let Some(path) = &args.plot {
        let look = Look { span: args.span.clone(), window_ms: args.smooth };
        let limits = limits::of(&mut machine, &report.setup);
        plot::write(path, &machine, &report.setup, &limits, &look, report.threads.as_ref())?;
    }
    let text = report.to_string();
    match args.quiet {
        true => println!("{}", text.lines().last().unwrap_or_default()),
        false => print!("{text}"),
    }
    Ok(report.ok)
}

/// Runs a job on a board whose chip is emulated.
fn run_emulated(args: &RunArgs, board: &'static Board, lines: &job::Lines) -> Result<bool> {
    emulated::job::check(&[
        ("--baud", args.baud.is_some()),
        ("--spindle", args.spindle.is_some()),
        ("--report", args.report.is_some()),
        ("--vcd", args.vcd.is_some()),
        ("--plot", args.plot.is_some()),
    ])?;
    let mut machine = Emulated::load(&args.target.elf, board)?;
    let bar = progress_bar(lines.len(), args.quiet)?;
    let progress = |done| bar.set_position(done as u64);
    let (settings, in_flight) = (args.settings.clone(), args.in_flight);
    let options = Options { settings, in_flight, ..Options::default() };
    let report = emulated::job::run(&mut machine, lines, &options, progress)?;
    bar.finish_and_clear();
    let text = report.to_string();
    match args.quiet {
        true => println!("{}", text.lines().last().unwrap_or_default()),
        false => print!("{text}"),
    }
    Ok(report.problems.is_empty())
}

/// A progress bar if the output is a terminal, else a hidden one.
fn progress_bar(lines: usize, quiet: bool) -> Result<ProgressBar> {
    if quiet {
        return Ok(ProgressBar::hidden());
    }
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} lines  {elapsed} {msg}")?;
    Ok(ProgressBar::new(lines as u64).with_style(style))
}

fn write_report(path: &Path, report: &Report) -> Result<()> {
    let mut json = serde_json::to_string_pretty(report)?;
    json.push('\n');
    fs::write(path, json).with_context(|| format!("cannot write {}", path.display()))
}
