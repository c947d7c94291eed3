//! The models of peripherals, tested by programs that run on them.

use kerf_sim::Fault;

use crate::common::{machine, machine_of, word};

fn asked(name: &str) -> u16 {
    let mut m = machine("models.c");
    m.run_for_ms(20).unwrap();
    assert_eq!(word(&m, "finished"), 1);
    word(&m, name)
}

#[test]
fn entering_an_interrupt_takes_five_cycles() {
    // Flag one count after the match at 40, 5 to enter, 3 to jump, 2 to push, sampled in the second
    // cycle of the load.
    assert_eq!(asked("entry_count"), 41 + 5 + 3 + 2 + 1);
}

#[test]
fn waking_takes_four_more() {
    assert_eq!(asked("entry_from_sleep"), 201 + 5 + 4 + 3 + 2 + 1);
}

#[test]
fn a_flag_stays_while_masked() {
    assert_eq!(asked("late_flag"), 3);
}

#[test]
fn a_compare_value_behind_the_counter_does_not_match() {
    assert_eq!(asked("behind"), 0);
}

#[test]
fn a_flag_is_cleared_alone() {
    assert_eq!(asked("sbi_flags"), 1);
}

#[test]
fn a_timer_starts_from_its_preset() {
    let cycles = asked("preset");
    assert!((248..270).contains(&cycles), "{cycles}");
}

#[test]
fn a_stopped_timer_keeps_its_count() {
    let count = asked("held");
    assert!((77..=80).contains(&count), "{count}");
}

#[test]
fn a_ctc_period_is_top_plus_one() {
    let cycles = asked("ctc_period");
    assert!((50 * 400 - 12..50 * 400 + 12).contains(&cycles), "{cycles}");
}

#[test]
fn sixteen_bit_registers_share_a_byte() {
    assert_eq!(asked("torn"), 0x12FF);
}

#[test]
fn udrie_is_a_software_interrupt() {
    assert_eq!(asked("soft_unpended"), 0, "cleared before it was taken");
    assert_eq!(asked("soft_taken"), 5, "taken once, then four times while it stays set");
}

#[test]
fn an_eeprom_write_takes_its_time() {
    assert_eq!(asked("eeprom_busy"), 3);
    assert!((33..=35).contains(&asked("eeprom_ms")));
}

#[test]
fn a_watchdog_reset_is_counted() {
    let mut m = machine("watchdog.c");
    m.run_for_ms(50).unwrap();
    assert_eq!((m.resets(), word(&m, "boots"), word(&m, "by_watchdog")), (2, 3, 2));
    assert!(m.cycle() >= m.cycles(50), "time goes on");
}

#[test]
fn sleep_needs_its_enable_bit() {
    // sleep; rjmp .-4 with SE clear: never asleep.
    let mut m = machine_of(&[0x9588, 0xCFFE]);
    m.run_for_ms(1).unwrap();
}

#[test]
fn faults_are_told() {
    let mut bad = machine_of(&[0x0001]);
    assert!(matches!(bad.run_for_ms(1), Err(Fault::BadInstruction { .. })));
    // ldi r16, 1; out SMCR, r16; sleep
    let mut asleep = machine_of(&[0xE001, 0xBF03, 0x9588]);
    assert!(matches!(asleep.run_for_ms(1), Err(Fault::SleepsForever { .. })));
}
