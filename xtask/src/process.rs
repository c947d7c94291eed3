//! Child processes, and the root of the repository.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, ExitStatus, Stdio};
use std::sync::LazyLock;

use anyhow::{Context, Result, ensure};

/// Returns the repository's root, found at run time.
///
/// Cargo considers a target folder that was copied with its checkout up to date. A path fixed at compile time would
/// then be that of the original checkout.
pub fn root() -> &'static Path {
    static ROOT: LazyLock<PathBuf> = LazyLock::new(|| {
        let program = std::env::current_exe().unwrap_or_default();
        find_root(std::env::var_os("CARGO_MANIFEST_DIR"), &program)
            .expect("start me by `cargo xtask` in the repository")
    });
    &ROOT
}

/// Returns the repository of the package that cargo has started; else that of the program in its target folder.
fn find_root(package: Option<OsString>, program: &Path) -> Option<PathBuf> {
    let package = package.map(PathBuf::from).filter(|dir| dir.ends_with("xtask"));
    let starts = package.iter().map(PathBuf::as_path).chain([program]);
    let mut folders = starts.flat_map(|start| start.ancestors().skip(1));
    folders.find(|dir| dir.join("xtask/Cargo.toml").is_file()).map(Path::to_owned)
}

/// Returns the cargo that started this program, for everything that runs on the host.
pub fn host_cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// Runs a command to its end. The error of a failure names the program.
pub fn run(command: &mut Command) -> Result<()> {
    let status = status(command)?;
    ensure!(status.success(), "`{}` failed ({status})", shown(command));
    Ok(())
}

/// Runs a command to its end and returns its status.
pub fn status(command: &mut Command) -> Result<ExitStatus> {
    command.status().with_context(|| format!("cannot run `{}`", shown(command)))
}

/// Runs a command to its end and passes its exit code on.
pub fn pass_through(command: &mut Command) -> Result<ExitCode> {
    let status = status(command)?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    Ok(code.map_or(ExitCode::FAILURE, ExitCode::from))
}

/// Replaces this process by the program where the system supports it. Killing the process by its number then ends the
/// program, and no child is left.
pub fn become_program(command: &mut Command) -> Result<ExitCode> {
    #[cfg(unix)]
    {
        use std::os::unix::process::CommandExt;
        Err(command.exec()).with_context(|| format!("cannot run `{}`", shown(command)))
    }
    #[cfg(not(unix))]
    pass_through(command)
}

/// Runs a command and returns its standard output.
pub fn output(command: &mut Command) -> Result<String> {
    let output = command.stdin(Stdio::null()).stderr(Stdio::inherit()).output();
    let output = output.with_context(|| format!("cannot run `{}`", shown(command)))?;
    ensure!(output.status.success(), "`{}` failed ({})", shown(command), output.status);
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Runs a command silently and returns its standard output; `None` if it fails.
pub fn probe(command: &mut Command) -> Option<String> {
    let output = command.stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// Returns the path of a program on the search path; `None` if it is not there.
pub fn which(program: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path).map(|dir| dir.join(program)).find(|file| file.is_file())
}

/// Returns the command as one would type it.
pub fn shown(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words.map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder that looks like a checkout of the repository.
    fn checkout(name: &str) -> PathBuf {
        let root = root().join("target/tmp/checkouts").join(name);
        std::fs::create_dir_all(root.join("xtask")).unwrap();
        std::fs::write(root.join("xtask/Cargo.toml"), "").unwrap();
        root
    }

    #[test]
    fn a_copied_checkout_is_its_own_root() {
        let (original, copy) = (checkout("original"), checkout("copy"));
        let package = |root: &Path| Some(root.join("xtask").into_os_string());
        let program = |root: &Path| root.join("target/debug/xtask");
        assert_eq!(find_root(package(&copy), &program(&copy)).as_ref(), Some(&copy));
        // Cargo's information is used, because the target folder may be anywhere.
        assert_eq!(find_root(package(&copy), &program(&original)).as_ref(), Some(&copy));
        assert_eq!(find_root(None, &program(&copy)).as_ref(), Some(&copy));
        // The program was started by another package's cargo.
        let other = Some(original.clone().into_os_string());
        assert_eq!(find_root(other, &program(&copy)).as_ref(), Some(&copy));
        assert_eq!(find_root(None, Path::new("/xtask")), None);
    }

    /// Macros that fix a path at compile time. The path is wrong in a copied checkout.
    const FIXED_PLACES: [&str; 3] =
        ["env!(\"CARGO_MANIFEST_DIR", "env!(\"CARGO_TARGET_TMPDIR", "env!(\"CARGO_BIN_EXE"];

    #[test]
    fn no_place_is_fixed_at_compile_time() {
        let mut folders: Vec<_> =
            ["src", "macros", "xtask", "tests"].map(|name| root().join(name)).into();
        let mut found = Vec::new();
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|ending| ending == "rs")
                    && !path.ends_with("xtask/src/process.rs")
                {
                    let text = std::fs::read_to_string(&path).unwrap();
                    if FIXED_PLACES.iter().any(|place| text.contains(place)) {
                        found.push(path);
                    }
                }
            }
        }
        assert!(found.is_empty(), "fixed at compile time: {found:?}");
    }
}
