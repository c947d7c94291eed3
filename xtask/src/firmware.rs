//! Builds the firmware image of a board, and writes it to one.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;

use crate::boards::Board;
use crate::chips::{ATMEGA1284P, ATMEGA2560, Chip};
use crate::elf;
use crate::machines::Machine;
use crate::process::{self, root, run};
use crate::rp2040;
use crate::setup::{self, Scope};
use crate::shrink::{self, link};
use crate::toolchain::Toolchain;

/// Copies of code (`tail-dup-placement`, `rotation-max-header-size`, `jump-threading-threshold`) save no cycle here: without them the image
/// is 900 bytes smaller. What is taken out of a loop (`disable-machine-licm`) has to be kept, on a CPU with few registers, in memory: without
/// that and with few spills (`split-spill-mode`) it is 1,800 bytes smaller, and no slower. `--relax`: the linker shortens calls and jumps to what is near, 1,600 bytes and a cycle each. It may, for
/// LLVM leaves it a relocation for every branch. `__TEXT_REGION_LENGTH__`: what the compiler wrote may be larger than the flash, since it is
/// made smaller behind it; the image is held against the flash by [`elf::check`]. For `CHIP` stands the chip's name.
const FLAGS: &str = "-C target-cpu=CHIP -C llvm-args=-inline-threshold=30 -C llvm-args=-tail-dup-placement=false \
                     -C llvm-args=-rotation-max-header-size=4 -C llvm-args=-jump-threading-threshold=3 -C llvm-args=-disable-machine-licm \
                     -C llvm-args=-split-spill-mode=size -C jump-tables=no \
                     -C linker=target/avr/keep-gcc -C link-arg=-mmcu=CHIP -C link-arg=-Wl,--gc-sections -C link-arg=-Wl,--relax \
                     -C link-arg=-Wl,--defsym=__TEXT_REGION_LENGTH__=0x60000";

/// The linker in `FLAGS`: a script that writes down how it was called. Its path does not name the checkout, for cargo would build all
/// anew in a copy; `rustc` knows by the end of the name which options it takes.
const LINKER: &str = "target/avr/keep-gcc";

/// The flags for a chip.
fn flags(chip: &Chip) -> String {
    FLAGS.replace("CHIP", chip.name)
}

/// Where cargo builds for AVR: one directory for all boards and chips, so that what runs on the host is built once.
fn target() -> PathBuf {
    root().join("target/avr")
}

/// Where the images lie: `BOARD.elf`, or `BOARD-MACHINE.elf` if it is not for the usual machine. The name of one that lacks features says
/// so: `BOARD-without-FEATURE.elf`.
pub fn directory() -> PathBuf {
    root().join("target/firmware")
}

/// Where the image of a board and a machine lies once it is built.
pub fn image(board: Board, machine: Machine) -> PathBuf {
    image_without(board, machine, &[])
}

/// Where the image of a board without some of its features lies once it is built.
fn image_without(board: Board, machine: Machine, without: &[String]) -> PathBuf {
    let machine = match machine == Machine::default() {
        true => String::new(),
        false => format!("-{machine}"),
    };
    let lacks: String = without.iter().map(|feature| format!("-without-{feature}")).collect();
    directory().join(format!("{board}{machine}{lacks}.elf"))
}

/// Builds and checks the image; returns where it lies.
pub fn build(board: Board, machine: Machine) -> Result<PathBuf> {
    build_without(board, machine, &[])
}

/// Builds and checks the image without some of the board's features; returns where it lies.
pub fn build_without(board: Board, machine: Machine, without: &[String]) -> Result<PathBuf> {
    if board.is_rp2040() {
        let features = features(board, machine, without)?;
        return rp2040::build(&features, &image_without(board, machine, without));
    }
    compile(board, machine, without)?.finish()
}

