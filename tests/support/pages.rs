//! The conversations that the pages in `docs` show, as transcripts. Each page is played in order, from power-up.
//!
//! In a block of text a line with `> ` is sent. Any other line must be heard next. A line `...` allows any lines
//! before the next one. `^d` is that character. Blocks of `console` are not played. `<!-- play: EVENT -->` is an
//! event of a transcript that readers do not see.

use std::fs;
use std::path::Path;

use crate::transcript::{self, Transcript};

/// The pages that show conversations.
const PAGES: [&str; 6] = ["first-machine", "alarms", "from-grbl", "senders", "cam", "backup"];

/// Returns the pages in a folder.
pub fn read_all(folder: &Path) -> Vec<Transcript> {
    PAGES.into_iter().map(|name| read(folder, name)).collect()
}

/// Returns a page as a transcript.
fn read(folder: &Path, name: &str) -> Transcript {
    let page = fs::read_to_string(folder.join(name).with_extension("md")).expect(name);
    let mut text = String::from("greeting\n");
    let mut is_block = false;
    // The first line of a page is its title.
    for line in page.lines().skip(1) {
        if line.starts_with("```") {
            is_block = !is_block && line == "```text";
        } else if let Some(event) = line.strip_prefix("<!-- play: ") {
            text += event.strip_suffix(" -->").unwrap_or_else(|| panic!("{name}: {line}"));
        } else if let Some(sent) = line.strip_prefix("> ").filter(|_| is_block) {
            text += &format!("-> {}", sent.replace("^d", "\\x04"));
        } else if is_block && line.contains("SYSTEM READY") {
            // Each page begins with the greeting, whether the page shows it or not.
        } else if is_block && line != "..." {
            text += &format!("<- {line}");
        }
        // Each line of the page makes one line of the transcript, so that line numbers agree.
        text += "\n";
    }
    transcript::read_text(name.to_string(), &text)
}
