//! USB of the emulated RP2040 when it is in trouble: damaged packets, a bus that sleeps or is reset, a cable that comes
//! out, a controller that hangs (erratum E15), a request that the computer gives up; and restarts by the computer. The
//! tests run like those of `pico.rs`.

use std::ops::Range;

use kerf::boards::PICO;
use kerf_sim::emulated::{Emulated, Fault};
use kerf_sim::mechanics::Random;
use kerf_sim::{Host, USB};
use serde_json::Value;

use crate::common::image;
use crate::common::share::share_of_seeds;
use crate::seeds;

/// A board that has greeted, and speaks TinyG's dialect.
fn booted() -> Emulated {
    let mut board = Emulated::load(&image(&PICO), &PICO).unwrap();
    Host::new(1).boot(&mut board, 1_000).unwrap();
    let heard = ask(&mut board, "{x:{vm:5000,fr:5000,ac:1000},sv:0}\n", 50);
    assert!(heard.contains("\"f\":[1,0,"), "{heard}");
    board
}

/// Sends a text, and returns what is heard within `ms` milliseconds.
fn ask(board: &mut Emulated, text: &str, ms: u64) -> String {
    board.send_to(USB, text.as_bytes());
    hear(board, ms)
}

fn hear(board: &mut Emulated, ms: u64) -> String {
    board.run_for_ms(ms).unwrap();
    String::from_utf8_lossy(&board.receive_from(USB)).into_owned()
}

/// A value of the board.
fn value(board: &mut Emulated, token: &str) -> i64 {
    let heard = ask(board, &format!("{{{token}:n}}\n"), 50);
    let found = heard.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let found = found.rev().find_map(|line| line["r"][token].as_i64());
    found.unwrap_or_else(|| panic!("{token}: {heard}"))
}

/// A question, and the beginning of its answer.
const QUESTION: &str = "{hv:n}\n";
/// See [`QUESTION`].
const ANSWER: &str = "\"r\":{\"hv\":";

/// Has a program open the port as soon as it can, and ask. Returns after how many ms it is answered, within a second, and
/// what it hears.
fn recovers(board: &mut Emulated) -> (Option<u64>, String) {
    let mut heard = String::new();
    for ms in (10..=1_000).step_by(10) {
        if board.bus().ready && ms % 50 == 0 {
            board.send_to(USB, QUESTION.as_bytes());
        }
        heard += &hear(board, 10);
        if heard.contains(ANSWER) {
            return (Some(ms), heard);
        }
    }
    (None, heard)
}

