//! How senders that cannot run here open a conversation, with the image on the simulated chip: the openings of
//! `tests/openings.rs`.

#[path = "../../support/openings.rs"]
mod by_sender;

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::Machine;

use crate::common::firmware;
use crate::side::Side;

#[test]
fn every_sender_finds_its_own() {
    by_sender::all(boot);
}

/// A machine that begins with this value of `dia`: it has stored the value and restarted.
fn boot(dia: u8) -> Machine {
    let mut machine = firmware(&MEGA2560_GRBL);
    machine.run_ms(1_500);
    if dia != 0 {
        Side::send(&mut machine, format!("{{dia:{dia}}}\n").as_bytes());
        machine.run_ms(500);
        Side::send(&mut machine, b"\x18");
        machine.run_ms(1_500);
        // Output from before the restart.
        let heard = String::from_utf8_lossy(&machine.heard()).into_owned();
        assert!(heard.contains("Grbl"), "{heard}");
    }
    machine
}
