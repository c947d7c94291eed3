//! Builds the firmware image of a board, and flashes it.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;

use crate::boards::Board;
use crate::chips::{ATMEGA1284P, ATMEGA2560, Chip};
use crate::dist::hex;
use crate::elf;
use crate::machines::Machine;
use crate::process::{self, root, run};
use crate::rp2040;
use crate::setup::{self, Scope};
use crate::shrink::{self, link, restart};
use crate::toolchain::Toolchain;

/// Flags of the compiler. Copies of code (`tail-dup-placement`, `rotation-max-header-size`,
/// `jump-threading-threshold`) save no cycle here, and without them the image is 900 bytes smaller. A value that is
/// taken out of a loop must be kept in memory on a CPU with few registers. With `disable-machine-licm` against that,
/// and with few spills (`split-spill-mode`), the image is 1,800 bytes smaller and no slower. With `--relax` the
/// linker shortens calls and jumps over short distances, which saves 1,600 bytes and a cycle each. It can do that
/// because LLVM leaves it a relocation for every branch. `__TEXT_REGION_LENGTH__` allows the compiler's program to be
/// larger than the flash, because it is made smaller afterwards; [`elf::check`] compares the image with the flash.
/// `CHIP` is replaced by the chip's name.
const FLAGS: &str = "-C target-cpu=CHIP -C llvm-args=-inline-threshold=30 -C llvm-args=-tail-dup-placement=false \
                     -C llvm-args=-rotation-max-header-size=4 -C llvm-args=-jump-threading-threshold=3 -C llvm-args=-disable-machine-licm \
                     -C llvm-args=-split-spill-mode=size -C jump-tables=no \
                     -C linker=target/avr/keep-gcc -C link-arg=-mmcu=CHIP -C link-arg=-Wl,--gc-sections -C link-arg=-Wl,--relax \
                     -C link-arg=-Wl,--defsym=__TEXT_REGION_LENGTH__=0x60000";

/// The linker in `FLAGS`: a script that records its arguments. Its path does not name the checkout, because cargo
/// would then build everything anew in a copied checkout. `rustc` chooses the style of options by the end of the
/// name.
const LINKER: &str = "target/avr/keep-gcc";

/// The flags for a chip.
fn flags(chip: &Chip) -> String {
    FLAGS.replace("CHIP", chip.name)
}

/// Returns the folder in which cargo builds for AVR. All boards and chips share it, so that programs for the host are
/// built once.
fn target() -> PathBuf {
    root().join("target/avr")
}

/// Returns the folder of the images: `BOARD.elf`, or `BOARD-MACHINE.elf` if the image is not for the default machine.
/// An image that lacks features is `BOARD-without-FEATURE.elf`.
pub fn directory() -> PathBuf {
    root().join("target/firmware")
}

/// Returns the path of the image of a board and a machine.
pub fn image(board: Board, machine: Machine) -> PathBuf {
    image_without(board, machine, &[])
}

/// Returns the path of the image of a board without some of its features.
fn image_without(board: Board, machine: Machine, without: &[String]) -> PathBuf {
    let machine = match machine == Machine::default() {
        true => String::new(),
        false => format!("-{machine}"),
    };
    let lacks: String = without.iter().map(|feature| format!("-without-{feature}")).collect();
    directory().join(format!("{board}{machine}{lacks}.elf"))
}

/// Builds and checks the image; returns its path.
pub fn build(board: Board, machine: Machine) -> Result<PathBuf> {
    build_without(board, machine, &[])
}

/// Builds and checks the image without some of the board's features; returns its path.
pub fn build_without(board: Board, machine: Machine, without: &[String]) -> Result<PathBuf> {
    if board.is_rp2040() {
        let features = features(board, machine, without)?;
        return rp2040::build(&features, &image_without(board, machine, without));
    }
    compile(board, machine, without)?.finish()
}

/// The compiler's output for an image, whose program is still to be made smaller and linked. That takes half a
/// minute, in which the compiler may work on the next image.
pub struct Compiled {
    text: PathBuf,
    linked: PathBuf,
    image: PathBuf,
}

impl Compiled {
    /// Links and checks the image; returns its path.
    pub fn finish(&self) -> Result<PathBuf> {
        make_small(&self.text, &self.linked, &self.image)
    }
}

/// Compiles an image for AVR.
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

/// Builds and checks the image of a board without any capability except dialects; returns its path.
pub fn build_bare(board: Board) -> Result<PathBuf> {
    compile_bare(board)?.finish()
}

/// Compiles the image of a board for AVR without any capability except dialects.
pub fn compile_bare(board: Board) -> Result<Compiled> {
    let is_capability = |feature: &String| !feature.starts_with("dialect-");
    let without: Vec<_> = board.features()?.into_iter().filter(is_capability).collect();
    compile(board, Machine::default(), &without)
}

/// Returns the Cargo features of an image, separated by commas: those in the board's file, without some of them.
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

/// Links the compiler's program a second time, made smaller. Refuses a program that would not work: see [`elf`].
///
/// `rustc` makes a text and an object in two runs of its back end, which need not agree. So the image is made from
/// the text. The program that is searched for defects of the compiler is also made from the text, without shared
/// code, which would hide the defects.
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
        restart::link(&link, &texts.small, &small, &ATMEGA2560)?;
    }
    keep(&small, elf)
}

