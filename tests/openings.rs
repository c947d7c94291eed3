//! How senders that cannot run here open a conversation, with the firmware on the host. The openings are in
//! `tests/support/openings.rs`; `tests/sim/tests/openings.rs` plays them with the image.

#[path = "support/openings.rs"]
mod by_sender;

use std::thread;

use kerf::hal::imp::{Machine, eeprom};

#[test]
fn every_sender_finds_its_own() {
    by_sender::all(boot);
}

#[test]
fn every_sender_finds_its_own_on_a_slow_line() {
    by_sender::all_late(200, |_| boot(0));
}

#[test]
fn the_greeting_loses_no_sender() {
    by_sender::greeting(Machine::boot(115_200).expect("one machine for each thread"));
}

#[test]
fn senders_of_tinyg_find_theirs() {
    by_sender::of_tinyg(|| Machine::boot(115_200).expect("one machine for each thread"));
}

#[test]
fn noise_costs_its_line_alone() {
    let one = |seed| {
        let play = move || {
            let boot = || Machine::boot(115_200).expect("one machine for each thread");
            by_sender::noise(boot, seed..seed + 1);
        };
        thread::spawn(play).join().is_err()
    };
    let failed: Vec<u64> = (0..300).filter(|seed| one(*seed)).collect();
    assert!(failed.is_empty(), "{failed:?}");
}

/// A machine that begins with this value of `dia` and, unlike a printer, without its fourth axis. Another machine, in a
/// thread of its own, has stored the values.
fn boot(dia: u8) -> Machine {
    let set = move || {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        machine.run_ms(100);
        machine.send(format!("{{aam:0}}\n{{dia:{dia}}}\n").as_bytes());
        machine.run_ms(500);
        eeprom::contents()
    };
    eeprom::put(&thread::spawn(set).join().unwrap());
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    machine.run_ms(100);
    machine
}
