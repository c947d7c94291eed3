//! The transcripts, played to the firmware on the host: each on a machine of its own.

#[path = "support/host.rs"]
mod host;
#[path = "support/requests.rs"]
mod requests;
#[path = "support/side.rs"]
mod side;
#[path = "support/transcript.rs"]
mod transcript;

use std::collections::HashSet;
use std::path::Path;

use kerf::config::table::Kind;
use kerf::config::{Name, Owner, Setting};
use kerf::gcode::codes::docs::{self, Doc, On, Refusal};
use kerf::gcode::setup::{AxisMode, Setup};
use kerf::hal::imp::Machine;
use kerf::protocol::tinyg::{names, number};
use kerf::status::Status;
use kerf::units::Length;
use requests::{Asked, pairs};
use transcript::Transcript;

fn read_all() -> Vec<Transcript> {
    transcript::read_all(Path::new("tests/transcripts"))
}

#[test]
fn the_host_machine_keeps_to_the_transcripts() {
    let boot = || Machine::boot(115_200).expect("one machine for each thread");
    transcript::play_all(read_all(), 16, boot);
}

/// The machine of an example as it is built: it has a probe.
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
    fn homing(&self, axis: u8) -> Result<(), Status> {
        self.0.homing(axis)
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
            if !seen(Some(&name), number(refusal.status)) {
                missing.push(format!("{name}, refused with {}", number(refusal.status)));
            }
        }
    }
    for refusal in docs::RULES.iter().flat_map(|rule| rule.refusals) {
        if !seen(None, number(refusal.status)) {
            missing.push(format!("{:?}", refusal.lines));
        }
    }
    assert!(missing.is_empty(), "in no transcript:\n{}", missing.join("\n"));
}

/// Of cutter compensation.
fn is_always_refused(doc: &Doc) -> bool {
    matches!(doc.number, 410 | 420)
}

/// A setting of one motor or axis stands for that of the others.
fn without_owner(name: &str) -> String {
    match Setting::find(&Name::new().with(name.as_bytes()).expect("short")) {
        Some(setting) if setting.owner() != Owner::System => format!("?{}", &name[1..]),
        _ => name.to_string(),
    }
}

/// What the settings and values of the machine are asked for: read, or set and taken, or set and refused for they are
/// read-only.
fn asked_for(transcripts: &[Transcript]) -> HashSet<(String, &'static str)> {
    let mut asked = HashSet::new();
    for (sent, heard) in transcripts.iter().flat_map(Transcript::exchanges) {
        let (ok, fixed) = (heard.contains("\"f\":[1,0,"), heard.contains("\"f\":[1,104,"));
        let pairs = pairs(&sent);
        for pair in pairs.iter().filter(|pair| pair.name.len() <= 5) {
            let name = without_owner(&pair.name);
            asked.insert((name.clone(), "asked for"));
            match (pair.reads(), &*pairs) {
                (true, _) if ok => asked.insert((name, "read")),
                (false, _) if ok => asked.insert((name, "set")),
                // Of one pair it is certain that it is the one that was refused.
                (false, [Asked { .. }]) if fixed => asked.insert((name, "refused")),
                _ => false,
            };
        }
    }
    asked
}

#[test]
fn every_name_is_in_some_transcript() {
    let asked = asked_for(&read_all());
    let was = |name: &str, how| asked.contains(&(name.to_string(), how));
    let mut missing = Vec::new();
    for name in names() {
        let short = without_owner(&name);
        let (group, _) = name.split_at(name.len() - 1);
        let setting = Setting::find(&Name::new().with(name.as_bytes()).expect("short"));
        let wants: &[&str] = match setting.map(|setting| setting.row().kind) {
            Some(Kind::Constant | Kind::Text) => &["read", "refused"],
            Some(_) => &["read", "set"],
            None => &["asked for"],
        };
        for want in wants {
            if !(was(&short, want) || setting.is_none() && was(group, "read")) {
                missing.push(format!("{name}, {want}"));
            }
        }
    }
    assert!(missing.is_empty(), "in no transcript:\n{}", missing.join("\n"));
}
