//! The way onto the board: Debian's `avrdude`, with the command of the README, and the boot loader of the Arduino Mega,
//! which runs on the simulated chip and programs its flash. Simulated time passes only while the loader has something to
//! do, so nothing here depends on the speed of the computer.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::Duration;

use kerf::boards::{MEGA2560_GRBL, MEGA2560_LATHE, RAMPS14_CNC};
use kerf_sim::job::{self, Options};
use kerf_sim::pty::{Peer, Pty};
use kerf_sim::{Host, Image, Loader, Machine};

use crate::common::{build, image, scratch};
use crate::hex;

/// A short job.
const JOB: &str = "G21 G90\nG0 X10\nG1 X3 F600\nG0 X-2\nM2\n";
/// Where the boot section begins.
const BOOT: u32 = 0x3_E000;
/// From here on the loader erases no page.
const NOT_ERASED: usize = 0x3_C000;

/// A board of which the flash holds the program in an ELF file below the boot loader.
fn board(elf: &Path) -> Machine {
    let mut machine = Machine::load(elf, &MEGA2560_GRBL).unwrap();
    machine.install(&Loader::of_debian().unwrap());
    machine
}

/// Writes the Intel HEX file of an image, as a release has it.
fn hex_of(elf: &Path) -> PathBuf {
    let text = hex::of_elf(&std::fs::read(elf).unwrap()).unwrap();
    written(&text)
}

/// Writes a file of its own for each thread.
fn written(text: &str) -> PathBuf {
    let name = format!("{:?}.hex", std::thread::current().id()).replace(['(', ')'], "");
    let path = scratch(&name);
    std::fs::write(&path, text).unwrap();
    path
}

/// A program that ends when the test ends, however that happens.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Flashes a file with the command of the README. Returns whether `avrdude` reports success, and what it says.
fn avrdude(machine: &mut Machine, file: &Path) -> (bool, String) {
    let mut pty = Pty::new().unwrap();
    let said = file.with_extension("said");
    let mut command = Command::new("avrdude");
    command.args(["-p", "m2560", "-c", "wiring", "-P"]).arg(pty.path());
    command.args(["-b", "115200", "-D", "-U"]).arg(format!("flash:w:{}:i", file.display()));
    command.stderr(File::create(&said).unwrap());
    let mut avrdude =
        Running(command.spawn().expect("avrdude, which `cargo xtask setup` installs"));
    let status = loop {
        if pty.wait(Duration::from_millis(20)).unwrap() == Peer::Closed {
            std::thread::sleep(Duration::from_millis(1));
        }
        let bytes = pty.read().unwrap();
        if !bytes.is_empty() {
            machine.send(&bytes);
            pty.write(&answer(machine)).unwrap();
        }
        if let Some(status) = avrdude.0.try_wait().unwrap() {
            break status;
        }
    };
    (status.success(), std::fs::read_to_string(said).unwrap())
}

/// Longest time from the last byte of a command to the first of its answer, ms: a page is erased and written.
const LONGEST: u32 = 30;

/// Runs until the loader has answered, or has nothing to answer. Returns the answer.
fn answer(machine: &mut Machine) -> Vec<u8> {
    let (mut answer, mut silent) = (Vec::new(), 0);
    while silent < LONGEST {
        machine.run_for_ms(1).unwrap();
        let more = machine.receive();
        if more.is_empty() && !answer.is_empty() {
            break;
        }
        silent = if more.is_empty() && machine.wire().backlog() == 0 { silent + 1 } else { 0 };
        answer.extend(more);
    }
    answer
}

/// Resets the board by DTR, and lets the loader start.
fn reset(machine: &mut Machine) {
    machine.reset();
    machine.run_for_ms(20).unwrap();
}

/// Runs the job from the greeting on, and checks every step.
fn works(machine: &mut Machine) {
    let report = job::run(machine, &job::lines_of(JOB), &Options::default(), |_| {}).unwrap();
    assert!(report.ok, "{report}");
}

/// Runs until the greeting. Returns how long after the reset it came, ms.
fn greeting(machine: &mut Machine, from: u64, longest_ms: u64) -> Option<u64> {
    let mut host = Host::new(1);
    let end = from + machine.cycles(longest_ms);
    while host.banners() == 0 {
        if !host.run_until_line(machine, end).unwrap() {
            return None;
        }
    }
    Some((machine.cycle() - from) / machine.cycles(1))
}

