//! The transcripts, played to the firmware on the host: each on a machine of its own.

#[path = "support/transcript.rs"]
mod transcript;

use std::path::Path;

use kerf::hal::imp::Machine;
use transcript::Side;

impl Side for Machine {
    fn send(&mut self, bytes: &[u8]) {
        Machine::send(self, bytes);
    }

    fn set_baud(&mut self, baud: u32) {
        Machine::set_baud(self, baud);
    }

    fn run_ms(&mut self, ms: u64) {
        Machine::run_ms(self, ms);
    }

    fn heard(&mut self) -> Vec<u8> {
        self.received()
    }

    fn steps(&self) -> [i64; 4] {
        self.emitted().position
    }
}

#[test]
fn the_host_machine_keeps_to_the_transcripts() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/transcripts");
    let boot = || Machine::boot(115_200).expect("one machine for each thread");
    transcript::play_all(transcript::read_all(&folder), 16, boot);
}
