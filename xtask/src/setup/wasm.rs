//! Rust's library for WebAssembly, for the cargo that runs this program. rustup installs it without special rights.
//! Without rustup it is reported as missing, because Debian has no library that is new enough.

use std::path::Path;
use std::process::Command;

use anyhow::{Result, ensure};

use crate::process::{probe, run, which};

/// The target.
pub const TARGET: &str = "wasm32-unknown-unknown";
/// The command by which rustup installs its library.
const RUSTUP: &str = "rustup target add wasm32-unknown-unknown";

/// Makes sure that the library is there. Prints nothing if it is.
pub fn ensure() -> Result<()> {
    if is_there() {
        return Ok(());
    }
    if which("rustup").is_some() {
        eprintln!("setup: {RUSTUP}");
        // An error is ignored, because only the presence of the library afterwards counts.
        let _ = run(Command::new("rustup").args(["target", "add", TARGET]));
    }
    ensure!(
        is_there(),
        "Rust's library for {TARGET} is missing; with Rust from https://rustup.rs:\n  {RUSTUP}"
    );
    Ok(())
}

/// Whether the `rustc` of this cargo has the library.
fn is_there() -> bool {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let mut ask = Command::new(rustc);
    ask.args(["--print", "target-libdir", "--target", TARGET]);
    probe(&mut ask).is_some_and(|dir| holds_std(Path::new(&dir)))
}

fn holds_std(dir: &Path) -> bool {
    let mut entries = std::fs::read_dir(dir).into_iter().flatten().flatten();
    entries.any(|file| file.file_name().to_string_lossy().starts_with("libstd-"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_folder_is_no_library() {
        assert!(!holds_std(Path::new("/nonexistent")));
    }
}
