//! Checks that only the table of dialects in the firmware knows a dialect by name.
//!
//! Tools for the host may know dialects: they print the numbers and texts of TinyG.

use crate::process::root;
use crate::sources::files;

/// Paths where a dialect may be named: its own folder, the table, and tools.
const KNOWN: [&str; 7] = [
    "src/protocol/grbl/",
    "src/protocol/reprap/",
    "src/protocol/tinyg/",
    "src/protocol/dialect.rs",
    "src/protocol/mod.rs",
    "src/canon/",
    "src/gcode/codes/docs/",
];

/// Returns the lines of a file that name a dialect.
fn naming<'a>(text: &'a str, dialects: &[String]) -> Vec<&'a str> {
    let names = |line: &&str| {
        // The name must not be the end of a longer word.
        let is_word = |at: usize| {
            at == 0
                || !line.as_bytes()[at - 1].is_ascii_alphanumeric()
                    && line.as_bytes()[at - 1] != b'_'
        };
        dialects.iter().any(|name| {
            [format!("{name}::"), format!("::{name}")].iter().any(|path| {
                line.match_indices(path.as_str())
                    .any(|(at, _)| path.starts_with(':') || is_word(at))
            })
        })
    };
    text.lines().filter(names).collect()
}

/// Returns the names of the dialects: the folders beside the interface.
fn dialects() -> Vec<String> {
    let entries = std::fs::read_dir(root().join("src/protocol")).expect("the interface");
    let folders = entries.flatten().filter(|entry| entry.path().is_dir());
    folders.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}

#[test]
fn dialects_are_known_to_their_table_alone() {
    let dialects = dialects();
    assert!(dialects.contains(&"tinyg".to_owned()));
    let mut wrong = Vec::new();
    for file in files("src") {
        let name = file
            .strip_prefix(root())
            .expect("in the checkout")
            .to_string_lossy()
            .replace('\\', "/");
        if KNOWN.iter().any(|known| name.starts_with(known)) {
            continue;
        }
        let text = std::fs::read_to_string(&file).unwrap_or_default();
        wrong
            .extend(naming(&text, &dialects).iter().map(|line| format!("{name}: {}", line.trim())));
    }
    assert!(wrong.is_empty(), "these name a dialect:\n{}", wrong.join("\n"));
}

#[test]
fn a_dialect_is_named_by_its_path() {
    let dialects = ["tinyg".to_owned()];
    let text = "use crate::protocol::tinyg::Mode;\nuse crate::protocol::Speech;\n// TinyG's\ntinyg::names()";
    assert_eq!(naming(text, &dialects).len(), 2);
    assert!(naming("pub use board_tinyg::BOARD;", &dialects).is_empty());
}
