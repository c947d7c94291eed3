//! Runs the interpreter over a program.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use super::motion::Motion;

/// Settings of the interpreter: millimetres, and nothing else.
const SETTINGS: &str = "[TRAJ]\nLINEAR_UNITS = mm\nANGULAR_UNITS = degree\n[RS274NGC]\n";
/// Number of tools in the table, all without length. `G10 L1` only changes existing tools.
const TOOLS: usize = 9;

/// The interpreter: the folder where it was unpacked, and a folder where it may write.
pub struct Oracle {
    /// The unpacked packages.
    pub root: PathBuf,
    /// The folder for the files that it needs.
    pub work: PathBuf,
    /// Name and version of the package.
    pub version: String,
}

impl Oracle {
    /// Returns the normalised motion of a program that starts at the machine's origin with everything reset.
    pub fn motion(&self, program: &Path) -> Result<String> {
        self.reset()?;
        let output = self.command(program).output().context("cannot run the interpreter")?;
        let canon = String::from_utf8_lossy(&output.stdout);
        let said = String::from_utf8_lossy(&output.stderr);
        ensure!(output.status.success(), "the interpreter refuses it: {}", said.trim());
        Motion::of(&canon)
    }

    /// Writes new files for the interpreter, because it changes its files at the end of each program.
    fn reset(&self) -> Result<()> {
        let _ = fs::remove_dir_all(&self.work);
        fs::create_dir_all(&self.work)?;
        let tools: String = (1..=TOOLS).map(|n| format!("T{n} P{n} Z0 D0\n")).collect();
        for (name, text) in [("ini", SETTINGS), ("var", ""), ("tbl", &tools)] {
            fs::write(self.work.join(name), text)?;
        }
        Ok(())
    }

    fn command(&self, program: &Path) -> Command {
        let lib = self.root.join("usr/lib");
        let triple = format!("{}-linux-gnu", std::env::consts::ARCH);
        let libs = std::env::join_paths([lib.join(triple), lib]).expect("a path without a colon");
        let mut command = Command::new(self.root.join("usr/bin/rs274"));
        command.args(["-g", "-i", "ini", "-v", "var", "-t", "tbl"]).arg(program);
        command.env("LD_LIBRARY_PATH", libs).env("PYTHONHOME", self.root.join("usr"));
        command.current_dir(&self.work).stdin(Stdio::null());
        command
    }
}
