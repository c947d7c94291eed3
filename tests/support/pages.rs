//! The conversations that the pages in `docs` show, as transcripts: each page from power-up, in its order.
//!
//! In a block of text a line with `> ` is sent; any other has to be heard next, but for one that is `...`: anything may come
//! before the next. `^d` is that character. Blocks of `console` are not played. `<!-- play: EVENT -->` is an event of a transcript that readers do not see.

use std::fs;
use std::path::Path;

use crate::transcript::{self, Transcript};

/// The pages that show conversations.
const PAGES: [&str; 6] = ["first-machine", "alarms", "from-grbl", "senders", "cam", "backup"];

/// The pages in a folder.
pub fn read_all(folder: &Path) -> Vec<Transcript> {
    PAGES.into_iter().map(|name| read(folder, name)).collect()
}

/// A page as a transcript.
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
            // Each page begins with it, whether it shows it or not.
        } else if is_block && line != "..." {
            text += &format!("<- {line}");
        }
        // Lines of a transcript have the numbers of the page's.
        text += "\n";
    }
    transcript::read_text(name.to_string(), &text)
}
