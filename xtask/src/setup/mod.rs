//! Finds the tools and installs missing ones, where that is possible.
//!
//! On Debian and its relatives `apt-get` installs them, as root or through `sudo` if that needs no password. On other
//! systems, and whenever the user says no, the exact commands are printed.

mod install;
mod needs;
mod wasm;

use anyhow::{Result, bail};

use crate::emulator;
use crate::toolchain::Toolchain;
use install::{Means, Step};
use needs::Need;
pub use needs::{Scope, python};
pub use wasm::TARGET;

/// Makes sure that the tools are there. Prints nothing if they are.
pub fn ensure(scope: Scope) -> Result<()> {
    ensure_programs(scope)?;
    if scope.covers(Scope::Web) { wasm::ensure() } else { Ok(()) }
}

fn ensure_programs(scope: Scope) -> Result<()> {
    let missing = needs::missing(scope);
    if missing.is_empty() {
        return Ok(());
    }
    let plan = install::plan(&missing, Means::here());
    describe(&missing);
    if !plan.automatic || !install::agreed(&plan.steps) {
        bail!("{}", advice(&missing, &plan.steps));
    }
    install::execute(&plan.steps);
    let left = needs::missing(scope);
    if !left.is_empty() {
        bail!("{}", advice(&left, &install::plan(&left, Means::here()).steps));
    }
    eprintln!("setup: everything is there now");
    Ok(())
}

/// `cargo xtask setup`: makes sure that the tools are there, emulators of chips among them, and prints which ones are
/// used.
pub fn report() -> Result<()> {
    ensure(Scope::Everything)?;
    emulator::RP2040.install()?;
    emulator::AVR.install()?;
    if let Some(rust) = Toolchain::find() {
        println!("AVR builds: {} in {}", rust.name, rust.bin.display());
    }
    println!("setup: all tools are there");
    Ok(())
}

fn describe(missing: &[&Need]) {
    eprintln!("setup: missing:");
    for need in missing {
        eprintln!("  {}", need.what);
    }
}

fn advice(missing: &[&Need], steps: &[Step]) -> String {
    let mut text = String::from("tools are missing: ");
    text += &missing.iter().map(|need| need.what).collect::<Vec<_>>().join("; ");
    if steps.is_empty() {
        text += "\ninstall them with your system's package manager";
        if missing.iter().any(|need| need.is_rust) {
            text += &format!("; the Rust one with\n  {}", install::RUSTUP);
        }
    } else {
        text += "\nto install them:";
        for step in steps {
            text += &format!("\n  {}", step.command);
        }
    }
    text
}
