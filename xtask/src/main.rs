//! Developer commands of Kerf: `cargo xtask help` lists them.
//!
//! | module | purpose |
//! |---|---|
//! | [`setup`] | finds the tools, installs what is missing |
//! | [`toolchain`] | finds the Rust that builds for AVR, and sets its environment |
//! | [`chips`] | the chips that images are built for |
//! | [`firmware`] | builds the image of a board, flashes it |
//! | [`shrink`] | makes the image smaller before it is linked |
//! | [`elf`] | examines an image: sizes, stack, defects |
//! | [`size`], [`caps`] | prints and limits what an image takes |
//! | [`rp2040`] | boards with another chip: images, UF2 |
//! | [`emulator`] | installs emulated chips: the RP2040, and AVR on its second simulator |
//! | [`dist`] | writes the files of a release |
//! | [`sim`] | runs the image on the simulated board |
//! | [`settings`] | saves and loads the settings of a machine |
//! | [`verify`] | finds out whether a board is sound |
//! | [`fuzz`] | runs the fuzzers |
//! | [`senders`] | runs real senders against the simulated board |
//! | [`npm`] | installs packages of npm |
//! | [`web`] | builds the page with the firmware in it, serves and tests it |
//! | [`checks`] | everything that must pass before a merge |
//! | [`jobs`] | writes the example jobs |
//! | [`nist`] | the motions of another interpreter, for comparison |
//! | `docs` | test: what the documents name exists |
//! | `layers` | test: dependencies agree with ARCHITECTURE.md |
//! | `seam` | test: only the table of dialects knows the dialects |

mod boards;
mod caps;
mod checks;
mod chips;
mod dist;
#[cfg(test)]
mod docs;
mod elf;
mod emulator;
mod firmware;
mod fuzz;
mod jobs;
#[cfg(test)]
mod layers;
#[cfg(test)]
mod levels;
mod machines;
mod nist;
mod npm;
mod process;
mod rp2040;
#[cfg(test)]
mod seam;
mod senders;
mod settings;
mod setup;
mod shrink;
mod sim;
mod size;
#[cfg(test)]
mod sources;
mod toolchain;
mod verify;
mod web;

use std::process::ExitCode;

use clap::Parser;

use boards::Board;
use machines::Machine;
use process::host_cargo;
use setup::Scope;

#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", about = "Developer commands of Kerf")]
enum Command {
    /// Find the tools that Kerf needs and install what is missing
    Setup,
    /// Build the firmware of a board; the last line is `elf: PATH`
    Build(BuildArgs),
    /// Build the examples of the runtime, `avr-embassy`; the last line is `elf: FOLDER`
    Examples,
    /// Show what the firmware takes of flash, RAM and stack; fail past the caps
    Size(size::SizeArgs),
    /// Run a job on the simulated board
    Sim(sim::RunArgs),
    /// Measure what the firmware achieves, beside other firmwares' figures
    Bench(sim::BenchArgs),
    /// Offer the simulated board as a serial port
    Serve(sim::ServeArgs),
    /// Look for inputs that break the interpreter or the machine, by fuzzing; fail on a finding.
    /// Corpus and findings are kept in target/fuzz, and the next run goes on from there
    Fuzz(fuzz::FuzzArgs),
    /// Run real G-code senders, such as CNCjs and bCNC, against the simulated board
    Senders(senders::SendersArgs),
    /// Build the page with the firmware in it: a folder of static files; the last line is `page: FOLDER`
    Web(web::WebArgs),
    /// Run every check: format, lints, host tests, firmware, sizes, simulator
    Test(checks::TestArgs),
    /// Write the firmware to a board
    Flash(firmware::FlashArgs),
    /// Save the settings of a machine to a file, or load them
    Settings(settings::SettingsArgs),
    /// Find out whether a board is sound: its chip, then Kerf on it; write what was found to a file
    Verify(verify::VerifyArgs),
    /// Write the files of a release to target/dist: a .hex for each board, the settings as a schema, licences,
    /// checksums
    Dist,
    /// Write the example jobs anew
    Jobs,
    /// Write the pages of `docs` anew that are generated from tables: G-code, settings, codes, wiring
    Docs,
    /// Write the motions of `tests/nist` anew, by a NIST-derived interpreter (Debian 12)
    Nist(nist::Args),
}

