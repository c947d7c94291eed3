//! The emulator of the chip: rp2040js from npm, and our own program (`tests/rp2040/emulator`).

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};

use crate::npm;
use crate::process::{root, run};

/// Its folder in `target`, where `kerf-sim` looks for it beside the images.
const FOLDER: &str = "rp2040-emulator";

/// Installs the emulator. Programs look for packages of npm beside themselves, so our own files are copied there.
pub fn install() -> Result<PathBuf> {
    let sources = root().join("tests/rp2040");
    let folder = npm::install(FOLDER, &sources)?;
    for file in fs::read_dir(sources.join("emulator"))? {
        let path = file?.path();
        let name = path.file_name().unwrap_or_default();
        fs::copy(&path, folder.join(name)).with_context(|| path.display().to_string())?;
    }
    Ok(folder)
}

/// Runs the tests of our corrections to rp2040js.
pub fn test() -> Result<()> {
    let folder = install()?;
    run(Command::new("node").args(["--test", "."]).current_dir(folder))
}
