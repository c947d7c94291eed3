//! Builds and runs fixtures, and runs the firmware itself.

#[macro_use]
mod rows;
pub mod printing;
pub mod share;
mod simulated;
pub mod turning;

use std::path::{Path, PathBuf};
use std::process::Command;

use kerf::boards::{Board, MEGA2560_GRBL};
use kerf_sim::{Host, Image, LINES_IN_FLIGHT, Machine};

/// Returns the folder of the profile's programs, in which this program lies too. Cargo runs tests in the package's
/// folder. A path fixed at compile time would be wrong in a copied checkout.
fn programs() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.ancestors().nth(2).expect("deps/test in the folder of the profile").to_owned()
}

/// The simulator's program.
pub fn kerf_sim() -> Command {
    let program = programs().join("kerf-sim");
    let name = program.display();
    assert!(program.exists(), "no {name}: `cargo build -p kerf-sim` makes it");
    Command::new(program)
}

/// A file for a test to write.
pub fn scratch(name: &str) -> PathBuf {
    let folder = programs().join("scratch");
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

/// Compiles a fixture and returns the ELF file's path.
pub fn build(name: &str) -> PathBuf {
    let source = Path::new("../fixtures").join(name);
    // Tests run at the same time: each writes a file of its own.
    let unique = format!("{name}.{:?}.elf", std::thread::current().id());
    let elf = scratch(&unique.replace(['(', ')'], ""));
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

/// Returns the folder of the images.
fn images() -> PathBuf {
    std::env::var_os("KERF_ELF_DIR")
        .map_or_else(|| PathBuf::from("../../../target/firmware"), PathBuf::from)
}

/// Returns the path of the firmware's image for a board.
pub fn image(board: &Board) -> PathBuf {
    let elf = images().join(format!("{}.elf", board.name));
    let (elf_name, name) = (elf.display(), board.name);
    assert!(elf.exists(), "no {elf_name}: `cargo xtask build --board {name}` makes it");
    elf
}

/// Returns the path of the image of a part of Kerf, which `cargo xtask examples` builds from `tests/chip`.
pub fn part(name: &str) -> PathBuf {
    let elf = images().join("parts").join(format!("{name}.elf"));
    assert!(elf.exists(), "no {}: `cargo xtask examples` makes it", elf.display());
    elf
}

/// A machine that runs the firmware.
pub fn firmware(board: &'static Board) -> Machine {
    Machine::load(&image(board), board).unwrap()
}

/// The register with the mask of the tick's interrupt.
const TIMSK0: u16 = 0x6E;
/// The variable that counts milliseconds, the lowest byte first.
const MILLIS: &str = "avr_embassy::time::MILLIS";

/// Sets the clock of a machine that has just been started to `ms` before the wrap, as if it had run for 49.7 days.
pub fn age(machine: &mut Machine, ms: u32) {
    // The clock is set before any task waits for a time.
    while machine.peek(TIMSK0) == 0 {
        machine.run_until(machine.cycle() + 16).unwrap();
    }
    let count = machine.image().variable(MILLIS).expect("the count of milliseconds");
    for (at, byte) in (count..).zip(ms.wrapping_neg().to_le_bytes()) {
        machine.poke(at, byte);
    }
}

/// A machine that runs the firmware and has booted, and a sender.
pub fn booted(board: &'static Board) -> (Machine, Host) {
    let (mut machine, mut host) = (firmware(board), Host::new(LINES_IN_FLIGHT));
    host.boot(&mut machine, 1_000).unwrap();
    (machine, host)
}

/// Sends a line that must be accepted.
pub fn set(machine: &mut Machine, host: &mut Host, line: &str) {
    let response = host.ask(machine, line, 5_000).unwrap();
    assert_eq!(response.status, 0, "{line} is answered by {}", response.raw);
}

/// Where the boot loader calls after a reset by the watchdog, and an instruction there that starts the program.
pub const CALLED: usize = 0x2_0000;
pub const JUMP_TO_0: [u8; 4] = [0x0C, 0x94, 0, 0];

/// Cycles in a millisecond.
pub const MS: u64 = 16_000;
/// Time of a byte on the wire at 115,200 baud, in cycles.
const BYTE: u64 = 1_389;

/// Sends a byte ahead of all others, and returns the cycle at which its last bit has come.
pub fn say_now(machine: &mut Machine, byte: u8) -> u64 {
    let sent = machine.wire().sent() + 1;
    machine.send_now(byte);
    last_bit(machine, sent)
}

/// Sends a line when no other is waiting, and returns the cycle at which its last bit has come.
pub fn say_line(machine: &mut Machine, host: &mut Host, line: &str) -> u64 {
    let before = machine.wire().sent();
    host.send(machine, 0, line);
    let bytes = machine.wire().backlog() as u64;
    last_bit(machine, before + bytes)
}

/// Runs until `sent` bytes have been sent, and returns the cycle at which the last bit of the last byte has come.
fn last_bit(machine: &mut Machine, sent: u64) -> u64 {
    while machine.wire().sent() < sent {
        machine.run_until(machine.cycle() + 16).unwrap();
    }
    machine.cycle() + BYTE
}
