//! `cargo xtask fuzz`: builds the fuzzers (`tests/fuzz`) with coverage counters and runs them.
//!
//! Any Rust works: the counters are LLVM's, and stable options switch them on. Results are kept in `target/fuzz`: the
//! corpus, from which the next run continues, and findings, which it tries first.

mod seeds;
mod session;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Duration;

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};

use crate::process::{host_cargo, output, root, run as run_child};
use crate::setup::{self, Scope};
use session::Session;

/// The flags that make LLVM insert the counters, as in cargo-fuzz.
const FLAGS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
                     -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
                     -Cllvm-args=-sanitizer-coverage-pc-table \
                     -Cllvm-args=-simplifycfg-branch-fold-threshold=0 -Ccodegen-units=1";

/// The flag that also reports which values are compared.
const COMPARES: &str = "-Cllvm-args=-sanitizer-coverage-trace-compares";

/// `cargo xtask fuzz`
#[derive(Args)]
pub struct FuzzArgs {
    /// How long each target runs
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..))]
    minutes: u64,
    /// Only this target: lines for the interpreter, or bytes for the machine's serial line
    #[arg(long, value_enum)]
    target: Option<Target>,
}

/// What is fuzzed: a program of `tests/fuzz`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Target {
    Lines,
    Serial,
}

impl Target {
    fn name(self) -> &'static str {
        match self {
            Target::Lines => "lines",
            Target::Serial => "serial",
        }
    }

    /// The longest input, in bytes.
    fn longest(self) -> usize {
        match self {
            Target::Lines => 1_000,
            Target::Serial => 2_000,
        }
    }

    /// Returns the flags of the target. With the compared values a machine takes three times as long, so the serial
    /// target goes without them and uses the dictionary.
    fn flags(self) -> String {
        match self {
            Target::Lines => format!("{FLAGS} {COMPARES}"),
            Target::Serial => FLAGS.to_owned(),
        }
    }

    /// Number of inputs after which the fuzzer restarts; `None` for never. Each machine leaks 9 KB.
    fn runs(self) -> Option<u64> {
        (self == Target::Serial).then_some(200_000)
    }

    /// The first bytes of its inputs.
    fn prefixes(self) -> &'static [&'static str] {
        match self {
            Target::Lines => &[""],
            // Line after line, and all at once.
            Target::Serial => &["0", "1"],
        }
    }

    /// Returns the folder for one kind of its files.
    fn folder(self, what: &str) -> PathBuf {
        home().join(what).join(self.name())
    }
}

/// Returns the folder for all files of the fuzzers except sources.
fn home() -> PathBuf {
    root().join("target/fuzz")
}

/// Builds and runs the targets, and prints the results. Fails if anything was found.
pub fn run(args: &FuzzArgs) -> Result<ExitCode> {
    setup::ensure(Scope::Fuzzers)?;
    let targets = args.target.map_or_else(|| Target::value_variants().to_vec(), |one| vec![one]);
    let mut sessions = Vec::new();
    for target in targets {
        seeds::write(target)?;
        println!("\n=== {} for {} min ===", target.name(), args.minutes);
        let program = build(target)?;
        let time = Duration::from_secs(args.minutes * 60);
        sessions.push((Session::run(target, &program, time)?, target, program));
    }
    println!();
    sessions.iter().for_each(|(session, target, program)| session.tell(*target, program));
    let clean = sessions.iter().all(|(session, ..)| session.findings.is_empty());
    Ok(if clean { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Builds a fuzzer; returns its path. The host is named as the target, so that the flags apply to the fuzzer only and
/// not to programs that run during the build.
fn build(target: Target) -> Result<PathBuf> {
    let host = host()?;
    let folder = home().join("build");
    let mut cargo = host_cargo();
    cargo
        .current_dir(root())
        .env("RUSTFLAGS", target.flags())
        .env_remove("CARGO_ENCODED_RUSTFLAGS");
    cargo.args(["build", "--package", "kerf-fuzz", "--features", "libfuzzer"]);
    cargo.args(["--bin", target.name()]);
    cargo.args(["--profile", "fuzz", "--target", &host, "--target-dir"]).arg(&folder);
    run_child(&mut cargo)?;
    Ok(folder.join(host).join("fuzz").join(target.name()))
}

/// Returns Rust's name for the computer's architecture and system.
fn host() -> Result<String> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let text = output(Command::new(rustc).arg("-vV"))?;
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned).context("rustc does not tell its host")
}

/// Creates a folder if it does not exist.
fn make(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))
}
