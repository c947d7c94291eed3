//! Finds the Rust that builds the firmware.
//!
//! AVR has no pre-built `core`, so the toolchain must have the sources of its library: a rustup nightly with the
//! component `rust-src`, or the system's own Rust with its source package.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::process::{probe, which};

/// The oldest Rust that Kerf builds with, from the workspace's manifest.
const OLDEST: &str = env!("CARGO_PKG_RUST_VERSION");

/// A Rust that can build for AVR.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Toolchain {
    /// The name for messages.
    pub name: String,
    /// The folder of its `cargo` and `rustc`.
    pub bin: PathBuf,
}

/// What is known of a toolchain.
#[derive(Clone, Copy, Debug)]
struct Facts {
    has_cargo: bool,
    has_sources: bool,
    version: Option<(u32, u32)>,
}

impl Facts {
    fn usable(self) -> bool {
        self.has_cargo && self.has_sources && self.version >= version(OLDEST)
    }
}

impl Toolchain {
    /// Returns the first usable toolchain: rustup's nightlies, newest first, then the system's; `None` if there is
    /// none.
    pub fn find() -> Option<Toolchain> {
        candidates().into_iter().find(|candidate| candidate.facts().usable())
    }

    /// Returns its cargo, in an environment without traces of the cargo that runs this program.
    pub fn cargo(&self) -> Command {
        let mut cargo = self.program("cargo");
        cargo.env("RUSTC", self.bin.join("rustc")).env("RUSTC_BOOTSTRAP", "1");
        cargo
    }

    fn program(&self, name: &str) -> Command {
        let mut command = Command::new(self.bin.join(name));
        clean(&mut command);
        let path = std::env::var_os("PATH").unwrap_or_default();
        let dirs = std::iter::once(self.bin.clone()).chain(std::env::split_paths(&path));
        command.env("PATH", std::env::join_paths(dirs).expect("directories of a search path"));
        command
    }

    fn facts(&self) -> Facts {
        let has_cargo = self.bin.join("cargo").is_file();
        let sysroot = has_cargo.then(|| probe(self.program("rustc").args(["--print", "sysroot"])));
        let library = sysroot.flatten().map(|dir| Path::new(&dir).join(SOURCES));
        let has_sources = library.is_some_and(|library| library.is_dir());
        let text = has_sources.then(|| probe(self.program("rustc").arg("--version"))).flatten();
        let version = text.and_then(|text| version(text.strip_prefix("rustc ")?));
        Facts { has_cargo, has_sources, version }
    }
}

/// The path of `core` below a toolchain's directory.
const SOURCES: &str = "lib/rustlib/src/rust/library/core";

fn candidates() -> Vec<Toolchain> {
    let mut found = Vec::new();
    if which("rustup").is_some()
        && let Some(list) = probe(Command::new("rustup").args(["toolchain", "list", "-v"]))
    {
        found = nightlies(&list);
    }
    found.push(Toolchain { name: "the system's Rust".into(), bin: "/usr/bin".into() });
    found
}

/// Returns the nightlies in rustup's list: the undated one first, then those with a date, newest first.
fn nightlies(list: &str) -> Vec<Toolchain> {
    let rows = list.lines().filter(|row| row.starts_with("nightly"));
    let mut rows: Vec<_> = rows.filter_map(|row| Some((row.split(' ').next()?, row))).collect();
    rows.sort_by_key(|(name, _)| (name.starts_with("nightly-2"), std::cmp::Reverse(*name)));
    let toolchain = |(name, row): (&str, &str)| {
        let start = row.find(['/', '\\'])?;
        let start = if row[..start].ends_with(':') { start - 2 } else { start };
        Some(Toolchain { name: name.into(), bin: Path::new(&row[start..]).join("bin") })
    };
    rows.into_iter().filter_map(toolchain).collect()
}

/// Parses the major and minor number of `1.96.0 (...)` or `1.90`.
fn version(text: &str) -> Option<(u32, u32)> {
    let mut numbers = text.split(['.', ' ', '-']);
    Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
}

/// Removes what the cargo and the rustup around this program have left in the environment.
fn clean(command: &mut Command) {
    for (name, value) in std::env::vars_os() {
        let Some(text) = name.to_str() else { continue };
        if text == "LD_LIBRARY_PATH" {
            match library_path(&value) {
                Some(rest) => command.env(&name, rest),
                None => command.env_remove(&name),
            };
        } else if is_inherited(text) {
            command.env_remove(&name);
        }
    }
}