/// After a reset by the watchdog the loader goes to 0x20000, in the middle of each image. There is a jump to the start:
/// the firmware comes back, as a whole and at once, without the second that the loader waits otherwise.
#[test]
fn the_firmware_comes_back_when_the_watchdog_has_bitten() {
    const TIMSK0: u16 = 0x6E;
    for firmware in [&MEGA2560_GRBL, &MEGA2560_LATHE, &RAMPS14_CNC] {
        let mut machine = Machine::load(&image(firmware), firmware).unwrap();
        machine.install(&Loader::of_debian().unwrap());
        let mut host = Host::new(1);
        host.boot(&mut machine, 3_000).unwrap();
        host.ask(&mut machine, "g1 f400 x1", 5_000).unwrap();
        for (act, longest, cause) in [(true, 8_000, 3), (false, 8_000, 4)] {
            let resets = machine.resets();
            match act {
                true => machine.poke(TIMSK0, 0),
                false => machine.send(b"{reset:1}\n"),
            }
            let end = machine.cycle() + machine.cycles(longest);
            while machine.resets() == resets {
                machine.run_for_ms(1).unwrap();
                assert!(machine.cycle() < end, "{}: no reset", firmware.name);
            }
            machine.receive();
            let from = machine.cycle();
            let ms = greeting(&mut machine, from, 3_000).unwrap();
            assert!(ms < 300, "{}: {ms} ms", firmware.name);
            let told = host.ask(&mut machine, "{rst:n}", 1_000).unwrap();
            assert_eq!(told.body["rst"], cause, "{}: {}", firmware.name, told.raw);
            host.ask(&mut machine, "{clear:n}", 1_000).unwrap();
        }
        let steps = machine.recorder().steps();
        host.ask(&mut machine, "g1 f400 x2", 5_000).unwrap();
        host.run_for_ms(&mut machine, 2_000).unwrap();
        assert!(machine.recorder().steps() > steps, "{}: it moves again", firmware.name);
    }
}

#[test]
fn an_image_is_flashed_over_another_and_works() {
    let mut machine = board(&image(&RAMPS14_CNC));
    machine.run_for_ms(2_000).unwrap();
    assert!(machine.pc() < BOOT, "the old image runs");
    reset(&mut machine);
    let elf = image(&MEGA2560_GRBL);
    let (ok, said) = avrdude(&mut machine, &hex_of(&elf));
    assert!(ok && said.contains("bytes of flash verified"), "{said}");
    assert!(machine.recognises(&Image::read(&elf).unwrap()));
    works(&mut machine);
}

/// Moves, settings and reports, so that all of the firmware has been at work, and then `{boot:1}`.
#[test]
fn the_firmware_starts_the_loader_which_flashes_another_image() {
    let mut machine = Machine::load(&image(&MEGA2560_GRBL), &RAMPS14_CNC).unwrap();
    machine.install(&Loader::of_debian().unwrap());
    let mut host = Host::new(1);
    host.boot(&mut machine, 3_000).unwrap();
    for line in ["{si:100}", "m3 s1000", "g1 f900 x3", "m5"] {
        host.ask(&mut machine, line, 5_000).unwrap();
    }
    host.run_for_ms(&mut machine, 2_000).unwrap();
    let answer = host.ask(&mut machine, "{boot:1}", 1_000).unwrap();
    assert_eq!(answer.status, 16, "{}", answer.raw);
    machine.run_for_ms(400).unwrap();
    assert!(machine.pc() >= BOOT, "{}", machine.place(machine.pc()));
    let left: Vec<_> =
        (0x20..0x137).filter(|at| !is_known(*at) && machine.peek(*at) != 0).collect();
    assert!(left.is_empty(), "registers that a reset would have set to 0: {left:x?}");
    let elf = image(&RAMPS14_CNC);
    let (ok, said) = avrdude(&mut machine, &hex_of(&elf));
    assert!(ok, "{said}");
    assert!(machine.recognises(&Image::read(&elf).unwrap()));
    works(&mut machine);
}

