//! How senders that cannot run here open a conversation, with the image on the simulated chip: the openings of
//! `tests/openings.rs`.

#[path = "../../support/openings.rs"]
mod by_sender;

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::{Loader, Machine};

use crate::common::{firmware, image};
use crate::side::Side;

#[test]
fn every_sender_finds_its_own() {
    by_sender::all(boot);
}

/// The port is opened, which resets the board, and what its sender says first comes while the boot loader waits for a
/// command: it is lost, and delays the firmware by seconds. Half of the senders open the port twice. Then the sender
/// begins anew, and each byte takes 200 ms.
#[test]
fn every_sender_finds_its_own_behind_the_boot_loader() {
    let elf = image(&MEGA2560_GRBL);
    let loader = Loader::of_debian().unwrap();
    by_sender::all_late(200, |first| {
        let mut machine = Machine::load(&elf, &MEGA2560_GRBL).unwrap();
        machine.install(&loader);
        machine.run_ms(40 * (first.len() as u64 % 24));
        if first.len() % 2 == 0 {
            machine.reset();
            machine.run_ms(300);
        }
        Side::send(&mut machine, first);
        let mut heard = String::new();
        for _ in 0..100 {
            machine.run_ms(100);
            heard += &String::from_utf8_lossy(&machine.heard());
            if heard.contains("for help]") {
                return machine;
            }
        }
        panic!("no greeting, but {heard:?}");
    });
}

#[test]
fn the_greeting_loses_no_sender() {
    by_sender::greeting(firmware(&MEGA2560_GRBL));
}

#[test]
fn senders_of_tinyg_find_theirs() {
    by_sender::of_tinyg(|| boot(0));
}

#[test]
fn noise_costs_its_line_alone() {
    by_sender::noise(|| boot(0), 0..8);
}

/// A sender tries a rate that is not the port's, and then the right one.
#[test]
fn a_wrong_rate_at_first_costs_a_line() {
    for rate in [9_600, 57_600, 250_000] {
        let mut machine = boot(0);
        machine.heard();
        let mut ask = |rate: u32, bytes: &[u8]| {
            machine.set_baud(rate);
            Side::send(&mut machine, bytes);
            machine.run_ms(300);
            String::from_utf8_lossy(&machine.heard()).into_owned()
        };
        ask(rate, b"?\n$I\n?");
        assert!(ask(115_200, b"?").contains("<Idle|"), "{rate}");
        ask(115_200, b"\n");
        let heard = ask(115_200, b"$I\n");
        assert!(heard.starts_with("[VER:") && heard.ends_with("ok\r\n"), "{rate}: {heard}");
    }
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
