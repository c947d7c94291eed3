//! Gets the senders by npm and pip, into `target/senders`.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::npm;
use crate::process::{root, run};
use crate::setup::python;

/// The folder of the Python environment that most senders in Python are installed in.
const PYTHON: &str = "python";

/// A Python environment with packages of PyPI.
struct Packages {
    /// The list of the packages, as pip reads it, in the folder of the drivers.
    list: &'static str,
    /// The folder of the environment.
    folder: &'static str,
    /// Whether pip also installs the dependencies of the listed packages.
    with_all: bool,
}

const PACKAGES: [Packages; 2] = [
    // bCNC depends on packages that only its window needs.
    Packages { list: "requirements.txt", folder: PYTHON, with_all: false },
    // OctoPrint depends on certain versions of other packages.
    Packages { list: "requirements-octoprint.txt", folder: "octoprint", with_all: true },
];

/// Installs the senders, unless an earlier run has done so, and returns their folder. Install scripts of npm packages
/// do not run: the script of `g2core-api` builds a serial port that is too old to build.
pub fn senders() -> Result<PathBuf> {
    let folder = npm::install("senders", &drivers())?;
    for packages in &PACKAGES {
        packages.install(&folder)?;
    }
    Ok(folder)
}

/// Returns the Python that runs the drivers in Python, in the folder of [`senders`].
pub fn python_of(folder: &Path) -> PathBuf {
    folder.join(PYTHON).join("bin/python")
}

impl Packages {
    /// Installs the packages, unless an earlier run has done so.
    fn install(&self, folder: &Path) -> Result<()> {
        let wanted = drivers().join(self.list);
        let wanted =
            std::fs::read_to_string(&wanted).with_context(|| wanted.display().to_string())?;
        let stamp = folder.join(format!("installed-{}", self.list));
        if std::fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
            return Ok(());
        }
        eprintln!("installing packages of PyPI into {}: this once", folder.display());
        std::fs::write(folder.join(self.list), &wanted)?;
        let python = python().context("no Python with venv")?;
        run(Command::new(python).args(["-m", "venv", "--clear", self.folder]).current_dir(folder))?;
        let mut pip = Command::new(folder.join(self.folder).join("bin/python"));
        pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
        if !self.with_all {
            pip.arg("--no-deps");
        }
        run(pip.args(["-r", self.list]).current_dir(folder))?;
        Ok(std::fs::write(stamp, wanted)?)
    }
}

/// Returns the folder of the drivers.
pub fn drivers() -> PathBuf {
    root().join("tests/senders")
}
