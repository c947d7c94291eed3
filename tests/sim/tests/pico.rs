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
use kerf_sim::{AUX, LINES_IN_FLIGHT, Runs, USB};

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

    fn wire(&mut self, switches: &[(usize, i64, bool)]) {
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

/// What a board has that this one lacks, or what the emulator has not: whole names, or their beginnings.
const LACKS: [&str; 0] = [];

#[test]
#[ignore = "needs the emulator: a stage of `cargo xtask test`"]
fn the_image_keeps_to_the_transcripts() {
    let mut all = transcript::read_all(Path::new("../transcripts"));
    all.retain(|one| !LACKS.iter().any(|name| one.name.starts_with(name)));
    transcript::play_all(all, 2, board);
}