fn x(board: &Emulated) -> i64 {
    Emulated::steps(board)[0]
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_controller_that_hangs_is_restarted_and_the_job_goes_on() {
    let mut board = booted();
    // They fill the queue, which moves on without the computer.
    let lines = |x: &str| format!("g91 g1 f1500 x{x}\n").repeat(450);
    ask(&mut board, &(lines(".1") + &lines("-.1")), 200);
    board.trouble(Fault::Hang);
    ask(&mut board, "{posx:n}\n", 5);
    assert_eq!((board.bus().hangs, board.bus().ready), (1, true), "the computer knows nothing");
    let (took, heard) = recovers(&mut board);
    println!("it took {took:?} ms");
    assert!(took.is_some(), "{heard}");
    assert_eq!((value(&mut board, "usbr"), board.bus().attached), (1, 2));
    let before = x(&board);
    hear(&mut board, 20);
    assert_ne!(x(&board), before, "the job goes on");
    ask(&mut board, "!", STOPS_MS);
    let held = x(&board);
    hear(&mut board, 300);
    assert!(x(&board) == held && held != 0);
    ask(&mut board, "~", 5_000);
    assert_eq!(x(&board), 0, "no step is lost");
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_computer_that_sleeps_or_is_gone_restarts_nothing() {
    let mut board = booted();
    for fault in [Fault::Sleep(5_000), Fault::Sleep(4), Fault::Unplug(5_000), Fault::Unplug(2)] {
        board.trouble(fault);
        hear(&mut board, 5_100);
        let (took, heard) = recovers(&mut board);
        assert!(took.is_some(), "{fault:?}: {heard}");
    }
    assert_eq!((value(&mut board, "usbr"), value(&mut board, "usbe")), (0, 0));
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_stack_that_waits_for_ever_is_begun_anew() {
    // A request that is given up; and a resume that is lost.
    for (n, fault) in [Fault::Abort, Fault::Skip(20)].into_iter().enumerate() {
        let mut board = booted();
        board.trouble(fault);
        let (took, heard) = recovers(&mut board);
        println!("{fault:?} took {took:?} ms");
        assert!(took.is_some(), "{fault:?}: {heard}");
        assert_eq!((value(&mut board, "usbr"), board.bus().attached), (1, 2 - n as u64));
    }
}

/// What has been sent of half a line is not put before the next program's line, wherever its bytes are.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn half_a_line_is_dropped_though_the_buffers_are_full() {
    let mut board = booted();
    // The moves fill the queue; the lines behind them wait in pool, ring, and the chip.
    let lines: String = (0..1_200).map(|_| "g91 g1 f3000 x.05\n").collect();
    for cut in [0, 7, 16] {
        let from = x(&board);
        ask(&mut board, &(lines.clone() + &"g91 g1 f3000 x.05\n"[..cut]), 150);
        board.trouble(Fault::Reset);
        let (took, heard) = recovers(&mut board);
        assert!(took.is_some(), "{heard}");
        let answers = heard + &ask(&mut board, "g91 g1 f3000 x.05\n", 5_000);
        assert!(!answers.contains("[1,1"), "{answers}");
        assert_eq!((x(&board) - from) % 64, 0);
    }
}

/// The motors stand still so long after a `!`; half of it is the ramp.
const STOPS_MS: u64 = 400;

/// Steps of a line of the job, by its number.
fn length(line: u64) -> i64 {
    64 * (1 + line as i64 % 3)
}

/// A job of lines that each move X on, so that the position tells which of them have been carried out.
struct Job {
    board: Emulated,
    random: Random,
    /// Lines that have been carried out, and their steps.
    done: u64,
    at: i64,
    slowest: u64,
}

impl Job {
    fn new(seed: u64) -> Self {
        let mut board = booted();
        // Some noise all the time.
        let one_in = [0, 40, 15][seed as usize % 3];
        board.trouble(Fault::Noise { seed, one_in });
        Self { board, random: Random::new(seed), done: 0, at: 0, slowest: 0 }
    }

    fn below(&mut self, numbers: u64) -> u64 {
        self.random.below(numbers)
    }

    /// A fault, and how long it lasts, ms.
    fn fault(&mut self) -> (Fault, u64) {
        let damages = ["token", "crc", "stuffing", "answer", "ack", "data"];
        match self.below(10) {
            0..=2 => (Fault::Hang, 0),
            3 => {
                let ms = 1 + self.below(400);
                (Fault::Sleep(ms), ms + 20)
            }
            4 => {
                let ms = 1 + self.below(40);
                (Fault::Skip(ms), ms)
            }
            5 | 6 => {
                let ms = 1 + self.below(400);
                (Fault::Unplug(ms), ms)
            }
            7 => (Fault::Reset, 0),
            8 => (Fault::Abort, 0),
            _ => {
                let kind = damages[self.below(damages.len() as u64) as usize];
                (Fault::Damage(kind, 1 + self.below(2)), 0)
            }
        }
    }

    /// Sends lines, has a fault come between them, and looks what was carried out.
    fn suffer(&mut self) -> Result<(), String> {
        // Now and then more lines than the queue has room for.
        let count = if self.below(8) == 0 { 1_150 } else { 5 + self.below(60) };
        let feed = 2_000 + self.below(3_000);
        let lines = self.done..self.done + count;
        let line = |n| format!("g91 g1 f{feed} x{:.2}\n", length(n) as f64 / 1_280.0);
        let text: String = lines.clone().map(line).collect();
        let (delay, (fault, ms)) = (self.below(3_000), self.fault());
        let case = format!("{fault:?} after {delay} us of {count} lines");
        let lost = self.board.bus().lost;
        let attached = self.board.bus().attached;
        self.board.send_to(USB, text.as_bytes());
        self.board.run_for_us(delay).unwrap();
        self.board.trouble(fault);
        let heard = hear(&mut self.board, ms);
        let heard = heard + &self.comes_back().map_err(|what| format!("{case}: {what}"))?;
        let is_kept = self.board.bus().attached == attached && self.board.bus().lost == lost;
        // A `!` would wait behind lines that have no room.
        let is_full = is_kept && count > 1_000;
        let heard = heard + &self.stops(is_full).map_err(|what| format!("{case}: {what}"))?;
        let heard = heard + &self.rests();
        self.judge(lines, &heard, is_kept).map_err(|what| format!("{case}: {what}\n{heard}"))
    }

    /// Waits until the program is answered.
    fn comes_back(&mut self) -> Result<String, String> {
        let waiting = self.board.waiting();
        let (took, heard) = recovers(&mut self.board);
        match took {
            Some(ms) => self.slowest = self.slowest.max(ms),
            // The question waits behind the lines of the job, which go on.
            None if waiting > 0 && self.board.waiting() < waiting && !heard.is_empty() => {}
            None => return Err(format!("no answer in a second: {heard}")),
        }
        Ok(heard)
    }

    /// Holds the job, unless the buffers are full.
    fn stops(&mut self, is_full: bool) -> Result<String, String> {
        if is_full || self.below(3) > 0 {
            return Ok(String::new());
        }
        let mut heard = ask(&mut self.board, "!", STOPS_MS);
        let held = x(&self.board);
        heard += &hear(&mut self.board, 100);
        if x(&self.board) != held {
            return Err(format!("`!` does not stop the motors within {STOPS_MS} ms"));
        }
        Ok(heard + &ask(&mut self.board, "~", 20))
    }

    /// Waits until nothing moves any more.
    fn rests(&mut self) -> String {
        let mut heard = String::new();
        for _ in 0..200 {
            let before = x(&self.board);
            heard += &hear(&mut self.board, 60);
            if x(&self.board) == before && self.board.waiting() == 0 {
                break;
            }
        }
        heard
    }

    /// Finds out how many of the lines have been carried out: those that were acknowledged, each once; all, if the
    /// connection was kept.
    fn judge(&mut self, lines: Range<u64>, heard: &str, is_kept: bool) -> Result<(), String> {
        let answers = heard.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        let answers: Vec<_> = answers.filter(|answer| answer["r"].is_object()).collect();
        if let Some(bad) = answers.iter().find(|answer| answer["f"][1] != 0) {
            return Err(format!("refused: {bad}"));
        }
        let is_empty =
            |answer: &&Value| answer["r"].as_object().is_some_and(serde_json::Map::is_empty);
        let acknowledged = answers.iter().filter(is_empty).count() as u64;
        let at = x(&self.board);
        while self.done < lines.end && self.at < at {
            self.at += length(self.done);
            self.done += 1;
        }
        let done = self.done - lines.start;
        if self.at != at {
            return Err(format!("X is at {at}, and no number of lines ends there"));
        }
        if done < acknowledged || is_kept && self.done < lines.end {
            return Err(format!("{done} lines carried out, {acknowledged} acknowledged"));
        }
        Ok(())
    }
}

/// Faults of a seed, one after the other.
const FAULTS: u64 = 20;

fn job(seed: u64) -> Result<(), String> {
    let mut job = Job::new(seed);
    for n in 0..FAULTS {
        job.suffer().map_err(|what| format!("fault {n}: {what}"))?;
    }
    let restarts = value(&mut job.board, "usbr");
    let errors = value(&mut job.board, "usbe");
    println!(
        "seed {seed}: the slowest answer after {} ms, {restarts} restarts, {} hangs, {errors} ms with errors, {} lines",
        job.slowest,
        job.board.bus().hangs,
        job.done
    );
    Ok(())
}

/// A seed in the short run; with `KERF_LONG=1` 50, which is a thousand faults.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_job_survives_all_faults() {
    seeds::try_each(share_of_seeds(5, 1), job);
}

/// A request to an interface: type, request, interface.
fn to_interface(kind: u8, request: u8, interface: u8) -> [u8; 8] {
    [kind, request, 0, 0, interface, 0, 0, 0]
}

/// As `picotool` makes them: of class, to interface 2.
const BOOT_LOADER: [u8; 8] = [0x21, 1, 0, 0, 2, 0, 0, 0];
/// See [`BOOT_LOADER`].
const FIRMWARE: [u8; 8] = [0x21, 2, 0, 0, 2, 0, 0, 0];

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_computer_restarts_a_machine_that_rests() {
    let mut board = booted();
    hear(&mut board, 100);
    assert_eq!(board.request(FIRMWARE, 5).unwrap().as_deref(), Some(""), "it is answered first");
    assert_eq!(board.resets(), 0);
    let heard = hear(&mut board, 500);
    assert!(board.resets() == 1 && heard.contains("SYSTEM READY"), "{heard}");
    assert_eq!(value(&mut board, "rst"), 4, "asked for");
    assert_eq!(board.request(BOOT_LOADER, 100).unwrap().as_deref(), Some(""));
    assert!(board.loads());
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_machine_that_does_not_rest_refuses_to_restart() {
    let mut board = booted();
    for (begins, ends) in
        [("g1 f600 x2\n", ""), ("m3 s1000\n", "m5\n"), ("g1 f600 x4\n!", "~"), ("g4 p0.3\n", "")]
    {
        ask(&mut board, begins, 60);
        for request in [BOOT_LOADER, FIRMWARE, to_interface(0x41, 1, 2)] {
            let answered = board.request(request, 10).unwrap();
            assert_eq!(answered.as_deref(), Some("stall"), "{begins}");
        }
        ask(&mut board, ends, 1_500);
    }
    assert_eq!((board.resets(), board.loads(), x(&board)), (0, false, 4 * 1_280));
    // Others than these two, and to another interface.
    for request in [to_interface(0x21, 3, 2), to_interface(0x41, 1, 3)] {
        assert_eq!(board.request(request, 100).unwrap().as_deref(), Some("stall"), "{request:?}");
    }
    assert!(ask(&mut board, QUESTION, 50).contains(ANSWER) && !board.loads());
}

/// The bytes of hexadecimal digits.
fn bytes(hex: &str) -> Vec<u8> {
    let digits = hex.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).unwrap());
    digits.map(|pair| u8::from_str_radix(pair, 16).unwrap()).collect()
}

