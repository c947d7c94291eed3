//! Reports tell what the machine does, not what it has read: random programs on the host (`tests/support/told.rs`).

use kerf::hal::imp::Machine;

use crate::apart::apart;
use crate::seeds::try_all;
use crate::told_session::{Told, Tongue};

fn play(tongue: Tongue, seed: u64) -> Result<(), String> {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    let mut told = Told::new(machine, tongue, seed);
    // Only in this dialect the lines that a flush drops are known.
    let stops = tongue == Tongue::TinyG && seed % 2 == 1;
    for part in 0..3 {
        told.run(15, stops && part < 2).map_err(|why| format!("{why}\n{}", told.story()))?;
    }
    if told.compared < 50 {
        return Err(format!("only {} reports", told.compared));
    }
    Ok(())
}

fn reports_tell_what_runs(tongue: Tongue) {
    try_all(20, |seed| apart(move || play(tongue, seed)));
}

#[test]
fn of_tinyg_tell_what_runs() {
    reports_tell_what_runs(Tongue::TinyG);
}

#[test]
fn of_grbl_tell_what_runs() {
    reports_tell_what_runs(Tongue::Grbl);
}

#[test]
fn of_printing_hosts_tell_what_runs() {
    reports_tell_what_runs(Tongue::RepRap);
}
