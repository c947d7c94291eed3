//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

/// Runs the Kerf firmware on a simulated board.
#[derive(Parser, Debug)]
#[command(version)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Subcommand, Debug)]
pub enum Command {
    /// Stream a G-code file and check every step.
    Run(RunArgs),
}

/// The firmware and the board under it.
#[derive(Args, Debug)]
pub struct Target {
    /// The firmware, as an ELF file.
    #[arg(long, value_name = "PATH")]
    pub elf: PathBuf,
    /// The board that the firmware was built for.
    #[arg(long, value_name = "NAME", default_value = "mega2560-grbl")]
    pub board: String,
}

/// Arguments of `run`.
#[derive(Args, Debug)]
pub struct RunArgs {
    /// Firmware and board.
    #[command(flatten)]
    pub target: Target,
    /// The G-code file.
    #[arg(value_name = "JOB")]
    pub job: PathBuf,
    /// A line to send before the job, such as '{xvm:20000}'; may be given more than once.
    #[arg(long = "set", value_name = "LINE")]
    pub settings: Vec<String>,
    /// Speed of the serial line.
    #[arg(long, default_value_t = 115_200, value_parser = clap::value_parser!(u32).range(300..=2_000_000))]
    pub baud: u32,
    /// Lines in flight.
    #[arg(long, value_name = "N", default_value_t = kerf_sim::LINES_IN_FLIGHT)]
    pub in_flight: usize,
    /// Write the summary as JSON too.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Write step and direction signals for GTKWave.
    #[arg(long, value_name = "FILE")]
    pub vcd: Option<PathBuf>,
    /// Print the result only.
    #[arg(long)]
    pub quiet: bool,
}
