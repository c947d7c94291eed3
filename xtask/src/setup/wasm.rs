//! Rust's library for WebAssembly, for the cargo that runs this: rustup brings it, which needs no rights. Without rustup it is named as missing, for Debian
//! has none that is new enough.

use std::path::Path;
use std::process::Command;

use anyhow::{Result, ensure};

use crate::process::{probe, run, which};

/// The target.
pub const TARGET: &str = "wasm32-unknown-unknown";
/// How rustup brings its library.
const RUSTUP: &str = "rustup target add wasm32-unknown-unknown";

/// Makes sure that it is there; silent when it is.
pub fn ensure() -> Result<()> {
    if is_there() {
        return Ok(());
    }
    if which("rustup").is_some() {
        eprintln!("setup: {RUSTUP}");
        // What counts is what is there afterwards.
        let _ = run(Command::new("rustup").args(["target", "add", TARGET]));
    }
    ensure!(
        is_there(),
        "Rust's library for {TARGET} is missing; with Rust from https://rustup.rs:\n  {RUSTUP}"
    );
    Ok(())
}

/// Whether the `rustc` of this cargo has it.
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
