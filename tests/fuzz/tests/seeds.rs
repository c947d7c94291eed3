//! Runs the checks of the fuzzers once with the examples and the transcripts.

use std::fs;
use std::path::Path;

/// Returns the texts of the files in a folder of the repository.
fn texts(folder: &str) -> Vec<String> {
    let folder = Path::new("../..").join(folder);
    let files = fs::read_dir(&folder).expect("a folder of seeds").flatten();
    let texts: Vec<_> = files.filter_map(|file| fs::read_to_string(file.path()).ok()).collect();
    assert!(!texts.is_empty(), "nothing in {}", folder.display());
    texts
}

/// Returns the lines that a transcript sends.
fn sent(transcript: &str) -> String {
    let lines = transcript.lines().filter_map(|line| line.strip_prefix("-> "));
    lines.flat_map(|line| [line, "\n"]).collect()
}

#[test]
fn examples_are_lines() {
    for text in texts("examples") {
        kerf_fuzz::lines::check(text.as_bytes());
    }
}

#[test]
fn transcripts_are_held_at_any_pace() {
    for transcript in texts("tests/transcripts") {
        for how in ["0", "1"] {
            kerf_fuzz::serial::check((how.to_owned() + &sent(&transcript)).as_bytes());
        }
    }
}

#[test]
fn examples_are_sent_at_any_pace() {
    for text in texts("examples") {
        for how in ["0", "1"] {
            kerf_fuzz::serial::check((how.to_owned() + &text).as_bytes());
        }
    }
}
