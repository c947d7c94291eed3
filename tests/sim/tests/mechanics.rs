//! A machine around the chip, seen by programs that run on it.

use kerf::boards::{RAMPS14, inputs};
use kerf_sim::Machine;
use kerf_sim::mechanics::{Bounce, Build};

use crate::common::{build, machine, word};

#[test]
fn a_level_from_outside_outlives_writes_to_its_port() {
    let mut m = machine("pins.c");
    m.run_for_ms(1).unwrap();
    assert_eq!(word(&m, "changes"), 0);
    for (n, high) in [false, true, false, false].into_iter().enumerate() {
        m.drive_pin('B', 4, high);
        m.run_for_ms(1).unwrap();
        assert_eq!(word(&m, "level") != 0, high);
        assert_eq!(usize::from(word(&m, "changes")), (n + 1).min(3));
    }
}

#[test]
fn an_edge_is_served_in_its_cycle() {
    let mut m = machine("pins.c");
    m.build(&Build::of(m.board()));
    m.run_for_ms(1).unwrap();
    m.run_until(20_000).unwrap();
    m.tamper(|mechanics, _| mechanics.disturb(inputs::X_MIN, 30_000, 400));
    m.run_until(30_200).unwrap();
    let entered = m.peek_word(m.image().variable("entered").unwrap());
    let started = 20;
    // From the edge: the instruction under way, 5 to enter, 3 to jump, about 20 to save registers.
    assert!((30_000 - 200 - started..30_060).contains(&u64::from(entered)), "{entered}");
    assert_eq!(word(&m, "level"), 0);
    m.run_until(31_000).unwrap();
    assert_ne!(word(&m, "level"), 0);
}

#[test]
fn every_bounce_is_an_edge() {
    let mut m = Machine::load(&build("pins.c"), &RAMPS14).unwrap();
    m.build(&Build::of(&RAMPS14));
    m.run_for_ms(1).unwrap();
    assert_eq!(word(&m, "externals"), 0, "power-up is none");
    m.tamper(|mechanics, now| {
        mechanics.bounce(inputs::X_MIN, Some(Bounce { times: 4, cycles: 16_000 }));
        mechanics.work(inputs::X_MIN, true, now);
    });
    m.run_for_ms(2).unwrap();
    assert_eq!(word(&m, "externals"), 9);
}
