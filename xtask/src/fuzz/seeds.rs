//! The first inputs of the fuzzers: G-code and transcripts of the repository, in pieces.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

use super::{Target, make};
use crate::process::root;

/// Folders with G-code and transcripts, and the endings of their files. Not all of them need exist.
const SOURCES: [(&str, &str); 3] =
    [("examples", "gcode"), ("tests/nist", "ngc"), ("tests/transcripts", "txt")];
/// Beginning of the lines in a transcript that are sent.
const SENT: &str = "-> ";
/// Most pieces of a file, because a long file repeats itself.
const PIECES: usize = 8;

/// Writes the seeds of a target, replacing the former ones.
pub fn write(target: Target) -> Result<()> {
    let folder = target.folder("seeds");
    let _ = fs::remove_dir_all(&folder);
    make(&folder)?;
    for (source, ending) in SOURCES {
        for (name, text) in texts(&root().join(source), ending) {
            for (n, piece) in pieces(&lines(&text), target.longest() - 1).enumerate() {
                for (how, prefix) in target.prefixes().iter().enumerate() {
                    let file = folder.join(format!("{name}-{n}-{how}"));
                    let written = fs::write(&file, [prefix.as_bytes(), &piece[..]].concat());
                    written.with_context(|| format!("cannot write {}", file.display()))?;
                }
            }
        }
    }
    Ok(())
}

/// Returns the names and texts of the files in a folder.
fn texts(folder: &Path, ending: &str) -> Vec<(String, String)> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let files = entries.map(|entry| entry.path());
    let files = files.filter(|file| file.extension().is_some_and(|e| e == ending));
    let text = |file: std::path::PathBuf| {
        let name = file.file_stem()?.to_string_lossy().into_owned();
        Some((name, fs::read_to_string(&file).ok()?))
    };
    files.filter_map(text).collect()
}

/// Returns the lines that are sent, each with its end.
fn lines(text: &str) -> Vec<Vec<u8>> {
    let is_transcript = text.lines().any(|line| line.starts_with(SENT));
    let sent = text.lines().filter_map(|line| match line.strip_prefix(SENT) {
        Some(line) => unescape(line),
        None => (!is_transcript).then(|| line.as_bytes().to_vec()),
    });
    sent.map(|line| [&line[..], b"\n"].concat()).collect()
}

/// Replaces escapes by bytes: `\x05` is the byte 5. `None` if an escape is malformed.
fn unescape(line: &str) -> Option<Vec<u8>> {
    let mut parts = line.split("\\x");
    let mut bytes = parts.next()?.as_bytes().to_vec();
    for part in parts {
        bytes.push(u8::from_str_radix(part.get(..2)?, 16).ok()?);
        bytes.extend(&part.as_bytes()[2..]);
    }
    Some(bytes)
}

/// Returns the first pieces of a text, made of whole lines.
fn pieces(lines: &[Vec<u8>], longest: usize) -> impl Iterator<Item = Vec<u8>> {
    let mut pieces = vec![Vec::new()];
    for line in lines {
        if pieces.last().is_some_and(|piece| piece.len() + line.len() > longest) {
            pieces.push(Vec::new());
        }
        pieces.last_mut().expect("one at least").extend(line);
    }
    pieces.into_iter().filter(|piece| !piece.is_empty()).take(PIECES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_transcript_only_what_is_sent_is_a_seed() {
        let text = "# why\n<- {\"r\":{}}\n-> g0\\x05 x1\n@ +50ms\n-> \n";
        assert_eq!(lines(text), [&b"g0\x05 x1\n"[..], b"\n"]);
        assert_eq!(lines("g0\n(\\x05)\n"), [&b"g0\n"[..], b"(\\x05)\n"]);
    }

    #[test]
    fn pieces_are_of_whole_lines() {
        let lines = lines("g0 x1\ng0 x2\ng0 x3\n");
        let pieces: Vec<_> = pieces(&lines, 12).collect();
        assert_eq!(pieces, [&b"g0 x1\ng0 x2\n"[..], b"g0 x3\n"]);
    }
}
