//! The tools that the commands need, how to detect each, and Debian's names for them.

use std::path::Path;
use std::process::Command;

use crate::process::{probe, which};
use crate::toolchain::Toolchain;

/// What a command needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scope {
    /// Building the firmware.
    Firmware,
    /// Building the simulator as well.
    Simulator,
    /// Building for the RP2040.
    Arm,
    /// Running the RP2040's emulator, beside the simulator.
    Emulator,
    /// Building the firmware and flashing it.
    Flash,
    /// Running all tests on simulated and emulated boards.
    Tests,
    /// Building the fuzzers, and nothing else.
    Fuzzers,
    /// Running senders at the simulator.
    Senders,
    /// Running the senders that are written in Python.
    Python,
    /// Building the page.
    Web,
    /// Running the page in a browser.
    WebTests,
    /// Everything.
    Everything,
}

impl Scope {
    pub(super) fn covers(self, need: Scope) -> bool {
        match self {
            Scope::Everything => true,
            Scope::Arm => need == Scope::Arm || Scope::Firmware.covers(need),
            Scope::Emulator => {
                matches!(need, Scope::Arm | Scope::Senders) || Scope::Simulator.covers(need)
            }
            Scope::Flash => need == Scope::Flash || Scope::Firmware.covers(need),
            Scope::Tests => {
                matches!(need, Scope::Tests | Scope::Flash) || Scope::Emulator.covers(need)
            }
            Scope::Fuzzers => need == Scope::Fuzzers,
            Scope::Senders => {
                matches!(need, Scope::Senders | Scope::Python) || Scope::Simulator.covers(need)
            }
            Scope::Python => need == Scope::Python,
            Scope::Web => matches!(need, Scope::Senders | Scope::Web),
            Scope::WebTests => {
                need == Scope::WebTests || Scope::Web.covers(need) || Scope::Simulator.covers(need)
            }
            Scope::Firmware | Scope::Simulator => need <= self,
        }
    }
}

/// A tool that must be there.
pub struct Need {
    /// The name of the tool.
    pub what: &'static str,
    /// The Debian packages that contain it.
    pub packages: &'static [&'static str],
    /// Whether it is a Rust toolchain, which rustup could install as well.
    pub is_rust: bool,
    scope: Scope,
    present: fn() -> bool,
}

/// All tools, in the order in which they are reported.
pub static NEEDS: [Need; 14] = [
    Need {
        what: "Rust with its library sources (rustup nightly with rust-src, or Debian's)",
        packages: &["rustc-web", "cargo-web", "rust-web-src"],
        is_rust: true,
        scope: Scope::Firmware,
        present: || Toolchain::find().is_some(),
    },
    tool("avr-gcc, which links the firmware", &["gcc-avr"], Scope::Firmware, || has("avr-gcc")),
    tool("avr-objdump, which checks it", &["binutils-avr"], Scope::Firmware, || has("avr-objdump")),
    tool("avr-libc, start-up code and arithmetic", &["avr-libc"], Scope::Firmware, avr_libc),
    tool("a C compiler and make, for simavr", &["gcc", "libc6-dev", "make"], SIM, || {
        has("cc") && has("gcc") && has("make")
    }),
    tool("clang and libclang, for the bindings to simavr", &["clang", "libclang-dev"], SIM, || {
        has("clang") && libclang()
    }),
    tool("libelf, zlib and zstd with their headers, for simavr", ELF_PACKAGES, SIM, || {
        let libraries = ["--exists", "libelf", "zlib", "libzstd"];
        probe(Command::new("pkg-config").args(libraries)).is_some()
    }),
    tool("avrdude, which flashes boards", &["avrdude"], Scope::Flash, || has("avrdude")),
    tool("the boot loader of the Arduino Mega", &["arduino-core-avr"], Scope::Tests, || {
        Path::new(BOOT_LOADER).exists()
    }),
    tool("LLD, which links the firmware of the RP2040", &["lld"], Scope::Arm, || has("ld.lld")),
    tool("a C++ compiler, for libFuzzer", &["g++"], Scope::Fuzzers, || has("c++")),
    tool(
        "node and npm, for senders and the page",
        &["nodejs", "npm", "ca-certificates"],
        Scope::Senders,
        || has("node") && has("npm"),
    ),
    tool("Chromium, for tests of the page", &["chromium"], Scope::WebTests, || has("chromium")),
    tool(
        "Python with venv, for senders",
        &["python3", "python3-venv", "ca-certificates"],
        Scope::Python,
        || python().is_some(),
    ),
];