/// Whether another cargo's child must not see this variable. The user's own settings stay:
/// `CARGO_HOME`, `CARGO_NET_*`, `CARGO_HTTP_*`, `CARGO_TERM_*`, `CARGO_REGISTR*`, `RUSTUP_HOME`.
fn is_inherited(name: &str) -> bool {
    const EXACT: [&str; 8] = [
        "CARGO",
        "RUSTFLAGS",
        "RUSTDOC",
        "RUSTDOCFLAGS",
        "RUST_RECURSION_COUNT",
        "RUSTUP_TOOLCHAIN",
        "RUSTUP_TOOLCHAIN_SOURCE",
        "__CARGO_DEFAULT_LIB_METADATA",
    ];
    const PREFIXES: [&str; 12] = [
        "RUSTC",
        "CARGO_BIN_",
        "CARGO_BUILD_",
        "CARGO_CFG_",
        "CARGO_CRATE_",
        "CARGO_ENCODED_",
        "CARGO_FEATURE_",
        "CARGO_MA", // CARGO_MAKEFLAGS, CARGO_MANIFEST_*
        "CARGO_PKG_",
        "CARGO_PRIMARY_",
        "CARGO_PROFILE_",
        "CARGO_TARGET_",
    ];
    EXACT.contains(&name) || PREFIXES.iter().any(|prefix| name.starts_with(prefix))
}

/// Returns the library path without the toolchains and target directories that cargo and rustup have added.
fn library_path(value: &OsString) -> Option<OsString> {
    let added = |dir: &PathBuf| {
        let text = dir.to_string_lossy();
        text.contains("/toolchains/") || text.contains("/target/") || text.is_empty()
    };
    let rest: Vec<_> = std::env::split_paths(value).filter(|dir| !added(dir)).collect();
    (!rest.is_empty()).then(|| std::env::join_paths(rest).expect("directories of a search path"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: Facts = Facts { has_cargo: true, has_sources: true, version: Some((1, 96)) };

    #[test]
    fn a_toolchain_needs_cargo_sources_and_age() {
        assert!(GOOD.usable());
        assert!(!Facts { has_cargo: false, ..GOOD }.usable());
        assert!(!Facts { has_sources: false, ..GOOD }.usable());
        assert!(!Facts { version: Some((1, 63)), ..GOOD }.usable());
        assert!(!Facts { version: None, ..GOOD }.usable());
    }

    #[test]
    fn a_directory_without_programs_is_no_toolchain() {
        let empty = Toolchain { name: "empty".into(), bin: "/nonexistent/bin".into() };
        assert!(!empty.facts().usable());
    }

    #[test]
    fn nightlies_come_newest_first() {
        let list = "stable-x (active, default) /r/toolchains/stable-x\n\
            nightly-2025-04-27-x /r/toolchains/nightly-2025-04-27-x\n\
            nightly-2026-01-01-x /r/toolchains/nightly-2026-01-01-x\n\
            nightly-x (override) /r/tool chains/nightly-x\n\
            1.95.0-x /r/toolchains/stable-x";
        let found = nightlies(list);
        let names: Vec<_> = found.iter().map(|t| t.name.as_str()).collect();
        assert_eq!(names, ["nightly-x", "nightly-2026-01-01-x", "nightly-2025-04-27-x"]);
        assert_eq!(found[0].bin, Path::new("/r/tool chains/nightly-x/bin"));
    }

    #[test]
    fn versions_are_read() {
        assert_eq!(version("1.96.0 (abc 2026-05-25)"), Some((1, 96)));
        assert_eq!(version("1.90"), Some((1, 90)));
        assert_eq!(version("1.98.0-nightly (abc)"), Some((1, 98)));
        assert_eq!(version("what"), None);
    }

    #[test]
    fn the_outer_cargo_leaves_no_traces_but_the_users_settings_stay() {
        for name in ["CARGO", "CARGO_PKG_NAME", "RUSTC", "RUSTC_WRAPPER", "RUSTUP_TOOLCHAIN"] {
            assert!(is_inherited(name), "{name}");
        }
        for name in ["CARGO_MANIFEST_DIR", "RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS"] {
            assert!(is_inherited(name), "{name}");
        }
        for name in ["CARGO_HOME", "CARGO_HTTP_CAINFO", "CARGO_NET_OFFLINE", "RUSTUP_HOME"] {
            assert!(!is_inherited(name), "{name}");
        }
        let outer = OsString::from("/k/target/debug/deps:/r/toolchains/stable/lib:/opt/mine");
        assert_eq!(library_path(&outer), Some("/opt/mine".into()));
        assert_eq!(library_path(&OsString::from("/r/toolchains/stable/lib")), None);
    }
}