#[derive(clap::Args)]
struct BuildArgs {
    /// The board to build for
    #[arg(long, value_enum, default_value_t)]
    board: Board,
    /// The machine whose settings are the defaults
    #[arg(long, value_enum, default_value_t)]
    machine: Machine,
    /// A feature of the board that the image is to lack, such as `help`; may be given several times
    #[arg(long, value_name = "FEATURE")]
    without: Vec<String>,
    /// Instead, build what the tests run: the images of all boards, one without capabilities, and the examples
    #[arg(long, conflicts_with_all = ["board", "machine", "without"])]
    all: bool,
}

fn main() -> ExitCode {
    match dispatch(Command::parse()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn dispatch(command: Command) -> anyhow::Result<ExitCode> {
    match command {
        Command::Setup => setup::report()?,
        Command::Build(arg) => build(&arg)?,
        Command::Examples => examples()?,
        Command::Size(args) => size::run(&args)?,
        Command::Sim(args) => return sim::run(&args),
        Command::Bench(args) => return sim::bench(&args),
        Command::Serve(args) => return sim::serve(&args),
        Command::Fuzz(args) => return fuzz::run(&args),
        Command::Senders(args) => senders::run(&args)?,
        Command::Web(args) => web::run(&args)?,
        Command::Test(args) => checks::run(&args)?,
        Command::Flash(args) => firmware::flash(&args)?,
        Command::Settings(args) => return settings::run(&args),
        Command::Verify(args) => return verify::run(&args),
        Command::Dist => dist::run()?,
        Command::Jobs => jobs::write()?,
        Command::Docs => process::run(host_cargo().args(DESCRIBE))?,
        Command::Nist(args) => nist::run(&args)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// The test of Kerf that writes the pages, so that this program need not be built with Kerf in it.
const DESCRIBE: [&str; 9] =
    ["test", "--quiet", "--package", "kerf", "--test", "host", "docs::write", "--", "--ignored"];

fn build(args: &BuildArgs) -> anyhow::Result<()> {
    if args.all {
        return build_all();
    }
    setup::ensure(if args.board.is_rp2040() { Scope::Arm } else { Scope::Firmware })?;
    let elf = firmware::build_without(args.board, args.machine, &args.without)?;
    println!("elf: {}", elf.display());
    Ok(())
}

/// Builds images for AVR and for the RP2040 at the same time: most of the time of each is a link, which takes one
/// core. For AVR a program is made smaller while the next one is being compiled.
fn build_all() -> anyhow::Result<()> {
    setup::ensure(Scope::Arm)?;
    let (arm, avr): (Vec<_>, Vec<_>) = Board::all().iter().partition(|board| board.is_rp2040());
    std::thread::scope(|scope| {
        let arm = scope.spawn(|| {
            arm.iter().try_for_each(|board| told(firmware::build(*board, Machine::default())?))
        });
        let (compiled, waiting) = std::sync::mpsc::channel::<firmware::Compiled>();
        let smaller =
            scope.spawn(|| waiting.into_iter().try_for_each(|image| told(image.finish()?)));
        let all = avr.iter().map(|board| firmware::compile(*board, Machine::default(), &[]));
        let avr = all
            .chain(std::iter::once_with(|| firmware::compile_bare(Board::Ramps14)))
            .try_for_each(|image| {
                // The receiver takes no more images after an error.
                let _ = compiled.send(image?);
                anyhow::Ok(())
            })
            .and_then(|()| examples());
        drop(compiled);
        let [arm, smaller] = [arm, smaller].map(|one| one.join().expect("a build does not panic"));
        avr.and(arm).and(smaller)
    })
}

fn told(image: std::path::PathBuf) -> anyhow::Result<()> {
    println!("elf: {}", image.display());
    Ok(())
}

fn examples() -> anyhow::Result<()> {
    setup::ensure(Scope::Firmware)?;
    println!("elf: {}", firmware::build_examples()?.display());
    Ok(())
}
