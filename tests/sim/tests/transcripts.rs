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
use kerf::boards::{MEGA2560_GRBL, MEGA2560_LATHE};

/// What only the image of a lathe can do.
const TURNING: [&str; 3] = ["encoder.", "thread", "lathe-"];
/// What needs grbl's dialect besides: today only the host has both.
const BOTH: &str = "grbl-thread";

#[test]
fn the_image_keeps_to_the_transcripts() {
    let all = transcript::read_all(Path::new("../transcripts"));
    let is_built = |one: &transcript::Transcript| {
        let both = MEGA2560_GRBL.features.contains(&"lathe");
        both || !one.name.starts_with(BOTH)
    };
    let (turning, others) = all
        .into_iter()
        .filter(is_built)
        .partition(|one| TURNING.iter().any(|name| one.name.starts_with(name)));
    transcript::play_all(others, 2, || firmware(&MEGA2560_GRBL));
    transcript::play_all(turning, 2, || firmware(&MEGA2560_LATHE));
}

#[test]
fn the_image_does_what_the_pages_show() {
    let pages = pages::read_all(Path::new("../../docs"));
    transcript::play_all(pages, 2, || firmware(&MEGA2560_GRBL));
}
