//! `cargo xtask verify` at simulated boards, in simulated time: a sound board has no finding, and each fault is found by
//! the check that is for it.

use std::time::Duration;

use embassy_futures::block_on;
use kerf::boards::{Board, MEGA2560_GRBL, MEGA2560_GRBL_LATHE, RAMPS14};
use kerf_sim::mechanics::Random;
use kerf_sim::{Image, Loader, Machine};
use kerf_verify::dialect::of_feature;
use kerf_verify::line::Line;
use kerf_verify::{Image as Which, Jumpers, Outcome, Plan, Report, chip, verify};

use crate::common::{CALLED, JUMP_TO_0, image, part};

/// Cycles between two looks for bytes: half a millisecond.
const SLICE: u64 = 8_000;
/// The timer that counts edges at D47.
const COUNTER: usize = 5;
/// The channel of the analog input that the spindle's pulses are wired to.
const A5: u8 = 5;
/// One bit in so many bytes is wrong on a bad line.
const NOISE: u64 = 300;
/// Number of cells of the EEPROM.
const CELLS: usize = 4_096;
/// The size of the flash below the boot loader.
const FLASH: usize = 0x3_E000;
/// Time in which a person or a program flashes a board, ms.
const FLASHING_MS: u64 = 50;

/// What is wrong with a board.
#[derive(Clone, Copy)]
struct Faults {
    /// Its clock, compared with the nominal one.
    clock: f64,
    /// From this rate on, one bit in 300 bytes is wrong, both ways.
    noise_from: u32,
    /// The board falls silent after so many bytes.
    silent_after: usize,
    /// Kerf is not on it, but another program.
    has_no_kerf: bool,
    /// Each reset brings the values back that it had at first.
    forgets: bool,
    /// Jumpers from the direction pin of X to its lower switch, from its step pin to the counter, and from the pin of the
    /// spindle's pulses to A5.
    has_jumper: bool,
    /// The share of the spindle's pulses that comes through.
    passes: f64,
    /// A line that it accepts, and does not obey.
    ignores: &'static str,
    /// Changes to its chip.
    chip: fn(&mut Machine),
}

const NONE: Faults = Faults {
    clock: 1.0,
    noise_from: u32::MAX,
    silent_after: usize::MAX,
    has_no_kerf: false,
    forgets: false,
    has_jumper: false,
    passes: 1.0,
    ignores: "none",
    chip: |_| {},
};

/// A simulated board behind its boot loader, and the computer at the other end of the line.
struct Simulated {
    machine: Machine,
    board: &'static Board,
    faults: Faults,
    random: Random,
    rate: u32,
    heard: usize,
    /// What it says beside the machine.
    said: Vec<u8>,
    first_cells: Box<[u8; CELLS]>,
    /// What has been checked.
    told: Vec<String>,
}

impl Simulated {
    fn new(board: &'static Board, faults: Faults) -> Self {
        let mut machine = Machine::load(&image(board), board).unwrap();
        machine.install(&Loader::of_debian().unwrap());
        if faults.has_jumper {
            machine.connect(board.motors[0].dir, board.inputs[0].unwrap());
            machine.clock(board.motors[0].step, COUNTER);
        }
        (faults.chip)(&mut machine);
        let (random, first_cells) = (Random::new(1), Box::new(*machine.eeprom()));
        let (rate, heard, told) = (115_200, 0, Vec::new());
        let said = Vec::new();
        Simulated { machine, board, faults, random, rate, heard, said, first_cells, told }
    }

    /// Returns the cycle of a time of the computer's clock.
    fn cycle(&self, time: Duration) -> u64 {
        let hz = f64::from(self.board.clock_hz) * self.faults.clock;
        (time.as_secs_f64() * hz).round() as u64
    }

    /// Spoils some bits.
    fn spoiled(&mut self, mut bytes: Vec<u8>) -> Vec<u8> {
        for byte in bytes.iter_mut().filter(|_| self.rate >= self.faults.noise_from) {
            if self.random.below(NOISE) == 0 {
                *byte ^= 1 << self.random.below(8);
            }
        }
        bytes
    }

