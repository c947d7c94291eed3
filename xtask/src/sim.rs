//! Runs the firmware on the simulated board. The simulator is a program of its own (`tests/sim`),
//! because it links simavr, which is under the GPL.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, ensure};
use clap::Args;

use crate::boards::Board;
use crate::emulator;
use crate::firmware;
use crate::machines::Machine;
use crate::process::{become_program, host_cargo, pass_through, root, run as run_child};
use crate::setup::{self, Scope};

/// `cargo xtask sim`
#[derive(Args)]
pub struct RunArgs {
    /// The job, a file of G-code
    job: PathBuf,
    /// The board to simulate; mega2560-grbl, or mega2560-lathe with `--machine lathe`
    #[arg(long, value_enum)]
    board: Option<Board>,
    /// The machine whose settings are the defaults. The lathe has a spindle with an encoder, and its threads are
    /// checked
    #[arg(long, value_enum, default_value_t)]
    machine: Machine,
    /// A setting to send before the job, as a sender would: '{"xvm":800}'; @FILE sends each line of a file
    #[arg(long, value_name = "JSON|@FILE")]
    set: Vec<String>,
    /// The speed of the serial line, which the firmware is told to change to
    #[arg(long)]
    baud: Option<u32>,
    /// Write a report to this file
    #[arg(long, value_name = "FILE.json")]
    report: Option<PathBuf>,
    /// Write the waveforms of the pins to this file
    #[arg(long, value_name = "FILE.vcd")]
    vcd: Option<PathBuf>,
    /// Draw path, velocity, acceleration and jerk from the steps into this file
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// The span of time that the curves of the plot show, in seconds
    #[arg(long, value_name = "FROM..TO", requires = "plot")]
    span: Option<String>,
    /// The milliseconds over which the plot is smoothed
    #[arg(long, value_name = "MS", requires = "plot")]
    smooth: Option<u32>,
}

/// `cargo xtask serve`
#[derive(Args)]
pub struct ServeArgs {
    /// The board to simulate
    #[arg(long, value_enum, default_value_t)]
    board: Board,
    /// The machine whose settings are the defaults
    #[arg(long, value_enum, default_value_t)]
    machine: Machine,
    /// How many times faster than real time to run, or `max`
    #[arg(long, value_name = "N|max")]
    speed: Option<String>,
    /// Where to put a link to the serial port
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// Let avr-gdb connect to this TCP port
    #[arg(long, value_name = "PORT")]
    gdb: Option<u16>,
    /// Start in the boot loader of the Arduino Mega after each reset, as a real board does
    #[arg(long)]
    boot_loader: bool,
}

/// `cargo xtask bench`
#[derive(Args)]
pub struct BenchArgs {
    /// Measure only this row; may be given more than once
    #[arg(long, value_name = "NAME")]
    row: Vec<String>,
    /// The board: the one that the other firmwares were measured on, or `pico`
    #[arg(long, value_enum, default_value_t)]
    board: Board,
}

/// Pulses a turn of the encoder at the lathe's spindle.
const SPINDLE_PULSES: u32 = 4;

impl RunArgs {
    /// The board to simulate.
    fn board(&self) -> Board {
        self.board.unwrap_or(match self.machine {
            Machine::Lathe => Board::Mega2560Lathe,
            _ => Board::default(),
        })
    }
}

/// Builds the firmware and runs a job. Returns the simulator's exit code.
pub fn run(args: &RunArgs) -> Result<ExitCode> {
    ensure!(args.job.is_file(), "there is no job {}", args.job.display());
    let elf = prepare(args.board(), args.machine)?;
    pass_through(&mut run_command(args, &elf)?)
}

/// Builds the firmware and offers the simulated board as a serial port. The simulator replaces this process, so that
/// its process number is the one that was started.
pub fn serve(args: &ServeArgs) -> Result<ExitCode> {
    let elf = prepare(args.board, args.machine)?;
    if args.boot_loader {
        setup::ensure(Scope::Tests)?;
    }
    become_program(&mut serve_command(args, &elf))
}

/// Builds and measures, on the board that other firmwares were measured on.
pub fn bench(args: &BenchArgs) -> Result<ExitCode> {
    let elf = prepare(args.board, Machine::default())?;
    if args.board == Board::Pico {
        // The rows with six motors need this image.
        firmware::build(Board::Pico6, Machine::default())?;
        return pass_through(&mut bench_command(args, &elf));
    }
    ensure!(args.board == Board::default(), "there are no rows of {}", args.board.name());
    if args.row.is_empty() || args.row.iter().any(|row| row.starts_with("print")) {
        // The rows of a printer need this image.
        firmware::build(Board::Ramps14, Machine::default())?;
    }
    pass_through(&mut bench_command(args, &elf))
}

/// Installs everything that the simulator needs, and builds the firmware. Returns its path.
pub fn prepare(board: Board, machine: Machine) -> Result<PathBuf> {
    if board.is_rp2040() {
        setup::ensure(Scope::Emulator)?;
        emulator::RP2040.install()?;
    } else {
        setup::ensure(Scope::Simulator)?;
    }
    let elf = firmware::build(board, machine)?;
    build()?;
    Ok(elf)
}

