//! Generates `docs/gcode.md` from the documentation of the codes.

use std::format;
use std::string::{String, ToString};
use std::vec::Vec;

use super::{Doc, On, RULES, Refusal, SECTIONS, docs};
use crate::capability::Capability;
use crate::gcode::codes::{Action, NonModal};
use crate::gcode::words::{AXES, COUNT, LETTERS};
use crate::protocol::tinyg::{number, status_text};
use crate::status::Status;

const PREFACE: &str = "\
# G-code

<!-- Made from `src/gcode/codes` by `cargo xtask docs`: change it there. -->

Kerf runs the G-code of RS274/NGC, and some codes of LinuxCNC and TinyG. A line that is refused changes
nothing and moves nothing; its response has the status.

The order of the words in a line has no effect. A line runs in this order: units, feed mode, F, S, T, M6, spindle,
coolant, overrides, dwell, plane, tool length, coordinate system, path, distances, retract mode, G10 G28 G30 G92
and related codes, motion, stop.

Differences from some other controllers:

- F is in the units of its own line: `G20 F10` is 10 inches per minute.
- G53 is for G0 and G1 only; its words are absolute even in G91.
- G28 and G30 with axis words move only the named axes.
- G43 without H uses the tool in the spindle; H0 is no tool.
- M6 stops the spindle. The machine then waits for `~`; with `{psw:0}` it does not wait.
- P of G2 and G3 counts turns as in LinuxCNC: `P1` is the arc alone. TinyG and g2core add P turns to an arc.
- With G7 R of a canned cycle along X is a diameter, as X is; in LinuxCNC R is a radius.
- G0 or G1 beside G28, G30, G10 or G92 is refused if both could use the axis words: leave G0 out.
- Axis words behind G80, homing or probing need a G0 or G1; no motion code comes back by itself.
- Comments may contain comments; LinuxCNC refuses them.
- A label may be used again; in LinuxCNC it names one block.
- G88 retracts by itself after its stop.
- G95 uses the programmed S. With an encoder, feeds are slower while the spindle is slower than S.
- M48 to M51 act after the moves before them, without a stop; override requests (`mfo`) act at once.
- M2 and M30 reset more than the standard says; see M2.

";

/// Returns the whole document.
pub fn markdown() -> String {
    let mut text = PREFACE.to_string();
    text += "## Overview\n\nWords in bold are required; of the axes at least one. A code with a capability is refused with status ";
    text += &format!("{} by an image\nthat lacks it: see ", number(Status::NotBuiltIn));
    text += "[what an image may lack](protocol.md#what-an-image-may-lack).\n\n";
    text += "| Code | | Group | Words | Capability |\n|---|---|---|---|---|\n";
    let mut sorted: Vec<_> = docs().collect();
    sorted.sort_by_key(|doc| (doc.letter, doc.number));
    for doc in sorted {
        let anchor = anchor(&heading(doc));
        let (group, words, needs) = (group(doc), words(doc), capability(doc));
        let name = doc.name();
        text += &format!("| [{name}](#{anchor}) | {} | {group} | {words} | {needs} |\n", doc.title);
    }
    text += "\n## Every line\n";
    for rule in RULES {
        text += &format!("\n### {}\n\n{}", rule.title, wrapped(rule.text));
        text += &refused(rule.refusals);
    }
    for section in SECTIONS {
        text += &format!("\n## {}\n", section.title);
        if !section.intro.is_empty() {
            text += &format!("\n{}", wrapped(section.intro));
        }
        for doc in section.docs {
            text += &format!("\n### {}\n\n{}", heading(doc), wrapped(doc.text));
            text += &refused(doc.refusals);
        }
    }
    text + &settings()
}

/// Returns the text, broken into lines of at most 110 characters.
fn wrapped(text: &str) -> String {
    let (mut lines, mut column) = (String::new(), 0);
    for word in text.split(' ') {
        if column > 0 && column + word.len() >= 110 {
            lines.push('\n');
            column = 0;
        } else if column > 0 {
            lines.push(' ');
        }
        lines += word;
        column += word.len() + 1;
    }
    lines + "\n"
}

fn heading(doc: &Doc) -> String {
    format!("{} {}", doc.name(), doc.title)
}

/// Returns the name of a heading in links.
fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || *c == ' ' || *c == '-');
    kept.collect::<String>().to_lowercase().replace(' ', "-")
}

