//! The conversations that the pages in `docs` show, played to the firmware on the host.

#[path = "support/host.rs"]
mod host;
#[path = "support/pages.rs"]
mod pages;
#[path = "support/side.rs"]
mod side;
#[path = "support/transcript.rs"]
#[allow(dead_code)]
mod transcript;

use std::path::Path;

use kerf::hal::imp::Machine;

#[test]
fn the_machine_does_what_the_pages_show() {
    let boot = || Machine::boot(115_200).expect("one machine for each thread");
    transcript::play_all(pages::read_all(Path::new("docs")), 16, boot);
}
