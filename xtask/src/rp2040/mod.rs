//! Boards with an RP2040: builds their images, and converts them for the chip's boot loader.

pub mod uf2;

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use object::{File, Object, ObjectSection, SectionFlags, SectionKind};

use crate::process::{root, run};
use crate::toolchain::Toolchain;

/// The instruction set of its cores.
const TARGET: &str = "thumbv6m-none-eabi";

/// Linker scripts of `cortex-m-rt` and `embassy-rp`, which find `memory.x` in the folder of the chip's sources. With
/// `--nmagic` sections are not aligned to pages. `--wrap` has `src/hal/rp2040/early.rs` run before memory is initialised,
/// around what `embassy-rp` runs then.
const FLAGS: &str = "-C linker=ld.lld -C link-arg=-Tlink.x -C link-arg=-Tlink-rp.x -C link-arg=-Lsrc/hal/rp2040 -C link-arg=--nmagic -C link-arg=--wrap=__pre_init";

/// Flash that the image may take: 2 MiB minus the part of `memory.x` that stores settings.
const FLASH: u64 = (2 << 20) - (68 << 10);
/// RAM for statics and for code, of 264 KiB; the rest is for the stack (`src/hal/rp2040/memory.x`).
const STATIC_RAM: u64 = 252 << 10;

/// The sizes of an image, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Code, constants and initial values.
    pub flash: u64,
    /// Statics, and code that runs there.
    pub ram: u64,
}

/// Builds an image with these features, and copies it to its own name.
pub fn build(features: &str, image: &Path) -> Result<PathBuf> {
    let rust = Toolchain::find().context("no Rust that can build for it; `cargo xtask setup`")?;
    let target = root().join("target/rp2040");
    let mut cargo = rust.cargo();
    cargo.current_dir(root()).env("RUSTFLAGS", flags()?);
    cargo.args(["build", "--release", "-Zbuild-std=core", "--target", TARGET, "--target-dir"]);
    cargo.arg(&target).args(["--package", "kerf", "--bin", "kerf", "--no-default-features"]);
    run(cargo.arg("--features").arg(features))?;
    let built = target.join(TARGET).join("release/kerf");
    std::fs::create_dir_all(image.parent().unwrap_or(image))?;
    std::fs::copy(&built, image).with_context(|| format!("cannot copy {}", built.display()))?;
    check(image)?;
    std::fs::write(image.with_extension("uf2"), uf2::of_elf(&std::fs::read(image)?)?)?;
    Ok(image.to_owned())
}

/// Returns the flags for the compiler. Cargo does not see that a linker script has changed, so a symbol has its hash.
fn flags() -> Result<String> {
    let script = std::fs::read(root().join("src/hal/rp2040/memory.x"))?;
    let mut hasher = DefaultHasher::new();
    script.hash(&mut hasher);
    Ok(format!("{FLAGS} -C link-arg=--defsym=__memory_x={:#x}", hasher.finish() as u32))
}

/// Prints the sizes of an image, and fails past a cap.
pub fn show(image: &Path) -> Result<()> {
    let sizes = check(image)?;
    println!("{}", image.display());
    println!("flash        {:>7} of {FLASH}", sizes.flash);
    println!("static RAM   {:>7} of {STATIC_RAM}", sizes.ram);
    Ok(())
}

/// Refuses an image that is too large.
fn check(image: &Path) -> Result<Sizes> {
    let sizes = sizes(&std::fs::read(image)?)?;
    ensure!(sizes.flash <= FLASH, "flash {} > {FLASH}", sizes.flash);
    ensure!(sizes.ram <= STATIC_RAM, "static RAM {} > {STATIC_RAM}", sizes.ram);
    Ok(sizes)
}

/// Returns what an ELF file puts into flash, and into RAM.
fn sizes(elf: &[u8]) -> Result<Sizes> {
    /// From this address up, addresses mean RAM.
    const RAM: u64 = 0x2000_0000;
    const ALLOCATED: u64 = object::elf::SHF_ALLOC as u64;
    let file = File::parse(elf)?;
    let mut sizes = Sizes::default();
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else { continue };
        if sh_flags & ALLOCATED == 0 {
            continue;
        }
        let has_bytes = section.kind() != SectionKind::UninitializedData;
        sizes.flash += if has_bytes { section.size() } else { 0 };
        sizes.ram += if section.address() >= RAM { section.size() } else { 0 };
    }
    Ok(sizes)
}