/// Returns the number of the modal group, as in RS274/NGC.
fn group(doc: &Doc) -> &'static str {
    let Some(row) = doc.row() else { return "" };
    match row.action {
        Action::NonModal(_) => "0",
        Action::Motion(_) => "1",
        Action::Plane(_) => "2",
        Action::Distance(_) => "3",
        Action::ArcDistance(_) => "4",
        Action::FeedMode(_) => "5",
        Action::Units(_) => "6",
        Action::CutterOff | Action::CutterOn => "7",
        Action::ToolLength(_) => "8",
        Action::Retract(_) => "10",
        Action::System(_) => "12",
        Action::Path(_) => "13",
        Action::SpeedMode(_) => "14",
        Action::XMode(_) => "15",
        Action::Stop(_) => "M 4",
        Action::ToolChange => "M 6",
        Action::Spindle(_) => "M 7",
        Action::Coolant(_) => "M 8",
        Action::Override(_) => "M 9",
    }
}

/// Returns the capability that an image needs for the code. Empty if every image has the code.
fn capability(doc: &Doc) -> String {
    match doc.row().map(|row| row.action) {
        Some(Action::Motion(mode)) => {
            mode.capability().map_or(String::new(), |needed| format!("`{}`", needed.name()))
        }
        Some(Action::NonModal(NonModal::Heat(_))) => format!("`{}`", Capability::Printer.name()),
        Some(Action::SpeedMode(_) | Action::XMode(_)) => format!("`{}`", Capability::Lathe.name()),
        _ => String::new(),
    }
}

/// Returns the words of a code, with the needed words in bold.
fn words(doc: &Doc) -> String {
    let Some(row) = doc.row() else { return String::new() };
    let [needed, other] = [letters(row.needs), letters(row.takes & !row.needs)];
    match (needed.as_str(), other.as_str()) {
        ("", _) => other,
        (_, "") => format!("**{needed}**"),
        _ => format!("**{needed}** {other}"),
    }
}

/// Returns the letters of a set of words.
fn letters(set: u32) -> String {
    let mut parts = Vec::new();
    let axes = set & AXES == AXES;
    if axes {
        parts.push("axes".to_string());
    }
    let rest = if axes { set & !AXES } else { set };
    let one = |slot: &usize| rest & 1 << slot != 0;
    parts.extend((0..COUNT).filter(one).map(|slot| char::from(LETTERS[slot]).to_string()));
    parts.join(" ")
}

/// Returns a table of refusals.
fn refused(refusals: &[Refusal]) -> String {
    if refusals.is_empty() {
        return String::new();
    }
    let mut text = "\n| Refused | | Example |\n|---|---|---|\n".to_string();
    for refusal in refusals {
        let (number, words) = (number(refusal.status), status(refusal.status));
        text += &format!("| {number} | {words} | {} |\n", example(refusal));
    }
    text
}

fn status(status: Status) -> String {
    let text = status_text(status);
    text.map_or(String::new(), |text| text.bytes().map(char::from).collect())
}

fn example(refusal: &Refusal) -> String {
    let lines = refusal.lines.iter().filter(|line| !line.is_empty());
    let lines: Vec<_> = lines.map(|line| format!("`{}`", shortened(line))).collect();
    let on = match refusal.on {
        On::Usual => "",
        On::NoSwitches => " (without switches)",
        On::DisabledX => " (with `{xam:0}`)",
        On::IndexAlone => " (with `{spn:1}`)",
        On::SoftLimits => " (with `{sl:1}`)",
    };
    lines.join(", ") + on
}

fn shortened(line: &str) -> String {
    match line.split_at_checked(40) {
        Some((start, _)) => format!("{start}..."),
        None => line.to_string(),
    }
}

/// Returns the table of the settings that the language depends on.
fn settings() -> String {
    let mut text = "\n## Settings\n\n| Setting | | Values |\n|---|---|---|\n".to_string();
    for (name, what, values) in [
        ("gpl", "plane at power-up and after M2", "0 G17, 1 G18, 2 G19"),
        ("gun", "units at power-up and after M2", "0 G20, 1 G21"),
        ("gco", "coordinate system at power-up and after M2", "1 G54 to 9 G59.3"),
        ("gpa", "path mode at power-up and after M2", "0 G61, 1 G61.1, 2 G64"),
        ("gdi", "distance mode at power-up and after M2", "0 G90, 1 G91"),
        ("bd", "block delete", "0 off, 1 on"),
        ("ost", "M1 stops", "0 no, 1 yes"),
        ("psw", "M0, M1, M6, M60 and G88 wait for `~`", "0 no, 1 yes"),
        ("sl", "soft limits", "0 off, 1 on"),
    ] {
        text += &format!("| `{name}` | {what} | {values} |\n");
    }
    text
}
