//! Packages of npm, in a folder below `target`, installed once for each version of the list.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::process::{root, run};

/// The list of packages to install, as npm reads it.
const PACKAGES: &str = "package.json";

/// Installs the packages that the `package.json` in the folder `list` names, unless an earlier run has done so.
/// Returns the folder with `node_modules`, which is `target/NAME`. Install scripts of packages do not run.
pub fn install(name: &str, list: &Path) -> Result<PathBuf> {
    let folder = root().join("target").join(name);
    let wanted = list.join(PACKAGES);
    let wanted = std::fs::read_to_string(&wanted).with_context(|| wanted.display().to_string())?;
    let stamp = folder.join("installed.json");
    if std::fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
        return Ok(folder);
    }
    eprintln!("installing packages of npm into {}: this once", folder.display());
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join(PACKAGES), &wanted)?;
    let mut npm = Command::new("npm");
    npm.args(["install", "--ignore-scripts", "--no-audit", "--no-fund", "--no-package-lock"]);
    run(npm.args(["--loglevel", "error"]).current_dir(&folder))?;
    std::fs::write(stamp, wanted)?;
    Ok(folder)
}
