//! `cargo xtask verify`: finds out whether a board at a serial port is sound. The checks are those of `tests/verify`,
//! a program of its own, because it needs a library for serial ports.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result};
use clap::Args;

use crate::boards::Board;
use crate::elf::Image;
use crate::firmware;
use crate::machines::Machine;
use crate::process::{host_cargo, pass_through, root};
use crate::setup::{self, Scope};

/// `cargo xtask verify`
#[derive(Args)]
pub struct VerifyArgs {
    /// The board's serial port, such as /dev/ttyACM0. Switch the supply of the motors off before
    #[arg(long)]
    port: String,
    /// The board
    #[arg(long, value_enum, default_value_t)]
    board: Board,
    /// Jumpers connect the pins of X and of the spindle with inputs, as docs/verify.md draws them
    #[arg(long)]
    jumper: bool,
    /// The file for the result; `kerf-verify-BOARD.md` without it
    #[arg(long)]
    file: Option<PathBuf>,
}

/// Address of the first byte of RAM of an ATmega2560.
const RAM: u64 = 0x200;

/// Builds the images, and checks the board. Fails if a check fails.
pub fn run(args: &VerifyArgs) -> Result<ExitCode> {
    let mut command = verify(args)?;
    if args.board.is_rp2040() {
        println!("{} must have Kerf already: its chip is not tested, and not flashed", args.board);
        return pass_through(&mut command);
    }
    setup::ensure(Scope::Flash)?;
    let kerf = firmware::build(args.board, Machine::default())?;
    let self_test = firmware::build_self_test()?;
    pass_through(with_images(&mut command, &kerf, &self_test)?)
}

/// Returns the command that checks a board which has Kerf already.
fn verify(args: &VerifyArgs) -> Result<Command> {
    let features = args.board.features()?;
    let has_counter = !args.board.is_rp2040() && !features.iter().any(|name| name == "lathe");
    let dialect = features.into_iter().find(|name| name.starts_with("dialect-"));
    let dialect = dialect.with_context(|| format!("{} has no dialect", args.board))?;
    let mut command = host_cargo();
    let manifest = root().join("Cargo.toml");
    command.args(["run", "--quiet", "--package", "kerf-verify", "--manifest-path"]).arg(manifest);
    command.args(["--", "--port", &args.port, "--board", args.board.name()]);
    command.args(["--dialect", &dialect, "--file"]);
    let file = args.file.clone();
    command.arg(file.unwrap_or_else(|| format!("kerf-verify-{}.md", args.board).into()));
    command.args(has_counter.then_some("--counter"));
    if let Some(channel) = args.board.pwm_channel()?.filter(|_| args.jumper) {
        command.arg("--jumpers").arg(channel.to_string());
    }
    Ok(command)
}

/// Adds the images that the board is flashed with.
fn with_images<'c>(
    command: &'c mut Command,
    kerf: &Path,
    self_test: &Path,
) -> Result<&'c mut Command> {
    let end = RAM + Image::load(kerf)?.sizes.ram();
    command.arg("--kerf").arg(kerf).arg("--self-test").arg(self_test);
    Ok(command.args(["--static-end", &end.to_string()]))
}