/// What the compiler has written for an image, whose program is to be made smaller and linked: half a minute, in which the compiler may be
/// at work on the next image.
pub struct Compiled {
    text: PathBuf,
    linked: PathBuf,
    image: PathBuf,
}

impl Compiled {
    /// Links and checks the image; returns where it lies.
    pub fn finish(&self) -> Result<PathBuf> {
        make_small(&self.text, &self.linked, &self.image)
    }
}

/// An image for AVR, compiled.
pub fn compile(board: Board, machine: Machine, without: &[String]) -> Result<Compiled> {
    let features = features(board, machine, without)?;
    let image = image_without(board, machine, without);
    let rust = Toolchain::find().context("no Rust that can build for AVR; `cargo xtask setup`")?;
    let target = target();
    let kept = target.join("kept").join(image.with_extension("").file_name().unwrap_or_default());
    link::write_script(&root().join(LINKER))?;
    std::fs::create_dir_all(&kept)?;
    let (text, linked) = (kept.join("kerf.s"), kept.join("link"));
    let mut cargo = rust.cargo();
    cargo.current_dir(root()).env("RUSTFLAGS", flags(&ATMEGA2560)).env(link::KEPT, &linked);
    cargo
        .args(["rustc", "--release", "-Zbuild-std=core", "--target", "avr-none", "--target-dir"])
        .arg(&target);
    cargo.args(["--package", "kerf", "--bin", "kerf", "--no-default-features", "--features"]);
    cargo.arg(features);
    run(cargo.args(["--", "--emit"]).arg(format!("asm={}", text.display())))?;
    Ok(Compiled { text, linked, image })
}

/// Builds and checks the image of a board without any capability, dialects apart; returns where it lies.
pub fn build_bare(board: Board) -> Result<PathBuf> {
    compile_bare(board)?.finish()
}

/// The image of a board for AVR without any capability, dialects apart, compiled.
pub fn compile_bare(board: Board) -> Result<Compiled> {
    let is_capability = |feature: &String| !feature.starts_with("dialect-");
    let without: Vec<_> = board.features()?.into_iter().filter(is_capability).collect();
    compile(board, Machine::default(), &without)
}

/// The Cargo features of an image, separated by commas: what the board's file says, but for some.
fn features(board: Board, machine: Machine, without: &[String]) -> Result<String> {
    let own = board.features()?;
    if let Some(unknown) = without.iter().find(|feature| !own.contains(feature)) {
        bail!("{board} has no feature `{unknown}`; boards/{board}.rs has {}", own.join(", "));
    }
    let kept = own.into_iter().filter(|feature| !without.contains(feature));
    let all: Vec<_> =
        [format!("board-{board}"), format!("machine-{machine}")].into_iter().chain(kept).collect();
    Ok(all.join(","))
}

/// Links the program that the compiler wrote a second time, made smaller; refuses one that would not work: see [`elf`].
///
/// `rustc` makes a text and an object by two runs of its back end, which need not agree. So the image comes from the text, and so does
/// the program in which defects of the compiler are looked for: shared code would hide them.
fn make_small(text: &Path, linked: &Path, elf: &Path) -> Result<PathBuf> {
    let (plain, small) = (text.with_file_name("plain.elf"), text.with_file_name("small.elf"));
    if !is_newer(&small, &[text, linked, &std::env::current_exe()?]) {
        let program = std::fs::read_to_string(text);
        let program = program.with_context(|| {
            format!("no {}: remove target/avr, and it is written again", text.display())
        })?;
        let texts = shrink::shrink(&program)?;
        let link = link::Link::read(linked)?;
        link.image(&texts.plain, &plain, &ATMEGA2560)?;
        elf::check_compiled(&plain, &ATMEGA2560)?;
        link.image(&texts.small, &small, &ATMEGA2560)?;
    }
    keep(&small, elf)
}

/// Whether a file was made after all of the others.
fn is_newer(made: &Path, others: &[&Path]) -> bool {
    let time = |path: &Path| std::fs::metadata(path).and_then(|data| data.modified()).ok();
    time(made).is_some_and(|made| {
        others.iter().all(|other| time(other).is_some_and(|other| other < made))
    })
}

