//! The image of `pico-cnc` on the emulated RP2040. `cargo xtask test` runs these in a stage of their own, which installs the emulator; else
//! `cargo test -p kerf-sim --profile sim --test pico -- --ignored` does, behind a `cargo xtask sim --board pico-cnc`.

mod common;
#[path = "../../support/side.rs"]
mod side;
#[path = "../../support/transcript.rs"]
mod transcript;

use std::path::Path;

use common::image;
use kerf::boards::inputs::{ENDS, PROBE};
use kerf::boards::{Board, PICO_CNC};
use kerf_sim::emulated::{Emulated, Near, job};
use kerf_sim::job::lines_of;
use kerf_sim::{AUX, Host, LINES_IN_FLIGHT, Runs, USB};

use side::Side;

fn board() -> Emulated {
    Emulated::load(&image(&PICO_CNC), &PICO_CNC).unwrap()
}

impl Side for Emulated {
    fn send(&mut self, bytes: &[u8]) {
        self.send_to(USB, bytes);
    }

    fn send_aux(&mut self, bytes: &[u8]) {
        self.send_to(AUX, bytes);
    }

    // The board has no pins for that.
    fn set_aux_cts(&mut self, _stop: bool) {}

    fn stops_aux(&self) -> bool {
        false
    }

    fn set_baud(&mut self, baud: u32) {
        Runs::set_baud(self, baud);
    }

    fn run_ms(&mut self, ms: u64) {
        self.run_for_ms(ms).unwrap();
    }

    fn heard(&mut self) -> Vec<u8> {
        self.receive_from(USB)
    }

    fn heard_aux(&mut self) -> Vec<u8> {
        self.receive_from(AUX)
    }

    fn set_input(&mut self, input: usize, closed: bool) {
        if let Some(pin) = PICO_CNC.inputs[input] {
            self.drive(pin, !closed);
        }
    }

    fn wire(&mut self, switches: &[(usize, i64, bool)], _pulses: u32) {
        let near = |(input, step, opens): &(usize, i64, bool)| {
            Some(Near {
                gpio: PICO_CNC.inputs[*input]?.bit,
                motor: if *input == PROBE { 2 } else { input / 2 },
                step: *step,
                above: *input < ENDS && input % 2 == 1,
                opens: *opens,
            })
        };
        Emulated::wire(self, &switches.iter().filter_map(near).collect::<Vec<_>>());
    }

    fn turn_spindle(&mut self, _rpm: f64, _pulses: u32) {
        panic!("the emulated board has no spindle: `TURNING` names the transcripts that turn one");
    }

    fn steps(&self) -> [i64; 4] {
        Emulated::steps(self)
    }

    fn outputs(&self) -> (u8, f64) {
        let Board { outputs, pwm, .. } = PICO_CNC;
        let high = |(bit, pin): (usize, &Option<_>)| {
            u8::from(pin.is_some_and(|pin| self.is_high(pin))) << bit
        };
        let share = pwm.map_or(0.0, |pwm| self.share(pwm.pin()));
        (outputs.iter().enumerate().map(high).sum(), share)
    }
}

/// Runs a job, which must end on its exact steps.
fn run(name: &str, text: &str, settings: &[&str]) -> String {
    let settings: Vec<_> = settings.iter().map(ToString::to_string).collect();
    let mut board = board();
    let report = job::run(&mut board, &lines_of(text), &settings, LINES_IN_FLIGHT, |_| ());
    let report = report.unwrap();
    assert!(report.problems.is_empty(), "{name}: {report}");
    report.to_string()
}

#[test]
#[ignore = "needs the emulator: a stage of `cargo xtask test`"]
fn jobs_end_on_their_steps() {
    for name in ["square", "spiral"] {
        let text = std::fs::read_to_string(format!("../../examples/{name}.gcode")).unwrap();
        print!("{}", run(name, &text, &[]));
    }
}

/// A board that has been powered up, and a sender.
fn booted() -> (Emulated, Host) {
    let (mut board, mut host) = (board(), Host::new(LINES_IN_FLIGHT));
    host.boot(&mut board, 1_000).unwrap();
    (board, host)
}

/// Sends a line that must be taken.
fn set(board: &mut Emulated, host: &mut Host, line: &str) {
    let response = host.ask(board, line, 5_000).unwrap();
    assert_eq!(response.status, 0, "{line} is answered by {}", response.raw);
}

/// The value of a token.
fn value(board: &mut Emulated, host: &mut Host, token: &str) -> f64 {
    let response = host.ask(board, &format!("{{{token}:n}}"), 5_000).unwrap();
    response.body[token].as_f64().unwrap_or_else(|| panic!("{}", response.raw))
}

/// Whether the machine says that it is where the pins have put it, X and Y, of 1,280 steps a millimetre.
fn assert_counted(board: &mut Emulated, host: &mut Host) {
    let steps = Emulated::steps(board);
    for (m, token) in ["mpox", "mpoy"].into_iter().enumerate() {
        let said = value(board, host, token) * 1_280.0;
        assert!((said - steps[m] as f64).abs() < 0.7, "{token}: {said} and {} steps", steps[m]);
    }
}

