//! Building fixtures and running them.
#![allow(dead_code)]

use std::path::{Path, PathBuf};
use std::process::Command;

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::{Image, Machine};

/// Compiles a fixture and returns the ELF file's path.
pub fn build(name: &str) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name);
    let scratch = Path::new(env!("CARGO_TARGET_TMPDIR"));
    // Tests run at the same time: each writes a file of its own.
    let unique = format!("{name}.{:?}.elf", std::thread::current().id());
    let elf = scratch.join(unique.replace(['(', ')'], ""));
    let status = Command::new("avr-gcc")
        .args(["-mmcu=atmega2560", "-Os", "-DF_CPU=16000000UL", "-o"])
        .arg(&elf)
        .arg(&source)
        .status()
        .expect("avr-gcc, which `cargo xtask setup` installs");
    assert!(status.success(), "{name} does not compile");
    elf
}

/// A machine that runs a fixture.
pub fn machine(name: &str) -> Machine {
    Machine::load(&build(name), &MEGA2560_GRBL).unwrap()
}

/// A machine that runs bare instruction words.
pub fn machine_of(words: &[u16]) -> Machine {
    Machine::new(Image::from_words(words), &MEGA2560_GRBL).unwrap()
}

/// A 16-bit variable of the fixture.
pub fn word(machine: &Machine, name: &str) -> u16 {
    let addr = machine.image().variable(name);
    machine.peek_word(addr.unwrap_or_else(|| panic!("no variable {name}")))
}