/// Whether a file was made after all the others.
fn is_newer(made: &Path, others: &[&Path]) -> bool {
    let time = |path: &Path| std::fs::metadata(path).and_then(|data| data.modified()).ok();
    time(made).is_some_and(|made| {
        others.iter().all(|other| time(other).is_some_and(|other| other < made))
    })
}

/// Copies the image to its own name. Refuses an image that would not work: see [`elf::check`].
fn keep(built: &Path, kept: &Path) -> Result<PathBuf> {
    std::fs::create_dir_all(kept.parent().unwrap_or(kept))?;
    std::fs::copy(built, kept).with_context(|| format!("cannot copy {}", built.display()))?;
    elf::check(kept)?;
    Ok(kept.to_owned())
}

/// Builds and checks the examples of the runtime, `avr-embassy`, and further programs for a bare chip. Returns the
/// folder of the examples, which are `CHIP/NAME.elf` there.
///
/// The example for a clock of which a millisecond is no whole number of counts is `CHIP-uneven-clock/blink.elf`.
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

/// Builds and checks the images that test parts of Kerf on the chip of every board, compiled as for the default
/// board. They are in `parts` beside the images of boards.
fn build_parts() -> Result<()> {
    let features = features(Board::default(), Machine::default(), &[])?;
    let mut cargo = cargo_for(&ATMEGA2560)?;
    cargo.args(["--package", "kerf", "--no-default-features", "--features"]).arg(features);
    keep_examples(cargo, &ATMEGA2560, &PARTS, &directory().join("parts"))
}

/// Builds the image that tests a chip, with the others of `tests/chip`; returns the path of an Intel HEX file. It is
/// short, and what the board had before it stays behind it. So the file also has a jump to 0 where the boot loader goes
/// after a reset by the watchdog.
pub fn build_self_test() -> Result<PathBuf> {
    build_parts()?;
    let elf = directory().join("parts/verify.elf");
    let mut parts = hex::parts(&std::fs::read(&elf)?)?;
    parts.push((restart::CALLED.into(), elf::restart::JUMP.to_vec()));
    let file = elf.with_extension("hex");
    std::fs::write(&file, hex::of_parts(&parts))?;
    Ok(file)
}

/// Builds some examples for a chip, with a feature of the runtime, into a folder.
fn build_examples_of(chip: &Chip, feature: &str, names: &[&str], folder: &Path) -> Result<()> {
    let mut cargo = cargo_for(chip)?;
    cargo.args(["--package", "avr-embassy", "--features"]);
    cargo.arg(format!("{},{feature}", chip.name).trim_end_matches(','));
    keep_examples(cargo, chip, names, folder)
}

/// Returns the cargo command that builds for a chip.
fn cargo_for(chip: &Chip) -> Result<std::process::Command> {
    let rust = Toolchain::find().context("no Rust that can build for AVR; `cargo xtask setup`")?;
    link::write_script(&root().join(LINKER))?;
    let mut cargo = rust.cargo();
    cargo.current_dir(root()).env("RUSTFLAGS", flags(chip)).env_remove(link::KEPT);
    cargo.args(["build", "--release", "-Zbuild-std=core", "--target", "avr-none"]);
    cargo.arg("--target-dir").arg(target());
    Ok(cargo)
}

/// Lets cargo build examples of a package for a chip. Checks them and copies them into a folder.
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
/// The programs of `tests/chip` that are built as images.
const PARTS: [&str; 2] = ["arithmetic", "verify"];

/// `cargo xtask flash`
#[derive(Args)]
pub struct FlashArgs {
    /// The board to build for
    #[arg(long, value_enum, default_value_t)]
    board: Board,
    /// The machine whose settings are the defaults
    #[arg(long, value_enum, default_value_t)]
    machine: Machine,
    /// The board's serial port, such as /dev/ttyACM0; for a Pico in its boot loader the drive that it shows, such as
    /// /media/me/RPI-RP2
    #[arg(long)]
    port: String,
    /// Only print the command
    #[arg(long)]
    dry_run: bool,
}

/// Copies an image to the drive of a boot loader, which writes the image to flash and starts it.
fn copy_to_drive(image: &Path, args: &FlashArgs) -> Result<()> {
    let to = Path::new(&args.port).join("kerf.uf2");
    println!("cp {} {}", image.display(), to.display());
    if args.dry_run {
        return Ok(());
    }
    std::fs::copy(image, &to).context("is the board in its boot loader, and the drive right?")?;
    Ok(())
}

/// Builds the image, then writes it through the boot loader of the board.
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
        let lacks = image_without(Board::Ramps14Cnc, Machine::Careful, &["help".into()]);
        assert_eq!(lacks.file_name().unwrap(), "ramps14-cnc-without-help.elf");
    }

    #[test]
    fn what_is_left_out_is_no_feature_of_the_image() {
        let all = features(Board::Ramps14, Machine::Careful, &[]).unwrap();
        assert!(all.starts_with("board-ramps14,machine-careful,dialect-reprap,"), "{all}");
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
