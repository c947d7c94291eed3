//! The documents that are made from tables are as the tables are.

use std::fs;
use std::path::PathBuf;

use kerf::gcode::codes::docs;

fn file() -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "docs", "gcode.md"].iter().collect()
}

#[test]
fn the_description_of_the_language_is_up_to_date() {
    let text = fs::read_to_string(file()).unwrap_or_default();
    assert!(text == docs::markdown(), "docs/gcode.md is not: `cargo xtask docs` writes it anew");
}

/// What `cargo xtask docs` runs.
#[test]
#[ignore = "writes docs/gcode.md"]
fn write() {
    fs::write(file(), docs::markdown()).expect("docs/gcode.md can be written");
}
