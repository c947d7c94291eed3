//! Checks that everything that the documents name in `code` exists.
//!
//! A code span with a slash, or with the ending of a file, is a path from the repository's root or from `src`. A span
//! that reads like a name of Rust (`Name::method`, `field.other`) must consist of words of the sources. Two
//! neighbouring words must stand in one file, or be a module and a word in its file. Any other span, such as G-code
//! or a command, is not checked, nor are fenced blocks.
//!
//! The last column of a table that is named `test` must name a transcript or a test in each row.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use crate::process::root;
use crate::sources::files;

/// The documents.
const DOCUMENTS: [&str; 7] = [
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "README.md",
    "CHANGELOG.md",
    "avr-embassy/README.md",
    "boards/README.md",
    "machines/README.md",
];
/// Where the sources are.
const SOURCES: [&str; 9] =
    ["avr-embassy", "src", "boards", "machines", "tests", "xtask", "Cargo.toml", ".cargo", ".ci"];

/// The page with tables that name in each row what shows it, and how many tables it has at least.
const DIFFERENCES: (&str, usize) = ("docs/protocol.md", 3);

/// A file of the sources: the words of its path, and the words of its text.
struct Source {
    modules: HashSet<String>,
    words: HashSet<String>,
}

fn sources() -> Vec<Source> {
    let is_read =
        |file: &PathBuf| !file.ends_with("Cargo.lock") && !file.ends_with("xtask/src/docs.rs");
    let files = SOURCES.iter().flat_map(|name| files(name)).filter(is_read);
    files.filter_map(|file| read(&file)).collect()
}

fn read(file: &Path) -> Option<Source> {
    let text = std::fs::read_to_string(file).ok()?;
    let path = file.strip_prefix(root()).ok()?.with_extension("");
    Some(Source { modules: words(&path.to_string_lossy()), words: words(&text) })
}

fn words(text: &str) -> HashSet<String> {
    let parts = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    parts.filter(|part| !part.is_empty()).map(str::to_owned).collect()
}

/// The code spans outside fenced blocks, with their lines.
fn spans(text: &str) -> Vec<(usize, &str)> {
    let mut fenced = false;
    let mut spans = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if !fenced {
            spans.extend(line.split('`').skip(1).step_by(2).map(|span| (number, span)));
        }
    }
    spans
}

/// The targets of links to files, with their lines.
fn links(text: &str) -> Vec<(usize, &str)> {
    let lines = (1..).zip(text.lines());
    let targets = lines.flat_map(|(number, line)| {
        let rest = line.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        rest.map(move |target| (number, target))
    });
    targets.filter(|(_, target)| !target.contains("://") && !target.starts_with('#')).collect()
}

/// Whether a link leads to an existing file, and to an existing heading if the link has a `#`.
fn leads_somewhere(folder: &Path, target: &str) -> bool {
    let Some((file, heading)) = target.split_once('#') else { return folder.join(target).exists() };
    let text = std::fs::read_to_string(folder.join(file)).unwrap_or_default();
    let is_kept = |c: &char| c.is_alphanumeric() || " -_".contains(*c);
    let name = |line: &str| -> String {
        line.trim_start_matches('#').trim().to_lowercase().chars().filter(is_kept).collect()
    };
    text.lines().any(|line| line.starts_with('#') && name(line).replace(' ', "-") == heading)
}

fn is_path(span: &str) -> bool {
    const ENDINGS: [&str; 4] = [".rs", ".md", ".toml", ".gcode"];
    let is_one = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
    span.chars().all(is_one)
        && !span.starts_with('/')
        && (span.trim_end_matches('/').contains('/') || ENDINGS.iter().any(|e| span.ends_with(e)))
}

/// Returns the parts of a name of Rust; `None` if the span is no such name.
fn parts(span: &str) -> Option<Vec<&str>> {
    let name = span.strip_suffix("()").or(span.strip_suffix('!')).unwrap_or(span);
    let parts: Vec<_> = name.split("::").flat_map(|part| part.split('.')).collect();
    let is_word = |part: &&str| {
        part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && part.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
    };
    parts.iter().all(is_word).then_some(parts)
}

fn exists(span: &str, sources: &[Source]) -> bool {
    if is_path(span) {
        return [root().join(span), root().join("src").join(span)].iter().any(|path| path.exists());
    }
    let Some(parts) = parts(span) else { return true };
    let together = |pair: &[&str]| {
        sources.iter().any(|source| {
            let knows = |word: &str| source.words.contains(word) || source.modules.contains(word);
            knows(pair[0]) && source.words.contains(pair[1])
                || knows(pair[0]) && source.modules.contains(pair[1])
        })
    };
    let known = sources.iter().any(|s| s.words.contains(parts[0]) || s.modules.contains(parts[0]));
    known && parts.windows(2).all(together)
}

