//! The millisecond count of the image wraps after 2^32 ms, 49.7 days. Each machine here starts 3 s before the wrap.

use kerf::boards::RAMPS14_CNC;
use kerf_sim::{Host, LINES_IN_FLIGHT, Machine};

use crate::common::{age, firmware, set};

/// A machine that has run for 49.7 days minus 3 s.
fn old() -> (Machine, Host) {
    let mut machine = firmware(&RAMPS14_CNC);
    age(&mut machine, 3_000);
    let mut host = Host::new(LINES_IN_FLIGHT);
    host.boot(&mut machine, 1_000).unwrap();
    (machine, host)
}

/// Runs until the count has wrapped, and for longer than the watchdog waits.
fn pass(machine: &mut Machine, host: &mut Host) {
    host.run_for_ms(machine, 12_000).unwrap();
    assert_eq!(machine.resets(), 0, "the watchdog has bitten");
    set(machine, host, "{fb:n}");
}

#[test]
fn idle() {
    let (mut machine, mut host) = old();
    pass(&mut machine, &mut host);
    set(&mut machine, &mut host, "{xvm:700}");
    host.run_for_ms(&mut machine, 200).unwrap();
    assert!(machine.eeprom_writes() > 0, "the setting is stored");
}

#[test]
fn with_a_spindle() {
    let (mut machine, mut host) = old();
    set(&mut machine, &mut host, "m3 s1000");
    pass(&mut machine, &mut host);
    let spindle = RAMPS14_CNC.outputs[0].unwrap();
    assert!(machine.is_high(spindle));
    set(&mut machine, &mut host, "m5");
    host.run_for_ms(&mut machine, 100).unwrap();
    assert!(!machine.is_high(spindle));
}

#[test]
fn in_a_dwell() {
    let (mut machine, mut host) = old();
    set(&mut machine, &mut host, "g4 p13");
    set(&mut machine, &mut host, "g1 x1 f500");
    pass(&mut machine, &mut host);
    assert_eq!(machine.recorder().steps(), 0);
    host.run_for_ms(&mut machine, 1_500).unwrap();
    assert_eq!(machine.recorder().motors()[0].position, 1_280);
}

#[test]
fn in_a_move() {
    let (mut machine, mut host) = old();
    set(&mut machine, &mut host, "g1 x110 f500");
    pass(&mut machine, &mut host);
    host.run_for_ms(&mut machine, 1_500).unwrap();
    assert_eq!(machine.recorder().motors()[0].position, 140_800);
}
