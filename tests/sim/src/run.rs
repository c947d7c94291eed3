//! `kerf-sim run`.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, anyhow};
use indicatif::{ProgressBar, ProgressStyle};
use kerf::boards;
use kerf_sim::job::{self, Options};
use kerf_sim::report::Report;
use kerf_sim::{Image, Machine};

use crate::cli::{RunArgs, Target};

/// A machine with the firmware in it.
pub fn machine(target: &Target) -> Result<Machine> {
    let board = boards::by_name(&target.board).ok_or_else(|| {
        let known: Vec<_> = boards::ALL.iter().map(|b| b.name).collect();
        anyhow!("no board {}; there are {}", target.board, known.join(", "))
    })?;
    Machine::new(Image::read(&target.elf)?, board)
}

/// Runs a job. True when all went well.
pub fn run(args: &RunArgs) -> Result<bool> {
    let lines = job::read_lines(&args.job)?;
    let mut machine = machine(&args.target)?;
    machine.set_baud(args.baud);
    let options = Options {
        settings: args.settings.clone(),
        in_flight: args.in_flight,
        vcd: args.vcd.clone(),
    };
    let bar = progress_bar(lines.len(), args.quiet)?;
    let report = job::run(&mut machine, &lines, &options, |done| bar.set_position(done as u64))?;
    bar.finish_and_clear();
    if let Some(path) = &args.report {
        write_report(path, &report)?;
    }
    let text = report.to_string();
    match args.quiet {
        true => println!("{}", text.lines().last().unwrap_or_default()),
        false => print!("{text}"),
    }
    Ok(report.ok)
}

/// A bar on a terminal, nothing elsewhere.
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