#[test]
#[ignore = "needs the emulator: a stage of `cargo xtask test`"]
fn a_hold_loses_no_step_and_a_flush_counts_them() {
    let (mut board, mut host) = booted();
    set(&mut board, &mut host, "g1 x20 y13 f800");
    host.run_for_ms(&mut board, 400).unwrap();
    board.send_now(b'!');
    host.run_for_ms(&mut board, 300).unwrap();
    let held = Emulated::steps(&board);
    host.run_for_ms(&mut board, 200).unwrap();
    assert_eq!(Emulated::steps(&board), held, "it stands still");
    assert!(held[0] > 1_000 && held[0] < 25_600);
    board.send_now(b'~');
    host.run_for_ms(&mut board, 3_000).unwrap();
    assert_eq!(Emulated::steps(&board), [25_600, 16_640, 0, 0]);

    set(&mut board, &mut host, "g1 x0 y0");
    host.run_for_ms(&mut board, 500).unwrap();
    board.send_now(b'!');
    host.run_for_ms(&mut board, 300).unwrap();
    board.send_now(b'%');
    host.run_for_ms(&mut board, 100).unwrap();
    assert_counted(&mut board, &mut host);
    set(&mut board, &mut host, "g1 x0 y0");
    host.run_for_ms(&mut board, 3_000).unwrap();
    assert_eq!(Emulated::steps(&board), [0; 4], "from where it stood");
}

/// From the edge of a limit switch to the last step.
const STOP_US: f64 = 17.0;

#[test]
#[ignore = "needs the emulator: a stage of `cargo xtask test`"]
fn a_limit_stops_at_once_and_steps_are_counted() {
    for wait_us in [0, 13, 170, 411] {
        let (mut board, mut host) = booted();
        for line in ["{x:{vm:2340,jm:1e5,ac:2000},y:{vm:2340,jm:1e5,ac:2000},sv:0}", "{xsn:2}"] {
            set(&mut board, &mut host, line);
        }
        set(&mut board, &mut host, "g0 x60 y40");
        host.run_for_ms(&mut board, 200).unwrap();
        let until = board.cycle() + wait_us * 128;
        host.run_until(&mut board, until).unwrap();
        let edge = board.cycle();
        board.drive(PICO_CNC.inputs[0].unwrap(), false);
        host.run_for_ms(&mut board, 100).unwrap();
        let after = board.last_step().unwrap().saturating_sub(edge) as f64 / 128.0;
        println!("{after:.1} us, {:?}", Emulated::steps(&board));
        assert!(after <= STOP_US, "{after} us");
        board.drive(PICO_CNC.inputs[0].unwrap(), true);
        host.run_for_ms(&mut board, 100).unwrap();
        set(&mut board, &mut host, "{clear:1}");
        assert_counted(&mut board, &mut host);
        set(&mut board, &mut host, "g0 x0 y0");
        host.run_for_ms(&mut board, 3_000).unwrap();
        assert_eq!(Emulated::steps(&board), [0; 4], "back from where it stood");
    }
}

#[test]
#[ignore = "needs the emulator: a stage of `cargo xtask test`"]
fn settings_survive_a_power_cut_and_a_reset() {
    let (mut board, mut host) = booted();
    for line in ["{xvm:1234}", "{4mi:32}", "g10 l2 p3 x1.5 y-2"] {
        set(&mut board, &mut host, line);
    }
    host.run_for_ms(&mut board, 500).unwrap();
    assert_eq!(value(&mut board, &mut host, "kept"), 1.0);
    for cut in [true, false] {
        match cut {
            true => board.cut_power(),
            false => board.send_now(0x18),
        }
        host.boot(&mut board, 2_000).unwrap();
        assert_eq!(value(&mut board, &mut host, "xvm"), 1_234.0);
        assert_eq!(value(&mut board, &mut host, "4mi"), 32.0);
        set(&mut board, &mut host, "g56");
        assert_eq!(value(&mut board, &mut host, "ofsy"), -2.0);
        assert_eq!(value(&mut board, &mut host, "rst"), if cut { 0.0 } else { 4.0 });
    }
}

#[test]
#[ignore = "needs the emulator: a stage of `cargo xtask test`"]
fn settings_may_change_often() {
    let (mut board, mut host) = booted();
    for n in 0..20 {
        set(&mut board, &mut host, &format!("{{xvm:{}}}", 500 + n));
        host.run_for_ms(&mut board, 30).unwrap();
    }
    host.run_for_ms(&mut board, 500).unwrap();
    board.cut_power();
    host.boot(&mut board, 2_000).unwrap();
    assert_eq!(value(&mut board, &mut host, "xvm"), 519.0);
}

/// What is not so here, by the beginnings of names. More rates of the line can be made (`baud`), steps may come faster (`rates`, `settings-motor`,
/// `grbl-settings`), no port has RTS and CTS (`ports-pins`), the sensors of a spindle have pins of their own
/// (`encoder`), settings are kept sooner (`stored`), and the boot loader, which is in ROM, is not emulated (`boot-loader`).
const DIFFERS: [&str; 8] = [
    "baud",
    "boot-loader",
    "encoder",
    "grbl-settings",
    "ports-pins",
    "rates",
    "settings-motor",
    "stored",
];
/// Those with a spindle that turns: the emulated board has none.
const TURNING: [&str; 5] =
    ["grbl-lathe", "grbl-thread", "lathe-feed", "thread-reports", "thread-retract"];
/// Those that move for long, minutes of the emulator's time each: `KERF_TRANSCRIPT` plays one.
const LONG: [&str; 2] = ["far", "axis-modes"];

#[test]
#[ignore = "needs the emulator: a stage of `cargo xtask test`"]
fn the_image_keeps_to_the_transcripts() {
    let mut all = transcript::read_all(Path::new("../transcripts"));
    let left_out = DIFFERS.iter().chain(&TURNING).chain(LONG.iter().filter(|_| all.len() > 1));
    let left_out: Vec<_> = left_out.collect();
    all.retain(|one| !left_out.iter().any(|name| one.name.starts_with(**name)));
    transcript::play_all(all, 2, board);
}