/// Whether a register may differ from 0 in the loader.
fn is_known(at: u16) -> bool {
    let known = [
        // The levels of the pins.
        0x20..=0x20,
        0x106..=0x106,
        // The loader's LED, and its USART.
        0x23..=0x25,
        0xC0..=0xC6,
        // RAMPZ, EIND, the stack pointer, SREG.
        0x5B..=0x5F,
        // OSCCAL, and the status of TWI, which is 0xF8 at rest.
        0x66..=0x66,
        0xB9..=0xB9,
    ];
    known.iter().any(|range| range.contains(&at))
}

/// The loader answers to nothing that a sender says, but each byte makes it wait longer for a command.
#[test]
fn what_is_sent_too_early_delays_the_firmware_and_nothing_else() {
    let elf = build("echo.c");
    let mut machine = board(&elf);
    let from = machine.cycle();
    let usual = greeting(&mut machine, from, 3_000).unwrap();
    assert!((800..1_100).contains(&usual), "{usual} ms");
    machine.reset();
    let from = machine.cycle();
    machine.run_for_ms(100).unwrap();
    machine.send(b"{fv:n}\n");
    let late = greeting(&mut machine, from, 15_000).unwrap();
    assert!((4_000..7_000).contains(&late), "{late} ms");
    for early in ["{fv:n}\n", "?"] {
        machine.reset();
        machine.run_for_ms(100).unwrap();
        machine.send(early.as_bytes());
        machine.run_for_ms(100).unwrap();
        let (ok, said) = avrdude(&mut machine, &hex_of(&elf));
        assert!(ok, "{said}");
        works(&mut machine);
    }
}

#[test]
fn a_sender_that_keeps_asking_keeps_the_loader() {
    let mut machine = board(&build("echo.c"));
    for _ in 0..48 {
        machine.run_for_ms(250).unwrap();
        machine.send(b"?");
    }
    assert!(machine.pc() >= BOOT, "after 12 s it is still in the loader");
}

#[test]
fn three_marks_open_the_monitor_of_the_loader() {
    let mut machine = board(&build("echo.c"));
    machine.run_for_ms(100).unwrap();
    machine.send(b"!!!");
    machine.run_for_ms(10_000).unwrap();
    let said = machine.receive();
    assert!(
        said.starts_with(b"!!!!!") && machine.pc() >= BOOT,
        "{}",
        String::from_utf8_lossy(&said)
    );
}

/// The loader erases no page from 0x3C000 on. What is flashed there is mixed with what was there before.
#[test]
fn an_image_that_is_too_large_is_not_flashed_over_another() {
    let elf = build("echo.c");
    let mut machine = board(&elf);
    let old = vec![0x55; BOOT as usize];
    machine.fill_flash(&old);
    reset(&mut machine);
    let mut flash = vec![0xA5; NOT_ERASED + 256];
    let program = Image::read(&elf).unwrap().flash;
    flash[..program.len()].copy_from_slice(&program);
    let (ok, said) = avrdude(&mut machine, &written(&hex::of_parts(&[(0, flash)])));
    assert!(!ok && said.contains("verification"), "{said}");
    assert_eq!(machine.flash(NOT_ERASED as u32 - 1), 0xA5, "erased, and written");
    assert_eq!(machine.flash(NOT_ERASED as u32), 0x55 & 0xA5, "written over the old content");
}

/// The loader clears the flags of the chip, so all resets but those that the firmware makes itself look alike.
#[test]
fn a_brown_out_behind_the_loader_is_told_as_a_reset_by_the_button() {
    const MCUSR: u16 = 0x54;
    let mut machine = board(&image(&MEGA2560_GRBL));
    let mut host = Host::new(1);
    host.boot(&mut machine, 3_000).unwrap();
    machine.reset();
    assert_eq!(machine.peek(MCUSR), 1 << 1, "the chip stores that the reset was external");
    machine.poke(MCUSR, 1 << 2);
    host.boot(&mut machine, 3_000).unwrap();
    let cause = host.ask(&mut machine, "{rst:n}", 1_000).unwrap();
    assert_eq!(cause.body["rst"], 1, "{}", cause.raw);
}
