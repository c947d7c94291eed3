//! The transcripts, played to the firmware on the host, each on a machine of its own.

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

use crate::requests::{Asked, pairs};
use crate::transcript::{self, Transcript};

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

/// Whether the firmware can refuse something for this reason.
fn can_happen(refusal: &&Refusal) -> bool {
    refusal.on(&Built(refusal.on)) == Some(refusal.status)
}

/// Returns the codes of a line, in upper case and spelled as in the documents.
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

/// Whether a code is always refused: cutter compensation.
fn is_always_refused(doc: &Doc) -> bool {
    matches!(doc.number, 410 | 420)
}

/// Returns a setting's name without its motor or axis. One motor or axis stands for all.
fn without_owner(name: &str) -> String {
    match Setting::find(&Name::new().with(name.as_bytes()).expect("short")) {
        Some(setting) if setting.owner() != Owner::System => format!("?{}", &name[1..]),
        _ => name.to_string(),
    }
}

/// Returns the settings and values that transcripts ask for, and how: read, or set and accepted, or set and refused
/// because they are read-only.
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
                // Only if a request has one pair is it certain which pair was refused.
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

/// What grbl's documents define, each as the beginning of a transcript's line: what is sent, or what is heard.
/// Numbers of errors and alarms that cannot occur are listed with their reasons in docs/protocol.md.
fn contract() -> Vec<String> {
    let errors = [1, 2, 3, 4, 5, 8, 9, 11, 14, 15, 16, 20, 21, 22, 24, 25, 26, 28, 29, 30, 31];
    let errors = errors.iter().chain(&[32, 33, 34, 35, 36, 38]).map(|n| format!("<- error:{n}"));
    let alarms = [1, 2, 3, 4, 5, 6, 9].iter().map(|n| format!("<- ALARM:{n}"));
    let settings =
        [0, 1, 2, 3, 4, 5, 6, 10, 11, 12, 13, 20, 21, 22, 23, 24, 25, 26, 27, 30, 31, 32];
    let axes = (10..14).flat_map(|tens| (0..3).map(move |axis| 10 * tens + axis));
    let settings = settings.into_iter().chain(axes).map(|n| format!("<- ${n}="));
    let bytes = (0x84..=0x85).chain(0x90..=0x97).chain(0x99..=0x9E).chain(0xA0..=0xA1);
    let bytes = bytes.map(|byte| format!("\\x{byte:02x}")).chain(["\\x18".into()]);
    let states = "Idle Run Hold:0 Hold:1 Jog Alarm Door:0 Door:1 Door:2 Door:3 Check Sleep";
    let states = states.split(' ').map(|state| format!("<- <{state}|"));
    let fields = "|MPos: |WPos: |Bf: |Ln: |FS: |Pn: |WCO: |Ov: |A:";
    let commands = "$ $$ $# $G $I $N $N0= $N1= $H $HX $X $C $J= $SLP $RST=$ $RST=# $RST=* ? ! ~";
    let commands = commands.split(' ').map(|command| format!("-> {command}"));
    let told = "[HLP: [VER: [OPT: [GC: [G54: [G59: [G28: [G30: [G92: [TLO: [PRB: >G ok Grbl";
    let told = told.split(' ').map(|told| format!("<- {told}"));
    let messages = [
        "Reset to continue",
        "'$H'|'$X' to unlock",
        "Caution: Unlocked",
        "Enabled",
        "Disabled",
        "Pgm End",
        "Restoring defaults",
        "Sleeping",
    ];
    let messages = messages.iter().map(|text| format!("<- [MSG:{text}]"));
    let fields = fields.split(' ').map(str::to_string);
    let all = errors.chain(alarms).chain(settings).chain(bytes).chain(states).chain(fields);
    all.chain(commands).chain(told).chain(messages).collect()
}

#[test]
fn every_row_of_grbls_contract_is_in_some_transcript() {
    let names = std::fs::read_dir("tests/transcripts").unwrap().map(|entry| entry.unwrap().path());
    let is_grbl = |path: &std::path::PathBuf| {
        path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("grbl"))
    };
    let texts = names.filter(is_grbl).map(|path| std::fs::read_to_string(path).unwrap());
    let text: Vec<String> = texts.collect();
    let lines: Vec<&str> = text.iter().flat_map(|text| text.lines()).collect();
    let is_played = |row: &String| {
        let whole = row.starts_with("<- error") || row.starts_with("<- ALARM");
        lines.iter().any(|line| match row.as_bytes() {
            _ if whole => line == row,
            [b'-' | b'<', ..] => line.starts_with(row.as_str()),
            _ => line.contains(row.as_str()),
        })
    };
    let missing: Vec<_> = contract().into_iter().filter(|row| !is_played(row)).collect();
    assert!(missing.is_empty(), "{missing:#?}");
}
