//! `cargo xtask dist`: the files of a release, in `target/dist`.
//!
//! For each board there is a `.hex` that avrdude takes, or the `.uf2` of a boot loader, made from the image that the
//! tests run. Further files are the settings as a JSON schema, the licences, and checksums of all files.

pub mod hex;
mod sha256;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::boards::Board;
use crate::firmware;
use crate::machines::Machine;
use crate::process::root;
use crate::rp2040::uf2;
use crate::setup::{self, Scope};

/// Files that are copied from the repository unchanged.
const COPIED: [&str; 5] =
    ["docs/settings.schema.json", "LICENSE-MIT", "LICENSE-APACHE", "CHANGELOG.md", "README.md"];
/// The checksums, as `sha256sum --check` reads them.
const SUMS: &str = "SHA256SUMS";

/// Builds the images, and writes the files.
pub fn run() -> Result<()> {
    setup::ensure(Scope::Arm)?;
    let folder = root().join("target/dist");
    if folder.exists() {
        fs::remove_dir_all(&folder)
            .with_context(|| format!("cannot empty {}", folder.display()))?;
    }
    fs::create_dir_all(&folder)?;
    let mut written = Vec::new();
    for board in Board::all() {
        let elf = firmware::build(*board, Machine::default())?;
        let image = fs::read(&elf)?;
        let (kind, bytes) = match board.is_rp2040() {
            true => ("uf2", uf2::of_elf(&image)?),
            false => ("hex", hex::of_elf(&image)?.into()),
        };
        let path = folder.join(format!("kerf-{board}.{kind}"));
        fs::write(&path, bytes)?;
        written.push(path);
    }
    for file in COPIED {
        let path = folder.join(Path::new(file).file_name().unwrap_or_default());
        fs::copy(root().join(file), &path).with_context(|| format!("no {file}"))?;
        written.push(path);
    }
    fs::write(folder.join(SUMS), sums(&written)?)?;
    for path in &written {
        println!("{}", path.display());
    }
    println!("dist: {}", folder.display());
    Ok(())
}

/// Returns a line for each file: its checksum and its name.
fn sums(files: &[PathBuf]) -> Result<String> {
    let mut text = String::new();
    for file in files {
        let bytes = fs::read(file)?;
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        text += &format!("{}  {name}\n", sha256::hexadecimal(&bytes));
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_copied_is_there() {
        for file in COPIED {
            assert!(root().join(file).is_file(), "{file}");
        }
    }

    #[test]
    fn sums_are_as_sha256sum_writes_them() {
        let file = root().join("target/tmp/abc.hex");
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, "abc").unwrap();
        let sum = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sums(&[file]).unwrap(), format!("{sum}  abc.hex\n"));
    }

    /// The release's workflow names the files that are written here.
    #[test]
    fn the_workflow_runs_the_checks_and_attaches_the_files() {
        let workflow = fs::read_to_string(root().join(".github/workflows/ci.yml")).unwrap();
        for part in [".ci/run", "cargo xtask dist", "target/dist/*", "tags:"] {
            assert!(workflow.contains(part), "{part}");
        }
    }
}
