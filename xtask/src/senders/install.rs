//! Gets the senders by npm and pip, into `target/senders`.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::npm;
use crate::process::{root, run};
use crate::setup::python;

/// What is to be installed, as pip reads it.
const REQUIREMENTS: &str = "requirements.txt";
/// The folder of the Python that has it.
const PYTHON: &str = "python";

/// The folder that the senders are installed in, which they are unless an earlier run did it. No scripts of npm's run: `g2core-api` has one that builds a
/// serial port too old to build.
pub fn senders() -> Result<PathBuf> {
    let folder = npm::install("senders", &drivers())?;
    install_for_python(&folder)?;
    Ok(folder)
}

/// The Python that the senders in Python are installed for, in the folder of [`senders`].
pub fn python_of(folder: &Path) -> PathBuf {
    folder.join(PYTHON).join("bin/python")
}

/// Installs what the drivers' list for pip names, unless an earlier run did it.
fn install_for_python(folder: &Path) -> Result<()> {
    let wanted = drivers().join(REQUIREMENTS);
    let wanted = std::fs::read_to_string(&wanted).with_context(|| wanted.display().to_string())?;
    let stamp = folder.join("installed.txt");
    if std::fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
        return Ok(());
    }
    eprintln!("installing packages of PyPI into {}: this once", folder.display());
    std::fs::write(folder.join(REQUIREMENTS), &wanted)?;
    let python = python().context("no Python with venv")?;
    run(Command::new(python).args(["-m", "venv", "--clear", PYTHON]).current_dir(folder))?;
    let mut pip = Command::new(python_of(folder));
    pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
    // bCNC asks for packages that only its window needs.
    run(pip.args(["--no-deps", "-r", REQUIREMENTS]).current_dir(folder))?;
    Ok(std::fs::write(stamp, wanted)?)
}

/// Where the drivers lie.
pub fn drivers() -> PathBuf {
    root().join("tests/senders")
}
