//! The watchdog resets a firmware that hangs, and does not reset one that works. The tests also check what is known
//! after the reset.

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::{Host, LINES_IN_FLIGHT, Machine};

use crate::common::{booted, firmware, set};

const TIMSK0: u16 = 0x6E;
const TIMSK1: u16 = 0x6F;

/// A machine in the middle of a move, with its spindle on.
fn moving() -> (Machine, Host) {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    set(&mut machine, &mut host, "m3 s2000");
    set(&mut machine, &mut host, "m8");
    set(&mut machine, &mut host, "g1 f400 x20");
    host.run_for_ms(&mut machine, 300).unwrap();
    assert!(machine.recorder().steps() > 100 && machine.is_high(MEGA2560_GRBL.outputs[0].unwrap()));
    let _ = machine.receive();
    (machine, host)
}

/// Runs until the reset. Returns how long that takes, ms, and what is heard after it.
fn until_reset(machine: &mut Machine) -> (u64, String) {
    let from = machine.cycle();
    let resets = machine.resets();
    while machine.resets() == resets {
        machine.run_for_ms(1).unwrap();
        assert!(machine.cycle() - from < machine.cycles(12_000), "no reset");
    }
    let ms = (machine.cycle() - from) / machine.cycles(1);
    let _ = machine.receive();
    for pin in MEGA2560_GRBL.hazards {
        assert!(!machine.is_high(*pin), "{pin:?}");
    }
    let steps = machine.recorder().steps();
    machine.run_for_ms(600).unwrap();
    assert_eq!(machine.recorder().steps(), steps, "it does not move by itself");
    (ms, String::from_utf8_lossy(&machine.receive()).into_owned())
}

/// Asks for the cause of the reset.
fn cause(machine: &mut Machine) -> String {
    machine.send(b"{rst:n}\n");
    machine.run_for_ms(100).unwrap();
    String::from_utf8_lossy(&machine.receive()).into_owned()
}

const READY: &str = "\"msg\":\"SYSTEM READY\"},\"f\":[1,0,0]}";
/// How a reset that nobody wanted is told while no dialect is settled.
const TOLD: &str = "ALARM:3\r\n";

#[test]
fn a_firmware_that_is_well_is_left_alone() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    host.run_for_ms(&mut machine, 2_000).unwrap();
    // A move of two steps a second, a dwell, a hold, settings, all settings at once.
    for line in ["g1 f0.1 x0.01", "g4 p1.5", "{xvm:700,yvm:700,p1csl:5}", "{sys:n}", "g1 f300 x3"] {
        set(&mut machine, &mut host, line);
    }
    host.run_for_ms(&mut machine, 8_000).unwrap();
    machine.send_now(b'!');
    host.run_for_ms(&mut machine, 2_000).unwrap();
    assert_eq!(machine.resets(), 0);
}

#[test]
fn without_ticks_of_the_clock_it_resets() {
    let (mut machine, _) = moving();
    machine.poke(TIMSK0, 0);
    let (ms, said) = until_reset(&mut machine);
    // The reset does not come before the end of the move, because steps go on without thread mode.
    assert!((2_500..5_000).contains(&ms), "{ms} ms");
    assert!(said.contains(READY) && said.contains(TOLD), "{said}");
    let is = cause(&mut machine);
    assert!(is.contains("{\"rst\":3}"), "{is}");
}

#[test]
fn without_the_step_interrupt_it_resets() {
    let (mut machine, _) = moving();
    machine.poke(TIMSK1, 0);
    let (ms, said) = until_reset(&mut machine);
    assert!((450..650).contains(&ms), "{ms} ms");
    assert!(said.contains(TOLD), "{said}");
    // The program that is being sent ends here.
    machine.send(b"g1 f400 x20\n");
    machine.run_for_ms(50).unwrap();
    let heard = String::from_utf8_lossy(&machine.receive()).into_owned();
    assert!(heard.contains("error:9\r\n"), "{heard}");
    let is = cause(&mut machine);
    assert!(is.contains("{\"rst\":3}"), "{is}");
}

#[test]
fn a_reset_that_was_asked_for_is_told_apart() {
    let (mut machine, _) = moving();
    machine.send_now(0x18);
    let (ms, said) = until_reset(&mut machine);
    assert!(ms < 50, "{ms} ms");
    assert!(said.contains(READY) && !said.contains("\"er\"") && !said.contains("ALARM"), "{said}");
    let is = cause(&mut machine);
    assert!(is.contains("{\"rst\":4}"), "{is}");
    // After that the reported cause is that of the next reset.
    machine.poke(TIMSK0, 0);
    let (_, said) = until_reset(&mut machine);
    assert!(said.contains(TOLD), "{said}");
}

#[test]
fn power_that_comes_on_is_no_news() {
    let (mut machine, mut host) = (firmware(&MEGA2560_GRBL), Host::new(LINES_IN_FLIGHT));
    host.boot(&mut machine, 1_000).unwrap();
    let is = cause(&mut machine);
    assert!(is.contains("{\"rst\":0}") && !is.contains("\"er\""), "{is}");
}
