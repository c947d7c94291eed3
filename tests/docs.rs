//! The documents that are made from tables are as the tables are.

use std::fs;
use std::path::PathBuf;

use kerf::config::docs as settings;
use kerf::gcode::codes::docs as gcode;

/// The documents, and what they should be.
fn documents() -> [(&'static str, String); 2] {
    [("gcode.md", gcode::markdown()), ("settings.md", settings::markdown())]
}

fn file(name: &str) -> PathBuf {
    ["docs", name].iter().collect()
}

#[test]
fn the_documents_are_up_to_date() {
    for (name, text) in documents() {
        let found = fs::read_to_string(file(name)).unwrap_or_default();
        assert!(found == text, "docs/{name} is not: `cargo xtask docs` writes it anew");
    }
}

/// What `cargo xtask docs` runs.
#[test]
#[ignore = "writes the documents"]
fn write() {
    for (name, text) in documents() {
        fs::write(file(name), text).expect("docs can be written");
    }
}
