//! The transcripts, played to the firmware's image on the simulated chip.

use std::path::Path;

use kerf::boards::{MEGA2560_GRBL, MEGA2560_GRBL_LATHE, MEGA2560_LATHE, RAMPS14, RAMPS14_CNC};

use crate::common::firmware;
use crate::common::share::share_of;
use crate::{pages, transcript};

/// Transcripts that only the image of a lathe can play.
const TURNING: [&str; 3] = ["encoder.", "thread", "lathe-"];
/// Transcripts that only the image of a printer can play.
const PRINTING: [&str; 2] = ["bed", "reprap"];
/// Transcripts with canned cycles, which the image for the grbl-style shield has no room for.
const DRILLING: [&str; 10] = [
    "check-mode",
    "cycles-",
    "feed-modes",
    "grbl-more",
    "groups",
    "machine-coordinates",
    "planes",
    "program-end",
    "steps",
    "words",
];
/// Transcripts that only emulated boards can play. No image for this chip has a card in TinyG's dialect, drivers with UART, built-in jobs, help
/// screens, input shaping, canned cycles and a second port, cycles that act on the spindle in TinyG's dialect, or both printing hosts and
/// a second port or TinyG's dialect.
pub const ELSEWHERE: [&str; 22] = [
    "actions",
    "card",
    "corexy",
    "cycles-back-bore",
    "cycles-bore",
    "cycles-by-hand",
    "cycles-refused-bore",
    "cycles-refused-stop",
    "cycles-refused-tap",
    "drivers",
    "heat",
    "job",
    "program.",
    "program-over",
    "reprap-ports",
    "reprap-shaping",
    "shaping",
    "text-grbl",
    "text-help",
    "text-in-json",
    "text-setting-joined",
    "verbosity",
];
/// Transcripts that also need grbl's dialect.
const BOTH: [&str; 2] = ["grbl-thread", "grbl-lathe"];

#[test]
fn the_image_keeps_to_the_transcripts() {
    let mut all = transcript::read_all(Path::new("../../transcripts"));
    all.retain(|one| !ELSEWHERE.iter().any(|name| one.name.starts_with(name)));
    let begins = |names: &[&str], one: &transcript::Transcript| {
        names.iter().any(|name| one.name.starts_with(name))
    };
    let both: Vec<_> = all.iter().filter(|one| one.is_grbl_alone()).cloned().collect();
    let (turning, others): (Vec<_>, Vec<_>) =
        all.into_iter().filter(|one| !begins(&BOTH, one)).partition(|one| begins(&TURNING, one));
    let (printing, others): (Vec<_>, Vec<_>) =
        others.into_iter().partition(|one| begins(&PRINTING, one));
    transcript::play_all(printing, 2, || firmware(&RAMPS14));
    let (drilling, others): (Vec<_>, Vec<_>) =
        others.into_iter().partition(|one| begins(&DRILLING, one));
    transcript::play_all(drilling, 2, || firmware(&RAMPS14_CNC));
    transcript::play_all(others, 2, || firmware(&MEGA2560_GRBL));
    transcript::play_all(turning, 2, || firmware(&MEGA2560_LATHE));
    transcript::play_all(both, 2, || firmware(&MEGA2560_GRBL_LATHE));
}

#[test]
fn the_image_does_what_the_pages_show() {
    let pages = pages::read_all(Path::new("../../../docs"));
    let pages = share_of(&pages, 2).cloned().collect();
    transcript::play_all(pages, 2, || firmware(&MEGA2560_GRBL));
}
