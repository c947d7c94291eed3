//! The transcripts, played to the firmware on the host: each on a machine of its own.

#[path = "support/transcript.rs"]
mod transcript;

use std::path::Path;

use kerf::gcode::codes::docs::{self, Doc, On, Refusal};
use kerf::gcode::setup::{AxisMode, Cycle, Setup};
use kerf::hal::imp::Machine;
use kerf::units::Length;
use transcript::{Side, Transcript};

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

    fn set_input(&mut self, input: usize, closed: bool) {
        Machine::set_input(self, input, closed);
    }

    fn steps(&self) -> [i64; 4] {
        self.emitted().position
    }
}

fn read_all() -> Vec<Transcript> {
    transcript::read_all(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/transcripts"))
}

#[test]
fn the_host_machine_keeps_to_the_transcripts() {
    let boot = || Machine::boot(115_200).expect("one machine for each thread");
    transcript::play_all(read_all(), 16, boot);
}

/// The machine of an example as it is built so far: without switches.
struct Built(On);

impl Setup for Built {
    fn mode(&self, axis: u8) -> AxisMode {
        self.0.mode(axis)
    }
    fn radius(&self, axis: u8) -> u32 {
        self.0.radius(axis)
    }
    fn travel(&self, axis: u8) -> Option<(Length, Length)> {
        self.0.travel(axis)
    }
    fn can(&self, _cycle: Cycle) -> bool {
        false
    }
}

/// Whether the firmware can refuse this for its reason.
fn can_happen(refusal: &&Refusal) -> bool {
    refusal.on(&Built(refusal.on)) == Some(refusal.status)
}

/// The codes of a line, in upper case and as the documents write them.
fn codes(line: &str) -> Vec<String> {
    let line = line.to_ascii_uppercase();
    let mut codes: Vec<String> = Vec::new();
    let mut is_code = false;
    for c in line.chars().filter(|c| *c != ' ') {
        match c {
            '(' | ';' => break,
            'G' | 'M' => codes.push(c.to_string()),
            '0'..='9' | '.' if is_code => codes.last_mut().unwrap().push(c),
            _ => {}
        }
        is_code = c == 'G' || c == 'M' || is_code && (c == '.' || c.is_ascii_digit());
    }
    codes
}

#[test]
fn every_code_and_every_refusal_is_in_some_transcript() {
    let transcripts = read_all();
    let exchanges: Vec<_> = transcripts.iter().flat_map(Transcript::exchanges).collect();
    let seen = |name: Option<&str>, status: u8| {
        let end = format!(",\"f\":[1,{status},");
        exchanges.iter().any(|(sent, heard)| {
            let named = name.is_none_or(|name| codes(sent).iter().any(|code| code == name));
            named && heard.contains(&end)
        })
    };
    let mut missing = Vec::new();
    for doc in docs::docs() {
        let name = doc.name();
        if !seen(Some(&name), 0) && !is_always_refused(doc) {
            missing.push(format!("{name}, carried out"));
        }
        for refusal in doc.refusals.iter().filter(can_happen) {
            if !seen(Some(&name), refusal.status as u8) {
                missing.push(format!("{name}, refused with {}", refusal.status as u8));
            }
        }
    }
    for refusal in docs::RULES.iter().flat_map(|rule| rule.refusals) {
        if !seen(None, refusal.status as u8) {
            missing.push(format!("{:?}", refusal.lines));
        }
    }
    assert!(missing.is_empty(), "in no transcript:\n{}", missing.join("\n"));
}

/// Of cutter compensation, or in need of switches.
fn is_always_refused(doc: &Doc) -> bool {
    doc.refusals.iter().any(|refusal| refusal.on == On::NoSwitches)
        || matches!(doc.number, 410 | 420)
}
