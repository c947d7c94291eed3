//! The transcripts, played to the firmware's image on the simulated chip.

mod common;
#[path = "../../support/pages.rs"]
mod pages;
#[path = "../../support/side.rs"]
mod side;
#[path = "common/simulated.rs"]
mod simulated;
#[path = "../../support/transcript.rs"]
mod transcript;

use std::path::Path;

use common::firmware;
use kerf::boards::MEGA2560_GRBL;

#[test]
fn the_image_keeps_to_the_transcripts() {
    let folder = Path::new("../transcripts");
    transcript::play_all(transcript::read_all(folder), 2, || firmware(&MEGA2560_GRBL));
}

#[test]
fn the_image_does_what_the_pages_show() {
    let pages = pages::read_all(Path::new("../../docs"));
    transcript::play_all(pages, 2, || firmware(&MEGA2560_GRBL));
}