/// The serial port stays one function of two interfaces; the restart is another, and Windows loads WinUSB for that alone.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn descriptors_keep_the_port_and_the_restart_apart() {
    let mut board = booted();
    let all = bytes(&board.bus().descriptors);
    assert_eq!((usize::from(all[2]), all[4]), (all.len(), 3), "length, interfaces");
    let mut found = Vec::new();
    let mut rest = &all[..];
    while let Some((descriptor, behind)) =
        rest.split_at_checked(usize::from(*rest.first().unwrap_or(&255)))
    {
        match descriptor[1] {
            // An association: first interface, how many, class.
            11 => found.push(("IAD", descriptor[2], descriptor[3], descriptor[4..7].to_vec())),
            // An interface: its number, its endpoints, class.
            4 => found.push(("interface", descriptor[2], descriptor[4], descriptor[5..8].to_vec())),
            _ => {}
        }
        rest = behind;
    }
    assert!(rest.is_empty());
    let expected = [
        ("IAD", 0, 2, vec![2, 2, 0]),
        ("interface", 0, 1, vec![2, 2, 0]),
        ("interface", 1, 2, vec![10, 0, 0]),
        ("IAD", 2, 1, vec![0xFF, 0, 1]),
        ("interface", 2, 0, vec![0xFF, 0, 1]),
    ];
    assert_eq!(found, expected);
    let device = board.request([0x80, 6, 0, 1, 0, 0, 18, 0], 20).unwrap().unwrap();
    assert_eq!(bytes(&device)[4..7], [0xEF, 2, 1], "a device with associations");
    assert_eq!(bytes(&device)[8..12], [0x09, 0x12, 0x01, 0x00], "the pair for tests");
    let platform = board.request([0x80, 6, 0, 15, 0, 0, 64, 0], 20).unwrap().unwrap();
    assert!(platform.contains("df60ddd88945c74c9cd2659d9e648a9f"), "{platform}");
    let sets = board.request([0xC0, 0x20, 0, 0, 7, 0, 64, 0], 20).unwrap().unwrap();
    let sets = bytes(&sets);
    assert_eq!(usize::from(sets[8]), sets.len());
    // The set of the function that begins at interface 2, and its driver.
    assert!(sets.windows(5).any(|part| part == [8, 0, 2, 0, 2]), "{sets:?}");
    assert!(sets.windows(6).any(|part| part == b"WINUSB"), "{sets:?}");
}
