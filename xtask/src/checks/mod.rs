//! `cargo xtask test`: everything that must pass before a merge.

mod beside;
pub mod cases;

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use clap::Args;

use beside::Beside;

use crate::boards::Board;
use crate::caps;
use crate::elf;
use crate::emulator;
use crate::firmware;
use crate::machines::Machine;
use crate::process::{host_cargo, probe, root, run as run_child, which};
use crate::senders;
use crate::setup::{self, Scope};
use crate::sim;
use crate::size;

/// `cargo xtask test`
#[derive(Args)]
pub struct TestArgs {
    /// Run all cases of the tests on boards, and the senders with whole jobs and at more boards: about 1.5 hours
    #[arg(long)]
    long: bool,
}

/// A check and its name.
struct Stage {
    name: &'static str,
    run: fn() -> Result<()>,
}

/// Stages that need no image. Images are built in parallel: most of that time is a link, which takes one core.
const WITHOUT_IMAGES: &[Stage] = &[
    Stage { name: "format", run: format },
    Stage { name: "lints", run: lints },
    Stage { name: "documentation", run: documentation },
    Stage { name: "host tests", run: host_tests },
    Stage { name: "tests of simulated boards, built", run: build_simulator_tests },
];

/// Stages that need the images. In parallel the senders are installed, which mostly waits for the network, and the page
/// is built.
const WITH_IMAGES: &[Stage] = &[
    Stage { name: "an image without capabilities", run: without_capabilities },
    Stage { name: "what the profile of a machine adds", run: profile },
    Stage { name: "sizes and stack of every board", run: size_all },
    Stage { name: "the emulator of the RP2040", run: || emulator::RP2040.test() },
    Stage { name: "the second simulator of AVR", run: || emulator::AVR.test() },
];

/// Test targets, of all packages together, that need no image.
const HOST_TARGETS: [&str; 8] =
    ["--lib", "--bins", "--test", "host", "--test", "capabilities", "--test", "seeds"];

/// Test targets that run on simulated and emulated boards.
const BOARD_TARGETS: [&str; 2] = ["--test", "chip"];

/// Runs all checks; stops at the first that fails.
pub fn run(args: &TestArgs) -> Result<()> {
    stage("tools", || setup::ensure(Scope::Tests))?;
    let images = Beside::start(&["build", "--all"])?;
    WITHOUT_IMAGES.iter().try_for_each(|one| stage(one.name, one.run))?;
    stage("the images", || images.wait())?;
    let senders = Beside::start(&["senders", "--install"])?;
    let page = Beside::start(&["web"])?;
    WITH_IMAGES.iter().try_for_each(|one| stage(one.name, one.run))?;
    stage("simulated and emulated boards", || simulator_tests(args.long))?;
    stage("senders, installed beside", || senders.wait())?;
    stage("the page, built beside", || page.wait())?;
    stage("real senders", if args.long { senders::run_long } else { senders::run_short })?;
    // The emulated board of a session takes one core, the page the other one.
    let page = Beside::start(&["web", "--test"])?;
    stage("real senders at the emulated RP2040", || senders::run_emulated(args.long))?;
    stage("the page in a browser, tested beside", || page.wait())?;
    println!("\ncargo xtask test: all stages passed");
    Ok(())
}

/// Runs a stage. Prints its name before it and its time after it.
fn stage(name: &str, run: impl FnOnce() -> Result<()>) -> Result<()> {
    println!("\n=== {name} ===");
    let start = Instant::now();
    run().with_context(|| format!("stage `{name}`"))?;
    println!("({} s)", start.elapsed().as_secs());
    Ok(())
}

fn format() -> Result<()> {
    if has_component("fmt", "rustfmt") {
        cargo(&["fmt", "--all", "--check"])?;
    }
    Ok(())
}

fn lints() -> Result<()> {
    if has_component("clippy", "clippy") {
        cargo(&["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"])?;
    }
    Ok(())
}

/// Builds the documentation of the source; a warning is an error.
fn documentation() -> Result<()> {
    let mut doc = host_cargo();
    doc.current_dir(root()).env("RUSTDOCFLAGS", "-D warnings");
    let packages =
        ["kerf", "avr-embassy", "kerf-macros", "kerf-web"].map(|name| ["--package", name]).concat();
    run_child(doc.args(["doc", "--no-deps", "--document-private-items"]).args(packages))
}