    /// Puts the mean of the spindle's pulses on A5.
    fn wire_pulses(&mut self) {
        let Some(pwm) = self.board.pwm.filter(|_| self.faults.has_jumper) else { return };
        let direction = self.machine.peek(pwm.pin().port.address() as u16 - 1);
        let drives = direction >> pwm.pin().bit & 1 != 0;
        let share = if drives { self.machine.pulses().share } else { 0.0 };
        let millivolts = (5_000.0 * share * self.faults.passes).round() as u32;
        self.machine.set_millivolts(A5, millivolts);
    }

    fn set_wire(&mut self, rate: u32) {
        self.rate = rate;
        self.machine.set_baud((f64::from(rate) / self.faults.clock).round() as u32);
    }
}

impl kerf_verify::Board for Simulated {
    async fn flash(&mut self, which: Which) -> Result<(), String> {
        let is_other = which == Which::SelfTest || self.faults.has_no_kerf;
        let elf = if is_other { part("verify") } else { image(self.board) };
        let image = Image::read(&elf).map_err(|error| error.to_string())?;
        self.machine.run_for_ms(FLASHING_MS).map_err(|fault| fault.to_string())?;
        // What was there before stays behind the image, and the file of the self-test has a jump there.
        let mut flash: Vec<u8> = (0..FLASH as u32).map(|at| self.machine.flash(at)).collect();
        flash[..image.flash.len()].copy_from_slice(&image.flash);
        if which == Which::SelfTest {
            flash[CALLED..][..JUMP_TO_0.len()].copy_from_slice(&JUMP_TO_0);
        }
        self.machine.fill_flash(&flash);
        assert!(self.machine.recognises(&image));
        self.reset().await
    }

    async fn reset(&mut self) -> Result<(), String> {
        self.machine.reset();
        self.machine.receive();
        if self.faults.forgets {
            self.machine.set_eeprom(&self.first_cells);
        }
        self.set_wire(115_200);
        Ok(())
    }

    async fn set_rate(&mut self, rate: u32) -> Result<(), String> {
        while self.machine.wire().backlog() > 0 {
            self.machine.run_for_ms(1).map_err(|fault| fault.to_string())?;
        }
        // The last byte, and what a converter takes.
        self.machine.run_for_ms(3).map_err(|fault| fault.to_string())?;
        self.set_wire(rate);
        Ok(())
    }

    async fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        if bytes.strip_suffix(b"\n") == Some(self.faults.ignores.as_bytes()) {
            self.said.extend(b"{\"r\":{},\"f\":[1,0,1]}\n");
            return Ok(());
        }
        let bytes = self.spoiled(bytes.to_vec());
        self.machine.send(&bytes);
        Ok(())
    }

    async fn receive(&mut self, until: Duration) -> Result<Vec<u8>, String> {
        let end = self.cycle(until);
        loop {
            let mut bytes = std::mem::take(&mut self.said);
            bytes.extend(self.machine.receive());
            self.heard += bytes.len();
            let is_silent = self.heard > self.faults.silent_after;
            if !bytes.is_empty() && !is_silent || self.machine.cycle() >= end {
                return Ok(if is_silent { Vec::new() } else { self.spoiled(bytes) });
            }
            let next = self.machine.cycle() + SLICE;
            self.wire_pulses();
            self.machine.run_until(next.min(end)).map_err(|fault| fault.to_string())?;
        }
    }

    fn now(&self) -> Duration {
        let hz = f64::from(self.board.clock_hz) * self.faults.clock;
        Duration::from_secs_f64(self.machine.cycle() as f64 / hz)
    }

    fn tell(&mut self, what: &str) {
        self.told.push(what.to_owned());
    }
}

fn plan(board: &'static Board, faults: Faults, tests_chip: bool) -> Plan {
    Plan {
        board: board.name.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        dialect: board.features.iter().find_map(|feature| of_feature(feature)).unwrap(),
        clock_hz: tests_chip.then_some(board.clock_hz),
        static_end: Image::read(&image(board)).ok().map(|image| image.static_end),
        jumpers: faults.has_jumper.then_some(Jumpers {
            counts: !board.features.contains(&"lathe"),
            pwm: board.pwm.unwrap().channel,
        }),
        seconds: 2,
        seed: 1,
    }
}