fn run_command(args: &RunArgs, elf: &Path) -> Result<Command> {
    let mut command = simulator("run", elf, args.board());
    command.arg(&args.job);
    for set in settings(&args.set)? {
        command.arg("--set").arg(set);
    }
    let spindle = (args.machine == Machine::Lathe).then(|| SPINDLE_PULSES.to_string());
    option(&mut command, "--spindle", spindle);
    option(&mut command, "--baud", args.baud.map(|baud| baud.to_string()));
    option(&mut command, "--report", args.report.as_ref());
    option(&mut command, "--vcd", args.vcd.as_ref());
    option(&mut command, "--plot", args.plot.as_ref());
    option(&mut command, "--span", args.span.as_ref());
    option(&mut command, "--smooth", args.smooth.map(|ms| ms.to_string()));
    Ok(command)
}

/// Returns the settings one by one; `@FILE` gives each line of the file that is not empty.
fn settings(given: &[String]) -> Result<Vec<String>> {
    let mut all = Vec::new();
    for set in given {
        let Some(file) = set.strip_prefix('@') else {
            all.push(set.clone());
            continue;
        };
        let text = std::fs::read_to_string(file).with_context(|| format!("cannot read {file}"))?;
        let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
        all.extend(lines.map(str::to_owned));
    }
    Ok(all)
}

fn serve_command(args: &ServeArgs, elf: &Path) -> Command {
    let mut command = simulator("serve", elf, args.board);
    option(&mut command, "--speed", args.speed.as_ref());
    option(&mut command, "--link", args.link.as_ref());
    option(&mut command, "--gdb", args.gdb.map(|port| port.to_string()));
    if args.boot_loader {
        command.arg("--boot-loader");
    }
    command
}

fn bench_command(args: &BenchArgs, elf: &Path) -> Command {
    let mut command = simulator("bench", elf, args.board);
    for row in &args.row {
        command.args(["--row", row]);
    }
    command
}

/// Runs a job with settings as in `--set`, and writes a report.
pub fn report(elf: &Path, job: &Path, set: &[String], file: &Path) -> Result<()> {
    let mut command = simulator("run", elf, Board::default());
    for set in settings(set)? {
        command.arg("--set").arg(set);
    }
    run_child(command.arg(job).arg("--quiet").arg("--report").arg(file))
}

/// Builds the simulator, [`program`]. All packages are named together, so that shared dependencies have the same
/// features and are compiled once.
pub fn build() -> Result<()> {
    if !program().exists() {
        eprintln!("building the simulator: some minutes, this once");
    }
    let mut cargo = host_cargo();
    cargo.current_dir(root());
    run_child(cargo.args(["build", "--quiet", "--workspace", "--bin", "kerf-sim"]))
}

/// Returns the path of the simulator: beside this program, wherever cargo builds.
pub fn program() -> PathBuf {
    std::env::current_exe().unwrap_or_default().with_file_name("kerf-sim")
}

fn simulator(verb: &str, elf: &Path, board: Board) -> Command {
    let mut simulator = Command::new(program());
    simulator.args([verb, "--elf"]).arg(elf).args(["--board", board.name()]);
    simulator
}

fn option(command: &mut Command, name: &str, value: Option<impl AsRef<std::ffi::OsStr>>) {
    if let Some(value) = value {
        command.arg(name).arg(value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::process::shown;

    fn arguments(command: &Command) -> String {
        shown(command).split_once("kerf-sim ").unwrap().1.to_owned()
    }

    #[test]
    fn every_option_reaches_the_simulator() {
        let args = RunArgs {
            job: "a.gcode".into(),
            board: Some(Board::Ramps14),
            machine: Machine::Careful,
            set: vec!["{\"xvm\":800}".into(), "{\"yvm\":800}".into()],
            baud: Some(250_000),
            report: Some("r.json".into()),
            vcd: Some("v.vcd".into()),
            plot: Some("p.svg".into()),
            span: Some("1..2".into()),
            smooth: Some(30),
        };
        assert_eq!(
            arguments(&run_command(&args, Path::new("k.elf")).unwrap()),
            "run --elf k.elf --board ramps14 a.gcode --set {\"xvm\":800} --set {\"yvm\":800} \
             --baud 250000 --report r.json --vcd v.vcd --plot p.svg --span 1..2 --smooth 30"
        );
    }

    #[test]
    fn a_file_of_settings_is_as_its_lines() {
        let folder = root().join("target/tmp/set");
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("settings.txt");
        std::fs::write(&file, "{xvm:1}\r\n\n {y:{vm:2}}\n").unwrap();
        let given = ["{zvm:3}".to_owned(), format!("@{}", file.display())];
        assert_eq!(settings(&given).unwrap(), ["{zvm:3}", "{xvm:1}", "{y:{vm:2}}"]);
        assert!(settings(&["@/nonexistent".into()]).is_err());
    }

    #[test]
    fn rows_reach_the_simulator() {
        let args =
            BenchArgs { row: vec!["rate-1".into(), "lines".into()], board: Board::default() };
        let command = bench_command(&args, Path::new("k.elf"));
        let want = "bench --elf k.elf --board mega2560-grbl --row rate-1 --row lines";
        assert_eq!(arguments(&command), want);
    }

    #[test]
    fn nothing_is_sent_that_was_not_asked_for() {
        let args = ServeArgs {
            board: Board::default(),
            machine: Machine::default(),
            speed: None,
            link: None,
            gdb: Some(2345),
            boot_loader: true,
        };
        let command = serve_command(&args, Path::new("k.elf"));
        let wanted = "serve --elf k.elf --board mega2560-grbl --gdb 2345 --boot-loader";
        assert_eq!(arguments(&command), wanted);
    }
}