/// Whether cargo has this subcommand; rustup may have to install the component first. Without rustup and without the
/// component a message says that the stage is skipped.
fn has_component(subcommand: &str, component: &str) -> bool {
    let there = || probe(host_cargo().args([subcommand, "--version"])).is_some();
    if !there() && which("rustup").is_some() {
        let _ = run_child(Command::new("rustup").args(["component", "add", component]));
    }
    let found = there();
    if !found {
        println!("SKIPPED: this Rust has no {component}, and none could be installed");
    }
    found
}

/// Runs the tests on the host: with the checks of the fuzzers, run once; with the crates of the page and of the
/// simulator; and with the firmware without capabilities, which must refuse what it lacks.
fn host_tests() -> Result<()> {
    run_child(&mut tests(&HOST_TARGETS))?;
    run_child(&mut tests(&["--doc"]))?;
    let features = ["--no-default-features", "--features", "std,dialect-tinyg"];
    cargo(&[&["test", "--package", "kerf", "--test", "capabilities"], &features[..]].concat())
}

/// Least number of bytes of flash that capabilities take. It checks that leaving them out does leave them out.
const CAPABILITIES: u64 = 8_000;

/// Checks that the image without capabilities, which is built with the others, is smaller.
fn without_capabilities() -> Result<()> {
    let board = Board::Ramps14;
    let flash = |elf: &Path| anyhow::Ok(elf::Image::load(elf)?.sizes.flash);
    let all = flash(&firmware::image(board, Machine::default()))?;
    let least = flash(&firmware::build_bare(board)?)?;
    println!("capabilities of {board} take {} bytes of flash", all.saturating_sub(least));
    ensure!(least + CAPABILITIES < all, "{least} bytes without capabilities, {all} with them");
    Ok(())
}

/// Checks what the profile of a machine adds to an image, measured on one board. With this bound, the sizes of the
/// images for `careful` show that each board fits with each machine.
fn profile() -> Result<()> {
    let (board, machine) = (Board::default(), Machine::Printer);
    let flash = |elf: &Path| anyhow::Ok(elf::Image::load(elf)?.sizes.flash);
    let careful = flash(&firmware::image(board, Machine::default()))?;
    let with = flash(&firmware::build(board, machine)?)?;
    let adds = with.saturating_sub(careful);
    println!("the profile {machine} adds {adds} bytes of flash to {board}");
    ensure!(adds <= caps::PROFILE, "{adds} bytes, more than {}", caps::PROFILE);
    Ok(())
}

fn size_all() -> Result<()> {
    Board::all().iter().try_for_each(|board| {
        size::show_board(*board, &firmware::image(*board, Machine::default()))
    })
}

/// Builds the simulator's program, which some tests run, and the tests.
fn build_simulator_tests() -> Result<()> {
    sim::build()?;
    run_child(tests(&BOARD_TARGETS).arg("--no-run"))
}

/// Runs the tests on boards, including those on the emulated chip and on the second simulator of AVR, which are ignored
/// by default because they need these programs. One more test runs at once than there are cores, because a test waits now
/// and then for an emulator or for `avrdude`. No test depends on the time of the computer.
fn simulator_tests(long: bool) -> Result<()> {
    let mut tests = tests(&BOARD_TARGETS);
    tests.env("RUST_TEST_THREADS", senders::at_once().to_string());
    cases::choose(&mut tests, long);
    run_child(tests.args(["--", "--include-ignored"]))
}

/// Returns the command that builds and runs these tests. It names all packages even where few are tested, because
/// shared dependencies then have the same features and are compiled once.
fn tests(targets: &[&str]) -> Command {
    let mut test = host_cargo();
    test.current_dir(root()).env("KERF_ELF_DIR", firmware::directory());
    test.args(["test", "--workspace"]).args(targets);
    test
}

fn cargo(args: &[&str]) -> Result<()> {
    run_child(host_cargo().current_dir(root()).args(args))
}
