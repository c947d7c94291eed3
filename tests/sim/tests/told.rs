//! Reports tell what the machine does, not what it has read, with the image on the simulated chip
//! (`tests/support/told.rs`).

use kerf::boards::MEGA2560_GRBL;

use crate::common::firmware;
use crate::told_session::{Told, Tongue};

fn play(tongue: Tongue, stops: bool) {
    let mut told = Told::new(firmware(&MEGA2560_GRBL), tongue, 3);
    for stops in [stops, false] {
        told.run(8, stops).unwrap_or_else(|why| panic!("{why}\n{}", told.story()));
    }
    assert!(told.compared >= 20, "{} reports", told.compared);
}

#[test]
fn reports_of_tinyg_tell_what_runs() {
    play(Tongue::TinyG, true);
}

#[test]
fn reports_of_grbl_tell_what_runs() {
    play(Tongue::Grbl, false);
}
