//! Rust's library for WebAssembly, for the cargo that runs this: rustup brings it, which needs no rights, or Debian.

use std::path::Path;
use std::process::Command;

use anyhow::{Result, ensure};

use super::install::{self, Means, Step};
use crate::process::probe;

/// The target.
pub const TARGET: &str = "wasm32-unknown-unknown";
/// How rustup brings its library.
const RUSTUP: &str = "rustup target add wasm32-unknown-unknown";
/// What Debian calls it, beside its `rustc-web`.
const PACKAGE: &str = "libstd-rust-web-dev-wasm32";

/// Makes sure that it is there; silent when it is.
pub fn ensure(means: Means) -> Result<()> {
    if is_there() {
        return Ok(());
    }
    eprintln!("setup: missing:\n  Rust's library for {TARGET}");
    install::execute(&steps(means));
    ensure!(is_there(), "Rust's library for {TARGET} is missing; to install it:\n  {RUSTUP}");
    Ok(())
}

fn steps(means: Means) -> Vec<Step> {
    match means.rustup {
        true => vec![Step { command: RUSTUP.into(), otherwise: None }],
        false => install::of_debian(means, PACKAGE).into_iter().collect(),
    }
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
