use std::collections::HashSet;
use std::fs;
use std::path::Path;
use std::string::String;
use std::vec::Vec;

use super::*;
use crate::gcode::codes::table::{G, M};
use crate::gcode::setup::Usual;
use crate::protocol::tinyg::status_text;

fn refusals() -> impl Iterator<Item = &'static Refusal> {
    docs().flat_map(|doc| doc.refusals).chain(RULES.iter().flat_map(|rule| rule.refusals))
}

#[test]
fn every_row_has_one_entry_and_every_entry_a_row() {
    let names: Vec<String> = docs().map(Doc::name).collect();
    assert_eq!(
        names.len(),
        names.iter().collect::<HashSet<_>>().len(),
        "one of them is there twice"
    );
    let rows = |letter, rows: &[Code]| {
        rows.iter().map(move |row| (letter, row.number)).collect::<Vec<_>>()
    };
    let rows = [rows('G', &G.get()), rows('M', &M.get())].concat();
    for row in &rows {
        assert!(docs().any(|doc| (doc.letter, doc.number) == *row), "{row:?} has no entry");
    }
    assert_eq!(names.len(), rows.len(), "an entry has no row");
    assert!(docs().all(|doc| doc.row().is_some_and(|row| row.number == doc.number)));
}

#[test]
fn examples_are_refused_as_they_say_and_change_nothing() {
    let mut wrong = Vec::new();
    for refusal in refusals() {
        let (mut interpreter, mut out) = (Fresh::machine(), Commands::default());
        let (last, before) = refusal.lines.split_last().unwrap();
        for line in before {
            interpreter.interpret(line.as_bytes(), &refusal.on, &mut out).expect(line);
        }
        let state = interpreter;
        let refused = interpreter.interpret(last.as_bytes(), &refusal.on, &mut out);
        if refused != Err(refusal.status) {
            wrong.push((refusal.lines, refused));
            continue;
        }
        assert_eq!((interpreter, &out), (state, &Commands::default()), "{:?}", refusal.lines);
        assert_eq!(refusal.on(&refusal.on), Some(refusal.status));
        if refusal.on != On::Usual {
            assert_ne!(refusal.on(&Usual), Some(refusal.status), "{:?}", refusal.lines);
        }
        assert!(status_text(refusal.status).is_some(), "{:?} has no text", refusal.status);
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn examples_are_of_their_code() {
    for doc in docs() {
        for refusal in doc.refusals {
            let name = doc.name();
            let codes = refusal.lines.iter().flat_map(|line| line.split(' '));
            assert!(codes.into_iter().any(|code| code == name), "{name}: {:?}", refusal.lines);
        }
    }
}

/// Returns the statuses that the sources of the language name.
fn named() -> HashSet<String> {
    let folder = Path::new("src/gcode");
    let mut named = HashSet::new();
    for file in fs::read_dir(folder).unwrap() {
        let Ok(text) = fs::read_to_string(file.unwrap().path()) else { continue };
        let code = text.split("#[cfg(test)]").next().unwrap();
        let words = code.split("Status::").skip(1);
        named.extend(words.map(|word| {
            word.chars().take_while(|c| c.is_ascii_alphanumeric()).collect::<String>()
        }));
    }
    named
}

#[test]
fn every_refusal_of_the_language_is_listed() {
    let listed: HashSet<String> =
        refusals().map(|refusal| std::format!("{:?}", refusal.status)).collect();
    let mut named = named();
    // The first three are not refusals, no code needs T, and no capability is missing here (`tests/capabilities.rs`).
    for other in ["Noop", "Again", "InternalError", "TWordMissing", "NotBuiltIn"] {
        named.remove(other);
    }
    let missing: Vec<_> = named.difference(&listed).collect();
    assert!(missing.is_empty(), "{missing:?}");
    assert!(named.len() > 30);
}