/// Copies the image to its own name and refuses one that would not work: see [`elf::check`].
fn keep(built: &Path, kept: &Path) -> Result<PathBuf> {
    std::fs::create_dir_all(kept.parent().unwrap_or(kept))?;
    std::fs::copy(built, kept).with_context(|| format!("cannot copy {}", built.display()))?;
    elf::check(kept)?;
    Ok(kept.to_owned())
}

/// Builds and checks the examples of the runtime, `avr-embassy`, and what else runs on a bare chip; returns the folder of the examples, where they lie as
/// `CHIP/NAME.elf`.
///
/// That of a clock of which a millisecond is no whole number of counts is `CHIP-uneven-clock/blink.elf`.
pub fn build_examples() -> Result<PathBuf> {
    let folder = directory().join("avr-embassy");
    for chip in [ATMEGA2560, ATMEGA1284P] {
        build_examples_of(&chip, "", &EXAMPLES, &folder.join(chip.name))?;
    }
    let uneven = folder.join(format!("{}-uneven-clock", ATMEGA1284P.name));
    build_examples_of(&ATMEGA1284P, "uneven-clock", &EXAMPLES[..1], &uneven)?;
    build_parts()?;
    Ok(folder)
}

/// Builds and checks the images that try parts of Kerf on the chip of every board, as they are compiled for the usual board. They lie in `parts` beside the
/// images of boards.
fn build_parts() -> Result<()> {
    let features = features(Board::default(), Machine::default(), &[])?;
    let mut cargo = cargo_for(&ATMEGA2560)?;
    cargo.args(["--package", "kerf", "--no-default-features", "--features"]).arg(features);
    keep_examples(cargo, &ATMEGA2560, &PARTS, &directory().join("parts"))
}

/// Builds some examples for a chip, with a feature of the runtime, into a folder.
fn build_examples_of(chip: &Chip, feature: &str, names: &[&str], folder: &Path) -> Result<()> {
    let mut cargo = cargo_for(chip)?;
    cargo.args(["--package", "avr-embassy", "--features"]);
    cargo.arg(format!("{},{feature}", chip.name).trim_end_matches(','));
    keep_examples(cargo, chip, names, folder)
}

/// What builds for a chip.
fn cargo_for(chip: &Chip) -> Result<std::process::Command> {
    let rust = Toolchain::find().context("no Rust that can build for AVR; `cargo xtask setup`")?;
    link::write_script(&root().join(LINKER))?;
    let mut cargo = rust.cargo();
    cargo.current_dir(root()).env("RUSTFLAGS", flags(chip)).env_remove(link::KEPT);
    cargo.args(["build", "--release", "-Zbuild-std=core", "--target", "avr-none"]);
    cargo.arg("--target-dir").arg(target());
    Ok(cargo)
}

/// Has cargo build examples of a package for a chip, and checks and copies them into a folder.
fn keep_examples(
    mut cargo: std::process::Command,
    chip: &Chip,
    names: &[&str],
    folder: &Path,
) -> Result<()> {
    run(cargo.args(names.iter().flat_map(|name| ["--example", name])))?;
    for name in names {
        let built = target().join(format!("avr-none/release/examples/{name}.elf"));
        elf::check_compiled(&built, chip)?;
        keep(&built, &folder.join(format!("{name}.elf")))?;
    }
    Ok(())
}

/// The examples of `avr-embassy`.
const EXAMPLES: [&str; 4] = ["blink", "echo", "preempt", "costs"];
/// What of `tests/chip` is an image.
const PARTS: [&str; 1] = ["arithmetic"];

