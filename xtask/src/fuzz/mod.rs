//! `cargo xtask fuzz`: builds the fuzzers (`tests/fuzz`) with coverage counters and runs them.
//!
//! Any Rust does: the counters are LLVM's, and stable options switch them on. What is found out is kept
//! in `target/fuzz`: the corpus, from which the next run goes on, and findings, which it tries first.

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

/// What makes LLVM put the counters in; as cargo-fuzz has it.
const FLAGS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
                     -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
                     -Cllvm-args=-sanitizer-coverage-pc-table \
                     -Cllvm-args=-simplifycfg-branch-fold-threshold=0 -Ccodegen-units=1";

/// What makes it tell what values are compared, too.
const COMPARES: &str = "-Cllvm-args=-sanitizer-coverage-trace-compares";

/// `cargo xtask fuzz`
#[derive(Args)]
pub struct FuzzArgs {
    /// How long each target runs
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..))]
    minutes: u64,
    /// This target only: lines for the interpreter, or bytes for the machine's serial line
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

    /// With the values compared a machine takes three times as long; it has the words to try instead.
    fn flags(self) -> String {
        match self {
            Target::Lines => format!("{FLAGS} {COMPARES}"),
            Target::Serial => FLAGS.to_owned(),
        }
    }

    /// After how many inputs it begins anew, if ever: each machine leaves 9 KB behind.
    fn runs(self) -> Option<u64> {
        (self == Target::Serial).then_some(200_000)
    }

    /// What its inputs begin with.
    fn prefixes(self) -> &'static [&'static str] {
        match self {
            Target::Lines => &[""],
            // Line after line, and all at once.
            Target::Serial => &["0", "1"],
        }
    }

    /// Where it keeps something.
    fn folder(self, what: &str) -> PathBuf {
        home().join(what).join(self.name())
    }
}

/// Everything of the fuzzers that is no source.
fn home() -> PathBuf {
    root().join("target/fuzz")
}

/// Builds and runs the targets, and tells what came of it. Fails if anything was found.
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

/// Builds a fuzzer; where it lies. The host is named, so that the flags are for them alone and not for
/// what is run to build them.
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

/// What Rust calls this machine.
fn host() -> Result<String> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let text = output(Command::new(rustc).arg("-vV"))?;
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned).context("rustc does not tell its host")
}

/// A folder that is there.
fn make(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))
}
