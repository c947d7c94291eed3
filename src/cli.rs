//! The command line on the host: checks a program, or prints its canonical commands.

mod check;

use std::fs::File;
use std::io::{self, BufRead, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use kerf::canon::{Reader, Refusal};
use kerf::gcode::setup::Usual;

use check::Question;

/// Motion-control firmware; `cargo xtask build` builds the image for a board
#[derive(Parser)]
#[command(version)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Dry run: carry a job out on the host, and say which lines are refused, how far the axes go, and how long it
    /// takes
    Check {
        /// The job; `-` for standard input
        file: PathBuf,
        /// The profile of the machine: careful, router, mill, printer, lathe
        #[arg(long, default_value = "careful")]
        machine: String,
        /// The dialect of the job: tinyg, grbl, reprap. Without it the file decides: reprap if it heats or extrudes,
        /// grbl if it has commands such as $H, else tinyg
        #[arg(long)]
        dialect: Option<String>,
        /// A setting sent before the job, as the sender would: '{"xvm":800}'
        #[arg(long, value_name = "JSON")]
        set: Vec<String>,
        /// Where the work zero is in machine coordinates, mm: 50,50,-30
        #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
        zero: Option<String>,
    },
    /// Print what a G-code program asks of the machine, one canonical command on a line
    Canon {
        /// The program; `-` for standard input
        file: PathBuf,
    },
}

/// Runs the command that the arguments name.
pub fn run() -> ExitCode {
    let file = match Args::parse().command {
        Command::Check { file, machine, dialect, set, zero } => {
            let (machine, dialect, settings) = (&machine, dialect.as_deref(), &set);
            let question = Question { machine, dialect, settings, zero: None };
            return check(&file, question, zero.as_deref());
        }
        Command::Canon { file } => file,
    };
    match canon(&file) {
        Ok(()) => ExitCode::SUCCESS,
        // The reader of the pipe, `head` for example, has closed it. That is no failure.
        Err(Failure::Io(error)) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(failure) => {
            let between = if matches!(failure, Failure::Io(_)) { ": " } else { ":" };
            eprintln!("{}{between}{}", file.display(), failure.text());
            ExitCode::FAILURE
        }
    }
}

/// Prints the result of a dry run. Fails if the machine would not carry the job out.
fn check(file: &Path, question: Question, zero: Option<&str>) -> ExitCode {
    let answer = read(file).map_err(|error| error.to_string()).and_then(|job| {
        let zero = zero.map(place).transpose()?;
        check::check(&job, &Question { zero, ..question })
    });
    match answer {
        Ok(answer) => {
            print!("{answer}");
            if answer.is_good() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(error) => {
            eprintln!("{}: {error}", file.display());
            ExitCode::FAILURE
        }
    }
}

/// Parses a place that is written as `X,Y,Z`.
fn place(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    numbers.try_into().map_err(|_| format!("{text} is no place: X,Y,Z"))
}

fn read(file: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(file)?.read_to_end(&mut bytes)?;
    Ok(bytes)
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

/// Prints the commands of a program. Stops with an error at the first line that is refused.
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
