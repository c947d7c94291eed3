//! Machines that are selected on the chip: how long that takes, that a job runs on each, and that it survives a power
//! cut.

use kerf::boards::{MEGA2560_GRBL, RAMPS14_CNC};
use kerf::config::machines::ALL;
use kerf_sim::{Host, LINES_IN_FLIGHT, Machine};

use crate::common::{booted, firmware, set};

fn value(machine: &mut Machine, host: &mut Host, name: &str) -> f64 {
    let response = host.ask(machine, &format!("{{{name}:n}}"), 5_000).unwrap();
    response.body[name].as_f64().unwrap_or_else(|| panic!("{}", response.raw))
}

#[test]
fn a_job_runs_on_every_machine() {
    let (mut machine, mut host) = booted(&RAMPS14_CNC);
    set(&mut machine, &mut host, "{sv:0,qv:0}");
    for (number, profile) in ALL.iter().enumerate() {
        let before = machine.cycle();
        set(&mut machine, &mut host, &format!("{{mch:{number}}}"));
        let ms = (machine.cycle() - before) as f64 / machine.cycles(1) as f64;
        println!("{}: {ms:.1} ms", profile.name);
        // Thread mode is busy meanwhile; the watchdog waits for half a second.
        assert!(ms < 100.0, "{ms} ms");
        assert_eq!(value(&mut machine, &mut host, "mch"), number as f64);
        // Small moves.
        set(&mut machine, &mut host, "g91 g1 f200");
        for _ in 0..20 {
            for line in ["x0.3", "z0.1 x-0.2", "z-0.1 x-0.1"] {
                set(&mut machine, &mut host, line);
            }
        }
        set(&mut machine, &mut host, "m2");
        // The last moves are still under way.
        let mut wait = 0;
        while value(&mut machine, &mut host, "stat") == 5.0 {
            host.run_for_ms(&mut machine, 100).unwrap();
            wait += 1;
            assert!(wait < 200, "{} does not stop", profile.name);
        }
    }
    // The job ends where it began, on every machine.
    assert_eq!(value(&mut machine, &mut host, "posx"), 0.0);
}

#[test]
fn a_machine_survives_a_power_cut() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    set(&mut machine, &mut host, "{mch:3}");
    let before = machine.cycle();
    let mut writes = None;
    while writes != Some(machine.eeprom_writes()) {
        writes = Some(machine.eeprom_writes());
        host.run_for_ms(&mut machine, 200).unwrap();
    }
    let ms = (machine.cycle() - before) / machine.cycles(1);
    println!("{} bytes, {ms} ms", machine.eeprom_writes());
    assert!(ms < 5_000, "docs/settings.md says about 2.4 s");
    let left = *machine.eeprom();
    let (mut machine, mut host) = (firmware(&MEGA2560_GRBL), Host::new(LINES_IN_FLIGHT));
    machine.set_eeprom(&left);
    host.boot(&mut machine, 1_000).unwrap();
    for (name, expected) in [("mch", 3.0), ("xvm", 12_000.0), ("2mi", 16.0), ("avm", 2_880.0)] {
        assert_eq!(value(&mut machine, &mut host, name), expected, "{name}");
    }
}
