//! The command line: what Kerf's language makes of a program, on the host.

use std::fs::File;
use std::io::{self, BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use kerf::canon::{Reader, Refusal};
use kerf::gcode::setup::Usual;

/// Motion-control firmware; `cargo xtask build` builds the image for a board
#[derive(Parser)]
#[command(version)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Print what a G-code program asks of the machine, one canonical command on a line
    Canon {
        /// The program; `-` for standard input
        file: PathBuf,
    },
}

/// Does what the arguments say.
pub fn run() -> ExitCode {
    let Args { command: Command::Canon { file } } = Args::parse();
    match canon(&file) {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever reads has seen enough.
        Err(Failure::Io(error)) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(failure) => {
            let between = if matches!(failure, Failure::Io(_)) { ": " } else { ":" };
            eprintln!("{}{between}{}", file.display(), failure.text());
            ExitCode::FAILURE
        }
    }
}

enum Failure {
    Io(io::Error),
    Refused(Refusal),
}

impl Failure {
    fn text(&self) -> String {
        match self {
            Self::Io(error) => error.to_string(),
            Self::Refused(refusal) => refusal.to_string(),
        }
    }
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// Prints the commands of a program up to a line that is refused.
fn canon(file: &Path) -> Result<(), Failure> {
    let mut out = BufWriter::new(io::stdout().lock());
    let mut reader = Reader::new(Usual);
    for (number, line) in (1..).zip(open(file)?.split(b'\n')) {
        let line = line?;
        if let Err(status) = reader.read(&line) {
            out.flush()?;
            return Err(Failure::Refused(Refusal::new(number, status, &line)));
        }
        for command in &mut reader {
            writeln!(out, "{command}")?;
        }
    }
    Ok(out.flush()?)
}

fn open(file: &Path) -> io::Result<Box<dyn BufRead>> {
    Ok(match file.as_os_str() == "-" {
        true => Box::new(io::stdin().lock()),
        false => Box::new(BufReader::new(File::open(file)?)),
    })
}
