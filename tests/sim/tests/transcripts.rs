//! The transcripts, played to the firmware's image on the simulated chip.

mod common;
#[path = "../../support/transcript.rs"]
mod transcript;

use std::path::Path;

use common::firmware;
use kerf::boards::{MEGA2560_GRBL, Pin};
use kerf_sim::{AUX, Machine};
use transcript::Side;

impl Side for Machine {
    fn send(&mut self, bytes: &[u8]) {
        Machine::send(self, bytes);
    }

    fn send_aux(&mut self, bytes: &[u8]) {
        Machine::send_to(self, AUX, bytes);
    }

    fn set_aux_cts(&mut self, stop: bool) {
        self.set_cts(AUX, stop);
    }

    fn heard_aux(&mut self) -> Vec<u8> {
        self.receive_from(AUX)
    }

    fn set_baud(&mut self, baud: u32) {
        Machine::set_baud(self, baud);
    }

    fn run_ms(&mut self, ms: u64) {
        self.run_for_ms(ms).unwrap();
    }

    fn heard(&mut self) -> Vec<u8> {
        self.receive()
    }

    fn set_input(&mut self, input: usize, closed: bool) {
        let pin = self.board().inputs[input].expect("a pin");
        self.drive_pin(pin.port.letter(), pin.bit, !closed);
    }

    fn steps(&self) -> [i64; 4] {
        self.recorder().motors().each_ref().map(|motor| motor.position)
    }

    fn outputs(&self) -> (u8, f64) {
        let pins = self.board().outputs.iter().enumerate();
        let high = |(bit, pin): (usize, &Option<Pin>)| {
            u8::from(pin.is_some_and(|pin| self.is_high(pin))) << bit
        };
        (pins.map(high).sum(), self.pulses().share)
    }
}

#[test]
fn the_image_keeps_to_the_transcripts() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../transcripts");
    transcript::play_all(transcript::read_all(&folder), 2, || firmware(&MEGA2560_GRBL));
}