/// `cargo xtask flash`
#[derive(Args)]
pub struct FlashArgs {
    /// The board to build for
    #[arg(long, value_enum, default_value_t)]
    board: Board,
    /// The machine whose settings are the defaults
    #[arg(long, value_enum, default_value_t)]
    machine: Machine,
    /// The board's serial port, such as /dev/ttyACM0; of a Pico in its boot loader the drive that it shows, such as /media/me/RPI-RP2
    #[arg(long)]
    port: String,
    /// Only print the command
    #[arg(long)]
    dry_run: bool,
}

/// Copies an image to the drive of a boot loader, which writes it and starts it.
fn copy_to_drive(image: &Path, args: &FlashArgs) -> Result<()> {
    let to = Path::new(&args.port).join("kerf.uf2");
    println!("cp {} {}", image.display(), to.display());
    if args.dry_run {
        return Ok(());
    }
    std::fs::copy(image, &to).context("is the board in its boot loader, and the drive right?")?;
    Ok(())
}

/// Builds, then writes the image through the boot loader of the board.
pub fn flash(args: &FlashArgs) -> Result<()> {
    setup::ensure(if args.board.is_rp2040() { Scope::Arm } else { Scope::Firmware })?;
    let elf = build(args.board, args.machine)?;
    if args.board.is_rp2040() {
        return copy_to_drive(&elf.with_extension("uf2"), args);
    }
    let mut avrdude = avrdude(&args.port, &elf);
    println!("{}", process::shown(&avrdude));
    if args.dry_run {
        return Ok(());
    }
    run(&mut avrdude).context("is avrdude installed, and the port right?")
}

fn avrdude(port: &str, elf: &Path) -> std::process::Command {
    let mut command = std::process::Command::new("avrdude");
    command.args(["-p", ATMEGA2560.part, "-c", "wiring", "-P", port, "-b", "115200", "-D"]);
    command.arg("-U").arg(format!("flash:w:{}:e", elf.display()));
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_have_names_of_their_own() {
        let name = |machine| image(Board::Ramps14, machine).file_name().unwrap().to_owned();
        assert_eq!(name(Machine::Careful), "ramps14.elf");
        assert_eq!(name(Machine::Lathe), "ramps14-lathe.elf");
        let lacks = image_without(Board::Ramps14, Machine::Careful, &["help".into()]);
        assert_eq!(lacks.file_name().unwrap(), "ramps14-without-help.elf");
    }

    #[test]
    fn what_is_left_out_is_no_feature_of_the_image() {
        let all = features(Board::Ramps14, Machine::Careful, &[]).unwrap();
        assert!(all.starts_with("board-ramps14,machine-careful,dialect-tinyg,"), "{all}");
        let some = features(Board::Ramps14, Machine::Careful, &["probing".into()]).unwrap();
        assert_eq!(some, all.replace(",probing", ""));
        let unknown = features(Board::Ramps14, Machine::Careful, &["hlep".into()]);
        assert!(unknown.unwrap_err().to_string().contains("no feature `hlep`"));
    }

    #[test]
    fn a_file_is_newer_than_those_it_is_made_of() {
        let folder = root().join("target/tmp/newer");
        std::fs::create_dir_all(&folder).unwrap();
        let (old, new) = (folder.join("old"), folder.join("new"));
        std::fs::write(&new, "").unwrap();
        let file = std::fs::File::create(&old).unwrap();
        file.set_modified(std::time::SystemTime::UNIX_EPOCH).unwrap();
        assert!(is_newer(&new, &[&old]));
        assert!(!is_newer(&old, &[&new]));
        assert!(!is_newer(&new, &[&old, &folder.join("none")]));
        assert!(!is_newer(&folder.join("none"), &[&old]));
    }

    #[test]
    fn avrdude_writes_the_elf_to_flash() {
        assert_eq!(
            process::shown(&avrdude("/dev/ttyACM0", Path::new("a.elf"))),
            "avrdude -p m2560 -c wiring -P /dev/ttyACM0 -b 115200 -D -U flash:w:a.elf:e"
        );
    }
}
