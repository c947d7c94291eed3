//! The command line.

use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::RangedI64ValueParser;
use clap::{Args, Parser, Subcommand, value_parser};
use kerf_sim::plot::WINDOW_MS;

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
    /// Put the machine behind a pseudo-terminal, for a sender to connect to.
    Serve(ServeArgs),
    /// Measure what the firmware achieves and print it beside other firmwares' figures.
    Bench(BenchArgs),
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
    /// Speed of the serial line during the job; the firmware is told to change to it.
    #[arg(long, value_name = "N", value_parser = baud())]
    pub baud: Option<u32>,
    /// Lines that are sent and not yet answered, at most.
    #[arg(long, value_name = "N", default_value_t = kerf_sim::LINES_IN_FLIGHT)]
    pub in_flight: usize,
    /// Put a spindle with an encoder of this many pulses a turn beside the board, and check the threads of the job.
    #[arg(long, value_name = "PULSES")]
    pub spindle: Option<u32>,
    /// Write the summary as JSON too.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Write step and direction signals for GTKWave.
    #[arg(long, value_name = "FILE")]
    pub vcd: Option<PathBuf>,
    /// Draw the path, and velocity, acceleration and jerk of each axis, from the steps.
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// The span of time that the curves of the plot show, in seconds, such as 10..14.
    #[arg(long, value_name = "FROM..TO", requires = "plot", value_parser = span)]
    pub span: Option<Range<f64>>,
    /// Milliseconds between positions from which the plot computes accelerations; twice as many for jerk.
    #[arg(long, value_name = "MS", default_value_t = WINDOW_MS, requires = "plot")]
    pub smooth: u32,
    /// Print only the result.
    #[arg(long)]
    pub quiet: bool,
}

/// Arguments of `serve`.
#[derive(Args, Debug)]
pub struct ServeArgs {
    /// Firmware and board.
    #[command(flatten)]
    pub target: Target,
    /// How many times faster than real time to run, or `max`.
    #[arg(long, value_name = "N", default_value = "1")]
    pub speed: Speed,
    /// Make a symbolic link to the pseudo-terminal.
    #[arg(long, value_name = "PATH")]
    pub link: Option<PathBuf>,
    /// Let a debugger connect to this TCP port; 0 chooses a free port. The second line printed is `gdb: PORT`.
    #[arg(long, value_name = "PORT")]
    pub gdb: Option<u16>,
    /// The job that senders send. When the standard input ends, each motor must be where this job ends, to the step.
    #[arg(long, value_name = "JOB")]
    pub expect: Option<PathBuf>,
    /// Damage one in N numbered lines on their way to the board, chosen by a seed.
    #[arg(long, value_name = "ONE_IN:SEED", value_parser = damage)]
    pub damage: Option<(u64, u64)>,
    /// Start in this boot loader after each reset, as a real board does; without HEX in that of Debian's package
    /// `arduino-core-avr`. Opening the port resets the board, whose memory stays. Bytes that come early are not held
    /// back.
    #[arg(long, value_name = "HEX", num_args = 0..=1, default_missing_value = kerf_sim::loader::DEBIAN)]
    pub boot_loader: Option<PathBuf>,
    /// Speed of the serial line at power-up. The line follows when the firmware changes its speed.
    #[arg(long, default_value_t = 115_200, value_parser = baud())]
    pub baud: u32,
}

/// Arguments of `bench`.
#[derive(Args, Debug)]
pub struct BenchArgs {
    /// Firmware and board.
    #[command(flatten)]
    pub target: Target,
    /// Measure this row only; may be given more than once.
    #[arg(long = "row", value_name = "NAME")]
    pub rows: Vec<String>,
}

/// How fast `serve` runs.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Speed {
    /// As fast as the computer allows.
    Max,
    /// This many times as fast as a real machine.
    Times(f64),
}

impl FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "max" {
            return Ok(Speed::Max);
        }
        match text.parse::<f64>() {
            Ok(n) if n.is_finite() && n > 0.0 => Ok(Speed::Times(n)),
            _ => Err("a number above 0, or max".to_string()),
        }
    }
}

/// A span of time, s.
fn span(text: &str) -> Result<Range<f64>, String> {
    let ends = text.split_once("..").map(|(from, to)| (from.parse(), to.parse()));
    match ends {
        Some((Ok(from), Ok(to))) if 0.0 <= from && from < to => Ok(from..to),
        _ => Err("two times with .. between them, the later one last".to_string()),
    }
}

/// Parses how many numbered lines come to one that is damaged, and a seed.
fn damage(text: &str) -> Result<(u64, u64), String> {
    let parts = text.split_once(':').map(|(one_in, seed)| (one_in.parse(), seed.parse()));
    match parts {
        Some((Ok(one_in), Ok(seed))) if one_in > 0 => Ok((one_in, seed)),
        _ => Err("two whole numbers with a colon between them".to_string()),
    }
}

/// Speeds that a USART of the ATmega2560 can make.
fn baud() -> RangedI64ValueParser<u32> {
    value_parser!(u32).range(300..=2_000_000)
}
