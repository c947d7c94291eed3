//! Chips emulated in JavaScript: a package of npm, and our own program around it. The RP2040 is rp2040js
//! (`tests/rp2040/emulator`), the second simulator of AVR is avr8js (`tests/avr/emulator`).

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};

use crate::npm;
use crate::process::{root, run};

/// An emulator.
pub struct Emulator {
    /// Its folder in `target`, where `kerf-sim` looks for it beside the images.
    folder: &'static str,
    /// The folder with the list of packages, and with our own files in `emulator`.
    sources: &'static str,
}

/// The emulator of the RP2040.
pub const RP2040: Emulator = Emulator { folder: "rp2040-emulator", sources: "tests/rp2040" };
/// The second simulator of AVR.
pub const AVR: Emulator = Emulator { folder: "avr-emulator", sources: "tests/avr" };

impl Emulator {
    /// Installs the emulator. Programs look for packages of npm beside themselves, so our own files are copied there.
    pub fn install(&self) -> Result<PathBuf> {
        let sources = root().join(self.sources);
        let folder = npm::install(self.folder, &sources)?;
        for file in fs::read_dir(sources.join("emulator"))? {
            let path = file?.path();
            let name = path.file_name().unwrap_or_default();
            fs::copy(&path, folder.join(name)).with_context(|| path.display().to_string())?;
        }
        Ok(folder)
    }

    /// Runs the tests of our corrections.
    pub fn test(&self) -> Result<()> {
        let folder = self.install()?;
        run(Command::new("node").args(["--test", "."]).current_dir(folder))
    }
}