/// Makes all checks. The self-test image takes part if `tests_chip`.
fn report(board: &'static Board, faults: Faults, tests_chip: bool) -> Report {
    let mut simulated = Simulated::new(board, faults);
    block_on(verify(&mut simulated, &plan(board, faults, tests_chip)))
}

/// Makes the checks of the chip.
fn chip_report(faults: Faults) -> Report {
    let board = &MEGA2560_GRBL;
    let mut simulated = Simulated::new(board, faults);
    let plan = plan(board, faults, true);
    let mut report = Report::new(&plan);
    block_on(chip::check(&mut Line::new(&mut simulated), &plan, &mut report)).unwrap();
    report
}

fn names(report: &Report, outcome: Outcome) -> Vec<&'static str> {
    let these = report.findings().iter().filter(|one| one.outcome == outcome);
    these.map(|one| one.name).collect()
}

/// Only these checks have failed. Returns what the first of them measured.
fn fails(report: &Report, wanted: &[&str]) -> String {
    assert_eq!(names(report, Outcome::Failed), wanted, "{report}");
    let found = report.findings().iter().find(|one| one.outcome == Outcome::Failed);
    found.unwrap().measured.clone()
}

/// Also the free stack is what the simulator has seen.
#[test]
fn a_sound_board_has_no_finding() {
    let faults = Faults { has_jumper: true, ..NONE };
    let report = report(&MEGA2560_GRBL, faults, true);
    println!("{report}");
    assert!(report.is_sound(), "{report}");
    assert_eq!(names(&report, Outcome::Untried), [""; 0], "{report}");
}

#[test]
fn kerf_is_checked_in_each_dialect() {
    for board in [&MEGA2560_GRBL, &MEGA2560_GRBL_LATHE, &RAMPS14] {
        let report = report(board, NONE, false);
        assert!(report.is_sound(), "{report}");
    }
}

/// The values that a check stores are the old ones afterwards.
#[test]
fn settings_are_as_before() {
    for (board, read) in
        [(&MEGA2560_GRBL, "{uda:n}"), (&MEGA2560_GRBL_LATHE, "$$"), (&RAMPS14, "M503")]
    {
        let mut simulated = Simulated::new(board, NONE);
        let settings = |simulated: &mut Simulated| {
            let mut line = Line::new(simulated);
            block_on(async {
                line.reset().await?;
                line.pass(Duration::from_secs(3)).await?;
                line.say(read).await?;
                let mut all = Vec::new();
                let until = line.now() + Duration::from_secs(1);
                while let Some(one) = line.next(until).await? {
                    all.push(one);
                }
                Ok::<_, String>(all)
            })
            .unwrap()
        };
        let before = settings(&mut simulated);
        assert!(!before.is_empty(), "{before:?}");
        block_on(verify(&mut simulated, &plan(board, NONE, false)));
        assert_eq!(settings(&mut simulated), before, "{}", board.name);
    }
}

#[test]
fn a_dead_cell_is_found() {
    let report = chip_report(Faults { chip: |m| m.stick_cell(0x4D2, 0x10, 0x10), ..NONE });
    assert!(fails(&report, &["EEPROM"]).contains("1 of 4096 cells are bad, the first at 0x4d2"));
}

#[test]
fn a_bad_byte_of_ram_is_found() {
    let report = chip_report(Faults { chip: |m| m.stick_ram(0x1234, 0x02, 0), ..NONE });
    assert!(fails(&report, &["RAM"]).contains("the first at 0x1234"), "{report}");
}

#[test]
fn a_timer_at_a_wrong_rate_is_found() {
    for pace in [0.0, 0.5] {
        let chip = if pace > 0.0 {
            |m: &mut Machine| m.set_pace(4, 0.5)
        } else {
            |m: &mut Machine| m.set_pace(4, 0.0)
        };
        let measured = fails(&chip_report(Faults { chip, ..NONE }), &["timers"]);
        assert!(measured.contains("timer 4 counts"), "{measured}");
    }
}

#[test]
fn a_rate_with_noise_is_found() {
    let report = chip_report(Faults { noise_from: 250_000, ..NONE });
    let measured = fails(&report, &["rates of the line"]);
    assert!(measured.contains("250000 baud") && !measured.contains("230400"), "{measured}");
}