const SIM: Scope = Scope::Simulator;
/// Where Debian's package has it. `tests/sim/src/loader.rs` reads this file.
const BOOT_LOADER: &str =
    "/usr/share/arduino/hardware/arduino/avr/bootloaders/stk500v2/stk500boot_v2_mega2560.hex";
const ELF_PACKAGES: &[&str] = &["pkg-config", "libelf-dev", "zlib1g-dev", "libzstd-dev"];

const fn tool(
    what: &'static str,
    packages: &'static [&'static str],
    scope: Scope,
    present: fn() -> bool,
) -> Need {
    Need { what, packages, is_rust: false, scope, present }
}

/// Returns the tools that are missing.
pub fn missing(scope: Scope) -> Vec<&'static Need> {
    NEEDS.iter().filter(|need| scope.covers(need.scope) && !(need.present)()).collect()
}

/// Returns the first Python that can make environments; `None` if there is none. Debian's own cannot unless
/// `python3-venv` is installed.
pub fn python() -> Option<&'static str> {
    let mut known = ["python3", "/usr/bin/python3"].into_iter();
    known.find(|name| probe(Command::new(name).args(["-c", "import ensurepip, venv"])).is_some())
}

fn has(program: &str) -> bool {
    which(program).is_some()
}

/// Whether avr-libc is there. avr-gcc prints a path if it finds the start-up code, else just the name.
fn avr_libc() -> bool {
    let ask = ["-mmcu=atmega2560", "-print-file-name=crtatmega2560.o"];
    probe(Command::new("avr-gcc").args(ask)).is_some_and(|file| Path::new(&file).is_absolute())
}

/// Whether libclang is there. Looks where bindgen looks.
fn libclang() -> bool {
    let given = std::env::var_os("LIBCLANG_PATH").into_iter().map(Into::into);
    let asked = probe(Command::new("llvm-config").arg("--libdir")).into_iter().map(Into::into);
    let fixed = ["/usr/lib", "/usr/lib64", "/usr/local/lib", "/opt/homebrew/opt/llvm/lib"];
    let versions = ["/usr/lib", "/usr/local"].into_iter().flat_map(|dir| list(Path::new(dir)));
    let versions = versions.flat_map(|dir| [dir.join("lib"), dir]);
    given.chain(asked).chain(fixed.map(Into::into)).chain(versions).any(|dir| holds_libclang(&dir))
}

fn holds_libclang(dir: &Path) -> bool {
    let is_it = |file: std::path::PathBuf| {
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        name.starts_with("libclang.") || name.starts_with("libclang-") && name.contains(".so")
    };
    list(dir).into_iter().any(is_it)
}

fn list(dir: &Path) -> Vec<std::path::PathBuf> {
    let entries = std::fs::read_dir(dir).into_iter().flatten();
    entries.filter_map(|entry| Some(entry.ok()?.path())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_firmware_needs_a_part_of_everything() {
        let needs = |scope: Scope| NEEDS.iter().filter(|n| scope.covers(n.scope)).count();
        assert_eq!(needs(Scope::Firmware), 4);
        assert_eq!(needs(Scope::Simulator), 7);
        assert_eq!(needs(Scope::Arm), 5);
        assert_eq!(needs(Scope::Emulator), 9);
        assert_eq!(needs(Scope::Flash), 5);
        assert_eq!(needs(Scope::Tests), 11);
        assert_eq!(needs(Scope::Fuzzers), 1);
        assert_eq!(needs(Scope::Senders), 9);
        assert_eq!(needs(Scope::Web), 1);
        assert_eq!(needs(Scope::WebTests), 9);
        assert_eq!(needs(Scope::Everything), NEEDS.len());
    }

    #[test]
    fn an_empty_directory_holds_no_libclang() {
        assert!(!holds_libclang(Path::new("/nonexistent")));
        assert!(!has("no-such-program-anywhere"));
    }
}
