//! `kerf-verify`: the checks of a board at a serial port. `cargo xtask verify` builds the images and starts it.

mod port;

use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result, anyhow};
use clap::Parser;
use embassy_futures::block_on;
use kerf_verify::dialect::of_feature;
use kerf_verify::{Jumpers, Plan, verify};

use port::{Port, Way};

/// Seconds over which clocks are compared. The times of two bytes are known to some milliseconds.
const SECONDS: u32 = 10;
/// Checks a board at a serial port, and writes what was found to a file
#[derive(Parser)]
#[command(version)]
struct Args {
    /// The board's serial port
    #[arg(long)]
    port: String,
    /// The name of the board
    #[arg(long)]
    board: String,
    /// The feature of its first dialect, such as `dialect-tinyg`
    #[arg(long)]
    dialect: String,
    /// Kerf for the board, as an ELF file. Without it the board must have Kerf already
    #[arg(long, requires = "self_test")]
    kerf: Option<PathBuf>,
    /// The image that tests the chip, as an Intel HEX file
    #[arg(long, requires = "kerf")]
    self_test: Option<PathBuf>,
    /// The clock of the chip, Hz
    #[arg(long, default_value_t = 16_000_000)]
    clock: u32,
    /// The first address behind the static data of Kerf
    #[arg(long)]
    static_end: Option<u16>,
    /// There are the jumpers of docs/verify.md; the spindle's pulses come from this channel of timer 4
    #[arg(long, value_name = "PWM")]
    jumpers: Option<u8>,
    /// The image counts pulses at D47
    #[arg(long)]
    counter: bool,
    /// The file that is written
    #[arg(long)]
    file: PathBuf,
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn run(args: &Args) -> Result<ExitCode> {
    let dialect = of_feature(&args.dialect).with_context(|| format!("no {}", args.dialect))?;
    let images = args.kerf.clone().zip(args.self_test.clone());
    let plan = Plan {
        board: args.board.clone(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        dialect,
        clock_hz: images.is_some().then_some(args.clock),
        static_end: args.static_end,
        jumpers: args.jumpers.map(|pwm| Jumpers { counts: args.counter, pwm }),
        seconds: SECONDS,
        seed: SystemTime::now().duration_since(UNIX_EPOCH).map_or(1, |time| time.as_secs()),
    };
    let name = args.file.display();
    let mut file = File::create(&args.file).with_context(|| format!("cannot write {name}"))?;
    let way = images.map_or(Way::Usb, |(kerf, self_test)| Way::Loader { kerf, self_test });
    let mut board = Port::open(&args.port, way).map_err(|why| anyhow!(why))?;
    let report = block_on(verify(&mut board, &plan));
    write!(file, "{report}").with_context(|| format!("cannot write {name}"))?;
    println!("{}\nAll of it is in {name}, which can be attached to an issue.", report.verdict());
    Ok(if report.is_sound() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
