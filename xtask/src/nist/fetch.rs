//! Gets the interpreter from the distribution's packages, without installing them.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use super::oracle::Oracle;
use crate::process::{output, root, run, which};

/// The package with the interpreter, named as in Debian 12.
const MAIN: &str = "linuxcnc-uspace";
/// The libraries that the interpreter needs and that a plain installation lacks.
const LIBRARIES: [&str; 7] = [
    "libboost-python1.74.0",
    "libpython3.11",
    "libpython3.11-stdlib",
    "libpython3.11-minimal",
    "libedit2",
    "libbsd0",
    "libtirpc3",
];

/// Returns the interpreter. Fetches it unless an earlier run has done so.
pub fn oracle() -> Result<Oracle> {
    let dir = root().join("target/nist");
    let stamp = dir.join("version");
    if !stamp.is_file() {
        let version = fetch(&dir)?;
        std::fs::write(&stamp, version)?;
    }
    let version = std::fs::read_to_string(&stamp)?.trim().to_owned();
    Ok(Oracle { root: dir.join("root"), work: dir.join("work"), version })
}

/// Downloads and unpacks the packages; returns the version.
fn fetch(dir: &Path) -> Result<String> {
    for tool in ["apt-get", "dpkg-deb"] {
        ensure!(
            which(tool).is_some(),
            "`{tool}` is missing: {MAIN} comes as a package of Debian 12"
        );
    }
    // Removes what an interrupted run has left behind.
    let _ = std::fs::remove_dir_all(dir);
    let packages = dir.join("packages");
    std::fs::create_dir_all(&packages)?;
    let mut download = Command::new("apt-get");
    download.arg("download").arg(MAIN).args(LIBRARIES).current_dir(&packages);
    run(&mut download).context("cannot get Debian 12's packages (is `apt-get update` needed?)")?;
    unpack(&packages, &dir.join("root"))
}

fn unpack(packages: &Path, root: &Path) -> Result<String> {
    let mut version = None;
    for entry in std::fs::read_dir(packages)? {
        let package = entry?.path();
        run(Command::new("dpkg-deb").arg("-x").arg(&package).arg(root))?;
        if package.file_name().is_some_and(|name| name.to_string_lossy().starts_with(MAIN)) {
            let show = "--showformat=${Package} ${Version}";
            version = Some(output(Command::new("dpkg-deb").arg("-W").arg(show).arg(&package))?);
        }
    }
    version.context("the interpreter's package is not among those that came")
}
