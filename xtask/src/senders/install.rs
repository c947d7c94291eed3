//! Gets the senders by npm, into `target/senders`.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};

use crate::process::{root, run};

/// What is to be installed, as npm reads it.
const PACKAGES: &str = "package.json";

/// The folder that the senders are installed in, which they are unless an earlier run did it.
pub fn senders() -> Result<PathBuf> {
    let folder = root().join("target/senders");
    let wanted = drivers().join(PACKAGES);
    let wanted = std::fs::read_to_string(&wanted).context("tests/senders/package.json")?;
    let stamp = folder.join("installed.json");
    if std::fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
        return Ok(folder);
    }
    eprintln!("installing the senders: some minutes, this once");
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join(PACKAGES), &wanted)?;
    // No scripts: `g2core-api` has one that builds a serial port too old to build.
    let mut npm = Command::new("npm");
    npm.args(["install", "--ignore-scripts", "--no-audit", "--no-fund", "--no-package-lock"]);
    run(npm.args(["--loglevel", "error"]).current_dir(&folder))?;
    std::fs::write(stamp, wanted)?;
    Ok(folder)
}

/// Where the drivers lie.
pub fn drivers() -> PathBuf {
    root().join("tests/senders")
}
