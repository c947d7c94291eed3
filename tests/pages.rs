//! The conversations that the pages in `docs` show, played to the firmware on the host: each page from power-up, in its order.
//!
//! In a block of text a line with `> ` is sent; any other has to be heard next, but for one that is `...`: anything may come
//! before the next. `^d` is that character. Blocks of `console` are not played. `<!-- play: EVENT -->` is an event of a transcript that readers do not see.

#[path = "support/host.rs"]
mod host;
#[path = "support/side.rs"]
mod side;
#[path = "support/transcript.rs"]
mod transcript;

use std::fs;

use kerf::hal::imp::Machine;
use transcript::Transcript;

/// The pages that show conversations.
const PAGES: [&str; 6] = ["first-machine", "alarms", "from-grbl", "senders", "cam", "backup"];

/// What is heard first, which pages need not show.
const GREETING: &str = "<~ {\"r\":{\"fv\":*\"SYSTEM READY\"},\"f\":[1,0,0]}\n";

/// A page as a transcript.
fn transcript(name: &str) -> Transcript {
    let page = fs::read_to_string(format!("docs/{name}.md")).expect(name);
    let mut text = String::from(GREETING);
    let mut is_block = false;
    for line in page.lines() {
        if line.starts_with("```") {
            is_block = !is_block && line == "```text";
        } else if let Some(event) = line.strip_prefix("<!-- play: ") {
            text += event.strip_suffix(" -->").unwrap_or_else(|| panic!("{name}: {line}"));
        } else if let Some(sent) = line.strip_prefix("> ").filter(|_| is_block) {
            text += &format!("-> {}", sent.replace("^d", "\\x04"));
        } else if is_block && line != "..." {
            text += &format!("<- {line}");
        }
        // Lines of a transcript have the numbers of the page's.
        text += "\n";
    }
    transcript::read_text(name.to_string(), &text)
}

#[test]
fn the_machine_does_what_the_pages_show() {
    let boot = || Machine::boot(115_200).expect("one machine for each thread");
    let pages = PAGES.into_iter().map(transcript).collect();
    transcript::play_all(pages, PAGES.len(), boot);
}