#[test]
fn what_the_documents_name_exists() {
    let sources = sources();
    let mut wrong = Vec::new();
    for document in DOCUMENTS {
        let text = std::fs::read_to_string(root().join(document)).expect(document);
        let folder = root().join(document).parent().expect("a folder").to_owned();
        let spans = spans(&text).into_iter().filter(|(_, span)| !exists(span, &sources));
        wrong.extend(spans.map(|(line, span)| format!("{document}:{line}: `{span}`")));
        let links =
            links(&text).into_iter().filter(|(_, target)| !leads_somewhere(&folder, target));
        wrong.extend(links.map(|(line, target)| format!("{document}:{line}: link to {target}")));
    }
    assert!(wrong.is_empty(), "named in a document but not there:\n{}", wrong.join("\n"));
}

/// Returns the rows of each table whose last column is named `test`: the number of the line, and the last cell.
fn rows_with_tests(text: &str) -> Vec<Vec<(usize, &str)>> {
    let cell = |line: &'_ str| -> Option<(usize, usize)> {
        let line = line.strip_suffix('|')?;
        Some((line.rfind('|')? + 1, line.len()))
    };
    let mut tables: Vec<Vec<(usize, &str)>> = Vec::new();
    let mut within = false;
    for (number, line) in (1..).zip(text.lines()) {
        let last = cell(line).and_then(|(from, to)| line.get(from..to)).map(str::trim);
        match last {
            Some("test") => {
                within = true;
                tables.push(Vec::new());
            }
            Some(last) if within && !last.starts_with("---") => {
                tables.last_mut().expect("a table").push((number, last));
            }
            Some(_) => {}
            None => within = false,
        }
    }
    tables
}

/// The names of all functions in these files that are tests.
fn tests(files: &[PathBuf]) -> HashSet<String> {
    let mut names = HashSet::new();
    for file in files.iter().filter(|file| file.extension().is_some_and(|e| e == "rs")) {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        let mut marked = false;
        for line in text.lines().map(str::trim) {
            if line == "#[test]" {
                marked = true;
            } else if let Some(rest) = line.strip_prefix("fn ") {
                if std::mem::take(&mut marked) {
                    names.extend(rest.split(['(', '<']).next().map(str::to_owned));
                }
            } else if !line.starts_with(['#', '/']) {
                marked = false;
            }
        }
    }
    names
}

/// Whether a cell names at least one transcript or test, and nothing else.
fn names_tests(cell: &str, tests: &HashSet<String>) -> bool {
    let is_there = |name: &str| match name.ends_with(".txt") {
        true => root().join("tests/transcripts").join(name).is_file(),
        false => tests.contains(name),
    };
    let mut parts = cell.split('`');
    let between = parts.clone().step_by(2).all(|text| text.trim_matches([' ', ',']).is_empty());
    parts.next();
    let names: Vec<&str> = parts.step_by(2).collect();
    between && !names.is_empty() && names.into_iter().all(is_there)
}

#[test]
fn each_difference_names_its_test() {
    let (page, least) = DIFFERENCES;
    let files = files("tests");
    let tests = tests(&files);
    let text = std::fs::read_to_string(root().join(page)).expect(page);
    let tables = rows_with_tests(&text);
    assert!(tables.len() >= least && tables.iter().all(|rows| !rows.is_empty()), "{page}");
    let wrong = tables.iter().flatten().filter(|(_, cell)| !names_tests(cell, &tests));
    let wrong: Vec<_> = wrong.map(|(line, cell)| format!("{page}:{line}: {cell}")).collect();
    assert!(wrong.is_empty(), "no transcript or test:\n{}", wrong.join("\n"));
    for cell in ["", "-", "`no-such.txt`", "`no_such_test`", "grbl.txt", "`grbl.txt` and more"] {
        assert!(!names_tests(cell, &tests), "{cell}");
    }
}

#[test]
fn the_tour_stays_short() {
    for (document, most) in [("ARCHITECTURE.md", 320), ("README.md", 120)] {
        let lines = std::fs::read_to_string(root().join(document)).expect(document).lines().count();
        assert!(lines <= most, "{document} has {lines} lines, more than {most}");
    }
}

#[test]
fn wrong_names_are_noticed() {
    let sources = sources();
    for span in ["Prep::segment", "exec::pend", "motion/prep.rs", "src/motion", "links.commands"] {
        assert!(exists(span, &sources), "{span}");
    }
    for span in ["Prep::no_such_thing", "NoSuchThing", "motion/no_such.rs", "src/nowhere/x"] {
        assert!(!exists(span, &sources), "{span}");
    }
    for span in ["G1 X10", "{xvm:1200}", "cargo xtask size", "^x", "--board"] {
        assert!(exists(span, &sources), "{span}");
    }
    assert_eq!(spans("a `b` c `d e`\n```\n`f`\n```\n`g`"), [(1, "b"), (1, "d e"), (5, "g")]);
    assert_eq!(links("[a](b.md) [c](https://d/e)\n[f](#g)"), [(1, "b.md")]);
}
