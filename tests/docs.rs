//! Documents that are generated from tables agree with the tables.

use std::collections::HashSet;
use std::fs;
use std::path::PathBuf;

use kerf::config::docs as settings;
use kerf::gcode::codes::docs as gcode;
use kerf::protocol::tinyg::names;

use crate::{codes, schema, tables, wiring};

/// Returns the documents and their expected text.
fn documents() -> Vec<(String, String)> {
    let pages = [
        ("gcode.md", gcode::markdown()),
        ("settings.md", tables::shorten(&settings::markdown())),
        ("codes.md", codes::markdown()),
        ("wiring.md", wiring::markdown()),
        ("settings.schema.json", schema::json()),
    ];
    let pages = pages.into_iter().map(|(name, text)| (name.to_string(), text));
    let drawings = wiring::drawn().map(|b| (format!("wiring-{}.svg", b.name), wiring::svg(b)));
    pages.chain(drawings).collect()
}

fn file(name: &str) -> PathBuf {
    ["docs", name].iter().collect()
}

#[test]
fn the_documents_are_up_to_date() {
    for (name, text) in documents() {
        let found = fs::read_to_string(file(&name)).unwrap_or_default();
        assert!(found == text, "docs/{name} is not: `cargo xtask docs` writes it anew");
    }
}

/// Writes the documents; `cargo xtask docs` runs this.
#[test]
#[ignore = "writes the documents"]
fn write() {
    for (name, text) in documents() {
        fs::write(file(&name), text).expect("docs can be written");
    }
}

#[test]
fn every_name_is_told_somewhere() {
    let untold = codes::untold();
    assert!(untold.is_empty(), "in no document: {}", untold.join(" "));
}

/// Returns the documents for users of a machine.
fn pages() -> Vec<PathBuf> {
    let docs = fs::read_dir("docs").expect("docs").map(|entry| entry.expect("an entry").path());
    let docs = docs.filter(|path| path.extension().is_some_and(|e| e == "md"));
    let others = ["README.md", "boards/README.md", "machines/README.md", "CONTRIBUTING.md"];
    docs.chain(others.map(PathBuf::from)).collect()
}

#[test]
fn no_cell_of_a_table_is_long() {
    let mut long = Vec::new();
    for path in pages() {
        let text = fs::read_to_string(&path).expect("a page");
        for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| line.starts_with('|')) {
            let longest = line.split('|').map(|cell| cell.trim().chars().count()).max();
            if longest.is_some_and(|longest| longest > tables::CELL) {
                long.push(format!("{}:{number}: {}", path.display(), longest.unwrap_or(0)));
            }
        }
    }
    assert!(long.is_empty(), "longer than {} characters:\n{}", tables::CELL, long.join("\n"));
}

#[test]
fn every_page_is_linked_from_the_readme() {
    let readme = fs::read_to_string("README.md").expect("README.md");
    let is_linked = |path: &PathBuf| readme.contains(&format!("({})", path.display()));
    let missing: Vec<_> = pages().into_iter().filter(|p| p.starts_with("docs")).collect();
    let missing: Vec<_> = missing.iter().filter(|path| !is_linked(path)).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// Files that pages name exist: sources by their path, transcripts by their name.
#[test]
fn what_the_pages_name_exists() {
    let mut missing = Vec::new();
    for path in pages() {
        let text = fs::read_to_string(&path).expect("a page");
        for span in text.lines().flat_map(|line| line.split('`').skip(1).step_by(2)) {
            let is_source =
                span.contains('/') && span.ends_with(".rs") && !span.contains(['*', ' ']);
            let is_transcript = span.ends_with(".txt") && span.len() > 4 && !span.contains(' ');
            let target = match (is_source, is_transcript) {
                (true, _) => PathBuf::from(span),
                (_, true) => ["tests/transcripts", span].iter().collect(),
                _ => continue,
            };
            if !target.exists() && !span.contains("NAME") {
                missing.push(format!("{}: {span}", path.display()));
            }
        }
        let folder = path.parent().expect("a folder");
        for link in text.split("](").skip(1).filter_map(|rest| rest.split([')', '#']).next()) {
            if !link.is_empty() && !link.contains("://") && !folder.join(link).exists() {
                missing.push(format!("{}: link to {link}", path.display()));
            }
        }
    }
    assert!(missing.is_empty(), "not there:\n{}", missing.join("\n"));
}

/// No page has a sentence that is known to be outdated.
#[test]
fn no_page_tells_what_is_no_longer_so() {
    let gone = [
        "forgotten when the power goes",
        "until a reset.",
        "no PWM",
        "PWM no effect",
        "no effect yet",
    ];
    for path in pages() {
        let text = fs::read_to_string(&path).expect("a page");
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        for sentence in gone {
            assert!(!text.contains(sentence), "{}: {sentence}", path.display());
        }
    }
}

/// Names in pages that belong to no setting or value: groups, requests, keys of answers, words of G-code, signals,
/// commands.
const OTHER: [&str; 35] = [
    "p1", "sq", "sys", "sr", "srs", "ax", "err", "ok", "xmin", "xmax", "ymin", "ymax", "zmin",
    "zmax", "amin", "amax", "g10", "z0", "z12", "dir1", "step1", "steps", "load", "save", "grbl",
    "jobs", "help", "er", "st", "msg", "sw", "lathe", "sd", "dr", "text",
];
/// Pages that are generated from tables as a whole.
const MADE: [&str; 2] = ["docs/gcode.md", "docs/settings.md"];

/// Pages name settings and values by names that the machine knows: whole names, or names without axis, motor or
/// group. Motors 5 and 6, which only some boards have, have the settings of motor 1.
#[test]
fn names_in_pages_are_known() {
    let known: HashSet<String> = names().into_iter().collect();
    let prefixes = ["", "x", "a", "1", "p1", "sp", "co", "sq", "pos", "in", "g54"];
    let is_known = |span: &str| {
        let of_motor_1 = span.strip_prefix(['5', '6']).map(|name| format!("1{name}"));
        of_motor_1.is_some_and(|name| known.contains(&name))
            || prefixes.iter().any(|prefix| known.contains(&format!("{prefix}{span}")))
            || known.iter().any(|name| name[..name.len() - 1] == *span)
            || kerf::boards::by_name(span).is_some()
            || OTHER.contains(&span)
    };
    let is_name = |span: &&str| {
        (2..=5).contains(&span.len())
            && span.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_')
            && span.bytes().any(|b| b.is_ascii_lowercase())
    };
    let mut unknown = Vec::new();
    let pages = pages().into_iter().filter(|path| path.starts_with("docs"));
    for path in pages.filter(|path| MADE.iter().all(|made| !path.ends_with(made))) {
        let text = fs::read_to_string(&path).expect("a page");
        let lines = text.lines().filter(|line| !line.starts_with("```"));
        let spans = lines.flat_map(|line| line.split('`').skip(1).step_by(2));
        let wrong = spans.filter(is_name).filter(|span| !is_known(span));
        unknown.extend(wrong.map(|span| format!("{}: {span}", path.display())));
    }
    unknown.sort();
    unknown.dedup();
    assert!(unknown.is_empty(), "unknown names:\n{}", unknown.join("\n"));
}