/// The clock of Kerf is wrong, too. The serial line does not bear much more.
#[test]
fn a_wrong_crystal_is_found() {
    let faults = Faults { clock: 0.985, ..NONE };
    let report = report(&MEGA2560_GRBL, faults, true);
    let failed = names(&report, Outcome::Failed);
    for name in ["clock of the chip", "clock of Kerf"] {
        assert!(failed.contains(&name), "{report}");
    }
    let told = report.findings().iter().find(|one| one.name == "clock of the chip");
    let ppm = told.unwrap().measured.split(' ').next().unwrap().parse::<f64>().unwrap();
    assert!((ppm + 15_000.0).abs() < 1_000.0, "{report}");
}

#[test]
fn a_crystal_that_is_far_off_lets_nothing_be_tried() {
    let report = report(&MEGA2560_GRBL, Faults { clock: 1.12, ..NONE }, true);
    assert_eq!(names(&report, Outcome::Failed), ["self-test image", "Kerf"], "{report}");
    assert_eq!(names(&report, Outcome::Sound), [""; 0], "{report}");
}

#[test]
fn another_program_is_not_taken_for_kerf() {
    let faults = Faults { has_no_kerf: true, ..NONE };
    let measured = fails(&report(&MEGA2560_GRBL, faults, false), &["Kerf"]);
    assert!(measured.contains("no answer"), "{measured}");
}

#[test]
fn a_board_that_forgets_is_found() {
    let faults = Faults { forgets: true, ..NONE };
    for board in [&MEGA2560_GRBL, &MEGA2560_GRBL_LATHE, &RAMPS14] {
        let report = report(board, faults, false);
        assert!(names(&report, Outcome::Failed).contains(&"settings through a reset"), "{report}");
    }
}

/// What a board accepts and does not obey is no result, and what is not restored is told.
#[test]
fn a_board_that_does_not_obey_is_found() {
    for (ignores, name, tells) in [
        ("{3pm:0}", "job", "the job does not run: {3pm:n} answers 2"),
        ("{3pm:2}", "job", "NOT RESTORED, please send: {3pm:2}"),
        ("{uda0:\"0x0\"}", "settings through a reset", "NOT RESTORED, please send: {uda0:\"0x0\"}"),
        ("G1 X", "job in check mode", "the wrong line \"G1 X\" is accepted"),
        ("G1 F600 X0.13 Y0.07 Z0.00", "job", "in place of"),
        ("g1 x-0.1 y4 f800", "switch to last step", "not the switch has stopped the machine"),
    ] {
        let faults = Faults { ignores, has_jumper: true, ..NONE };
        // What a check leaves undone may fail another one behind it.
        let report = report(&MEGA2560_GRBL, faults, false);
        let found = report.findings().iter().find(|one| one.outcome == Outcome::Failed).unwrap();
        assert!(found.name == name && found.measured.contains(tells), "{ignores}: {report}");
    }
}

/// The counter stands still.
#[test]
fn pulses_that_are_not_those_of_the_step_pin_are_found() {
    let loose = Faults { has_jumper: true, chip: |m| m.set_pace(COUNTER, 0.0), ..NONE };
    let measured = fails(&report(&MEGA2560_GRBL, loose, false), &["pulses at the step pin"]);
    assert_eq!(measured, "0 pulses, 10240 steps");
}

#[test]
fn a_duty_cycle_that_is_wrong_is_found() {
    for (passes, measured) in [(0.9, "22.1 %, 44.7 %, 67.2 %"), (0.0, "0.0 %, 0.0 %, 0.0 %")] {
        let report = chip_report(Faults { has_jumper: true, passes, ..NONE });
        assert_eq!(fails(&report, &["duty cycle"]), measured);
    }
}

/// Wherever the board falls silent, the checks end, and at least one has failed.
#[test]
fn a_board_that_falls_silent_ends_the_checks() {
    let mut random = Random::new(3);
    for _ in 0..4 {
        let silent_after = random.below(3_000) as usize;
        let report = report(&MEGA2560_GRBL, Faults { silent_after, ..NONE }, false);
        assert!(!names(&report, Outcome::Failed).is_empty(), "{silent_after}: {report}");
    }
}
