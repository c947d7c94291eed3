//! An independent reading of G-code: runs a NIST-derived interpreter over `tests/nist/*.ngc`, and writes the motion
//! of each program beside it.
//!
//! | module | purpose |
//! |---|---|
//! | [`fetch`] | gets the interpreter from the distribution's packages |
//! | [`oracle`] | runs it over a program |
//! | [`canon`] | reads a line of its output |
//! | [`place`] | the position of the machine: units, systems, lengths |
//! | [`motion`] | the normalised motion |
//! | [`random`] | random programs, made with [`dice`] |
//!
//! `tests/nist/README.md` describes the files and their format. Neither the tests nor the checks use this module:
//! they use the motions that are stored in the repository.

mod canon;
mod dice;
mod fetch;
mod motion;
mod oracle;
mod place;
mod random;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use oracle::Oracle;
use random::Program;

use crate::process::{root, run as run_command};

/// Arguments of `cargo xtask nist`.
#[derive(clap::Args)]
pub struct Args {
    /// Write nothing: fail where a motion differs from what the interpreter makes now
    #[arg(long)]
    check: bool,
    /// Instead, make N random programs and check that Kerf agrees with the interpreter about them
    #[arg(long, value_name = "N", conflicts_with = "check")]
    random: Option<u64>,
    /// The first program's seed
    #[arg(long, default_value_t = 1, requires = "random")]
    seed: u64,
}

/// Writes or checks the motion of every program.
pub fn run(args: &Args) -> Result<()> {
    let oracle = fetch::oracle()?;
    if let Some(count) = args.random {
        return random(&oracle, args.seed..args.seed + count);
    }
    let programs = programs()?;
    let (mut refused, mut differ) = (0, 0);
    for program in &programs {
        match oracle.motion(program) {
            Ok(motion) => differ += usize::from(!store(program, &motion, args.check)?),
            Err(error) => {
                refused += 1;
                println!("{}: {error:#}", name(program));
            }
        }
    }
    println!("{} programs, {differ} motions differ, {}", programs.len(), oracle.version);
    ensure!(refused == 0, "{refused} programs are refused");
    ensure!(!args.check || differ == 0, "{differ} motions differ");
    Ok(())
}

/// Makes random programs and their motions, and runs Kerf's tests to compare.
fn random(oracle: &Oracle, seeds: std::ops::Range<u64>) -> Result<()> {
    let dir = root().join("target/nist/random");
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir)?;
    let mut refused = 0;
    for seed in seeds {
        let program = dir.join(format!("{seed}.ngc"));
        fs::write(&program, Program::of(seed))?;
        match oracle.motion(&program) {
            Ok(motion) => fs::write(program.with_extension("motion"), motion)?,
            Err(error) => {
                refused += 1;
                println!("{}: {error:#}", name(&program));
            }
        }
    }
    ensure!(refused == 0, "{refused} programs are refused");
    let test = ["test", "--package", "kerf", "--test", "host", "nist::", "--", "--ignored"];
    run_command(Command::new("cargo").args(test).current_dir(root()))
}

/// The programs, in the order of their names.
fn programs() -> Result<Vec<PathBuf>> {
    let dir = root().join("tests/nist");
    let entries = fs::read_dir(&dir).with_context(|| dir.display().to_string())?;
    let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|file| file.extension().is_some_and(|ending| ending == "ngc"));
    files.sort();
    Ok(files)
}

/// Writes a program's motion, unless it is only checked. Returns whether the stored motion was right.
fn store(program: &Path, motion: &str, check: bool) -> Result<bool> {
    let file = program.with_extension("motion");
    let old = fs::read_to_string(&file).unwrap_or_default();
    if old == motion {
        return Ok(true);
    }
    println!("{}: {}", name(&file), difference(&old, motion));
    if !check {
        fs::write(&file, motion).with_context(|| file.display().to_string())?;
    }
    Ok(false)
}

fn name(file: &Path) -> String {
    file.strip_prefix(root()).unwrap_or(file).display().to_string()
}

/// Returns the first difference between two motions.
fn difference(old: &str, new: &str) -> String {
    let (mut old, mut new) = (old.lines(), new.lines());
    let mut number = 0;
    loop {
        number += 1;
        match (old.next(), new.next()) {
            (None, None) => return "no line differs".to_owned(),
            (old, new) if old == new => {}
            (old, new) => {
                let shown = |line: Option<&str>| line.unwrap_or("nothing").to_owned();
                return format!("line {number} was {}, is {}", shown(old), shown(new));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_program_has_its_motion() {
        let programs = programs().unwrap();
        assert!(!programs.is_empty());
        let bare = programs.iter().filter(|file| !file.with_extension("motion").is_file());
        assert_eq!(bare.collect::<Vec<_>>(), Vec::<&PathBuf>::new());
    }

    #[test]
    fn the_first_difference_is_told() {
        assert_eq!(difference("a\nb\n", "a\nc\n"), "line 2 was b, is c");
        assert_eq!(difference("a\n", "a\nc\n"), "line 2 was nothing, is c");
    }
}
